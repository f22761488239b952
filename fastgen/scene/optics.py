"""What a Scene says of its lenses, sensors and weather: plain frozen data."""

from dataclasses import dataclass, field

from fastgen.errors import ConfigError
from fastgen.validation import UNIT, bounds, check_known

WHOLE = bounds(0, 2**63 - 1)

LENS_MODELS = {"brown_conrady": 5, "fisheye": 4}
"""Coefficients of each lens model, in OpenCV's order."""


@dataclass(frozen=True)
class Lens:
    """Distortion of a lens as OpenCV has it, so that a calibration can be pasted in.

    model: brown_conrady, with coefficients k1, k2, p1, p2, k3 (Brown 1971, "Close-Range Camera
    Calibration"), or fisheye, with k1, k2, k3, k4 (Kannala and Brandt 2006, "A Generic Camera Model
    and Calibration Method", eq. 6): radius = f (a + k1 a^3 + ... + k4 a^9), a the angle off axis.
    Raises ConfigError for another model or another count of coefficients.
    """

    model: str
    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse what no formula fits."""
        check_known("model", self.model, LENS_MODELS)
        wanted = LENS_MODELS[self.model]
        if len(self.coefficients) != wanted:
            raise ConfigError(
                f"coefficients: {self.model} takes {wanted}, got {len(self.coefficients)}"
            )


@dataclass(frozen=True)
class Noise:
    """A sensor's noise, see sensor/electronics.py. full_well_e: electrons that make white;
    read_noise_e: standard deviation without light, in electrons; seed: of this image's noise."""

    full_well_e: float = field(metadata=bounds(1.0, 1e9, "electrons"))
    read_noise_e: float = field(metadata=bounds(0.0, 1e6, "electrons"))
    seed: int = field(metadata=WHOLE)


@dataclass(frozen=True)
class Stamp:
    """Text that the camera burns in: one line, in which corner (top or bottom, left or right),
    height of its capitals as a share of the image's."""

    text: str
    corner: str
    height: float = field(metadata=bounds(0.001, 1.0))


@dataclass(frozen=True)
class Defocus:
    """A thin lens focused at focus_mm along the optical axis, its aperture focal_mm / f_number."""

    focus_mm: float = field(metadata=bounds(1.0, 1e9, "mm"))
    f_number: float = field(metadata=bounds(0.1, 1e4))


@dataclass(frozen=True)
class Sensor:
    """What one camera does to one image, see sensor/develop.py; the defaults do nothing.

    motion: how far the image moves while the shutter is open, as a share of its width, right and
    down. vignetting: light lost in the corners, 0..1. exposure_error_ev: stops. gains: of red,
    green and blue, white balance's error. jpeg_quality: 0 for none.
    """

    defocus: Defocus | None = None
    motion: tuple[float, float] = field(default=(0.0, 0.0), metadata=bounds(-1.0, 1.0))
    vignetting: float = field(default=0.0, metadata=bounds(0.0, 0.95))
    exposure_error_ev: float = field(default=0.0, metadata=bounds(-30.0, 30.0, "stops"))
    gains: tuple[float, float, float] = field(default=(1.0, 1.0, 1.0), metadata=bounds(0.0, 1000.0))
    noise: Noise | None = None
    stamp: Stamp | None = None
    jpeg_quality: int = field(default=0, metadata=bounds(0, 100))


@dataclass(frozen=True)
class Rain:
    """Falling drops. rate_mm_h: of water; shutter_s: for how long each draws its streak; wind: its
    speed across the image over that of the fall; seed: of where they are."""

    rate_mm_h: float = field(metadata=bounds(0.001, 1000.0, "mm/h"))
    shutter_s: float = field(metadata=bounds(1e-6, 1.0, "s"))
    wind: float = field(metadata=bounds(-10.0, 10.0))
    seed: int = field(metadata=WHOLE)


@dataclass(frozen=True)
class Weather:
    """Between container and camera, and on the container. visibility_mm: of fog, 0 without; wetness
    of painted surfaces 0..1."""

    visibility_mm: float = field(default=0.0, metadata=bounds(0.0, 1e9, "mm"))
    rain: Rain | None = None
    wetness: float = field(default=0.0, metadata=UNIT)
