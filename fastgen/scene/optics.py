"""Lens, sensor, lamps and weather of a Scene, as plain frozen data."""

from dataclasses import dataclass
from typing import Annotated

from fastgen.errors import ConfigError
from fastgen.scene.limits import CORNERS, WHOLE, Degrees, Number
from fastgen.validation import Bounds, OneOf, Share, check_known

LENS_MODELS = {"brown_conrady": 5, "fisheye": 4}
"""Number of coefficients of each lens model, which are in OpenCV's order."""

CLIP_LIMITS = (1.0, 2.0)
"""Linear light that a response curve maps to white; its straight part ends at 2 - clip."""

CONTRAST_LIMITS = (0.8, 2.0)
"""Slope of a response curve at middle grey. Lower values would be too steep near black for the
table that the curve is stored in."""

ASPECT_LIMITS = (0.5, 2.0)
"""Focal length down an image relative to that across it."""

PRINCIPAL_LIMITS = (-0.45, 0.45)
"""Distance of the principal point from the centre of an image, as a share of its width."""

SHUTTER_LIMITS_S = (1e-5, 0.5)
"""Shortest and longest time that a shutter may be open."""

ISO_LIMITS = (100.0, 1e6)
"""Lowest and highest sensitivity of a sensor; the lowest is without gain."""

SPEED_LIMIT = 2.0
"""Fastest movement of an image in widths per second; at the longest shutter time it blurs over the
whole width."""

LAMP_LIMITS_LX = (0.001, 1e5)
"""Illuminance of a lamp; it may not be 0."""

_Part = Annotated[float, Bounds(0.001, 1000.0)]
_Speed = Annotated[float, Bounds(-SPEED_LIMIT, SPEED_LIMIT)]
_Move = Annotated[float, Bounds(-1.0, 1.0)]
_Gain = Annotated[float, Bounds(0.0, 1000.0)]


@dataclass(frozen=True)
class Lens:
    """Distortion of a lens, in OpenCV's conventions: a calibration can be pasted in.

    Attributes:
        model: 'brown_conrady' (Brown 1971, "Close-Range Camera Calibration") or 'fisheye' (Kannala
            and Brandt 2006, "A Generic Camera Model and Calibration Method", eq. 6). A fisheye
            maps the angle a from the optical axis to the radius f (a + k1 a^3 + ... + k4 a^9).
        coefficients: k1, k2, p1, p2, k3 of brown_conrady; k1, k2, k3, k4 of fisheye.

    Raises:
        ConfigError: for another model or another number of coefficients.
    """

    model: Annotated[str, OneOf(tuple(LENS_MODELS))]
    coefficients: tuple[Number, ...]

    def __post_init__(self) -> None:
        """Check the model and the number of its coefficients."""
        check_known("model", self.model, LENS_MODELS)
        wanted = LENS_MODELS[self.model]
        if len(self.coefficients) != wanted:
            raise ConfigError(
                f"coefficients: {self.model} takes {wanted}, got {len(self.coefficients)}"
            )


@dataclass(frozen=True)
class Noise:
    """Noise of a sensor, applied by camera/electronics.py.

    Attributes:
        full_well_e: Electrons of a white pixel without gain.
        read_noise_e: Standard deviation without light, in electrons.
        seed: Seed of the noise of this image.
    """

    full_well_e: Annotated[float, Bounds(1.0, 1e9, "electrons")]
    read_noise_e: Annotated[float, Bounds(0.0, 1e6, "electrons")]
    seed: Annotated[int, WHOLE]


@dataclass(frozen=True)
class Stamp:
    """One line of text that the camera burns into the image.

    Attributes:
        text: The line.
        corner: 'top left', 'top right', 'bottom left' or 'bottom right'.
        height: Height of its capitals as a share of the image height.
    """

    text: str
    corner: Annotated[str, OneOf(CORNERS)]
    height: Annotated[float, Bounds(0.001, 1.0)]


@dataclass(frozen=True)
class Defocus:
    """A thin lens that is focused at `focus_mm` along the optical axis.

    Its aperture has the diameter focal_mm / f_number.
    """

    focus_mm: Annotated[float, Bounds(1.0, 1e9, "mm")]
    f_number: Annotated[float, Bounds(0.1, 1e4)]


@dataclass(frozen=True)
class Response:
    """Response curve of a camera, which clips bright light to white; see camera/response.py.

    Attributes:
        clip: Linear light that becomes white. A white surface in metered light is about 1.
        contrast: Slope of the encoded curve at middle grey; 1 for no change.
        saturation: Factor of each colour's distance from grey; 1 for no change.
    """

    clip: Annotated[float, Bounds(*CLIP_LIMITS)]
    contrast: Annotated[float, Bounds(*CONTRAST_LIMITS)]
    saturation: Annotated[float, Bounds(0.0, 3.0)]


@dataclass(frozen=True)
class ChromaNoise:
    """Blotches of colour that denoising leaves, applied by camera/electronics.py.

    Attributes:
        strength: Standard deviation of Cb and Cr (ITU-R BT.601) without gain, as a share of white.
        scale_px: Size of the blotches in pixels.
        seed: Seed of the blotches of this image.
    """

    strength: Annotated[float, Bounds(0.0, 0.5)]
    scale_px: Annotated[float, Bounds(1.0, 100.0, "pixels")]
    seed: Annotated[int, WHOLE]


@dataclass(frozen=True)
class Sharpening:
    """Unsharp mask of the camera, which leaves halos along edges.

    Attributes:
        amount: Factor of the difference to the blurred image that is added.
        radius_px: Standard deviation of the blur in pixels.
    """

    amount: Annotated[float, Bounds(0.0, 10.0)]
    radius_px: Annotated[float, Bounds(0.1, 20.0, "pixels")]


@dataclass(frozen=True)
class Meter:
    """Automatic exposure within the limits of a camera, applied by camera/exposure.py.

    Attributes:
        f_number: F-number of the aperture, which is fixed.
        longest_s: Longest time that the shutter is open.
        largest_iso: Highest sensitivity; 100 is the sensitivity without gain.
        dim_target: Linear value that the metered mean is exposed to at 10 lx and below. It rises
            to 0.18 at 1000 lx.
        highlights: Share of the pixels that may clip. The exposure is lowered by up to one stop
            to keep it; 1 for no lowering.
    """

    f_number: Annotated[float, Bounds(0.5, 64.0)]
    longest_s: Annotated[float, Bounds(*SHUTTER_LIMITS_S, "s")]
    largest_iso: Annotated[float, Bounds(*ISO_LIMITS)]
    dim_target: Annotated[float, Bounds(0.001, 0.18)] = 0.18
    highlights: Share = 1.0


@dataclass(frozen=True)
class Sensor:
    """Effects of one camera on one image, applied by camera/sensor.py. The defaults do nothing.

    Attributes:
        defocus: Focus and aperture; None for a sharp image.
        meter: Limits of automatic exposure; None for a camera that exposes any light equally well.
        motion: Movement of the image during the exposure, right and down, as a share of its width.
        speed: Further movement, in widths per second of the meter's shutter time.
        vignetting: Share of the light that is lost in the corners.
        exposure_error_ev: Exposure error in stops.
        gains: White balance error: factors of red, green and blue.
        noise: Sensor noise, or None.
        response: Response curve; None for the neutral tone curve of the renderer.
        chroma_noise: Blotches of colour, or None.
        sharpening: Unsharp mask, or None.
        stamp: Text burnt into the image, or None.
        jpeg_quality: Quality of the camera's own JPEG encoder, 0 for none.
    """

    defocus: Defocus | None = None
    meter: Meter | None = None
    motion: tuple[_Move, _Move] = (0.0, 0.0)
    speed: tuple[_Speed, _Speed] = (0.0, 0.0)
    vignetting: Annotated[float, Bounds(0.0, 0.95)] = 0.0
    exposure_error_ev: Annotated[float, Bounds(-30.0, 30.0, "stops")] = 0.0
    gains: tuple[_Gain, _Gain, _Gain] = (1.0, 1.0, 1.0)
    noise: Noise | None = None
    response: Response | None = None
    chroma_noise: ChromaNoise | None = None
    sharpening: Sharpening | None = None
    stamp: Stamp | None = None
    jpeg_quality: Annotated[int, Bounds(0, 100)] = 0

    def __post_init__(self) -> None:
        """Refuse a speed without the shutter time of a meter."""
        if self.speed != (0.0, 0.0) and self.meter is None:
            raise ConfigError("speed: needs the shutter time of a meter; give one or use motion")


@dataclass(frozen=True)
class Lamp:
    """A floodlight, far enough from the container that its light is parallel.

    Attributes:
        azimuth_deg: Direction toward the lamp, counter-clockwise from +x.
        elevation_deg: Elevation above the horizon.
        illuminance_lx: Light on a surface that faces the lamp.
        color: Linear Rec. 709 of the light; only the ratios matter.
    """

    azimuth_deg: Degrees
    elevation_deg: Annotated[float, Bounds(-90.0, 90.0, "degrees")]
    illuminance_lx: Annotated[float, Bounds(*LAMP_LIMITS_LX, "lx")]
    color: tuple[_Part, _Part, _Part] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Rain:
    """Falling drops.

    Attributes:
        rate_mm_h: Water that falls, in mm per hour.
        shutter_s: Exposure time in which a drop draws its streak, for cameras without a meter.
        wind: Speed of the drops across the image, as a multiple of their falling speed.
        seed: Seed of their positions.
    """

    rate_mm_h: Annotated[float, Bounds(0.001, 1000.0, "mm/h")]
    shutter_s: Annotated[float, Bounds(1e-6, 1.0, "s")]
    wind: Annotated[float, Bounds(-10.0, 10.0)]
    seed: Annotated[int, WHOLE]


@dataclass(frozen=True)
class Weather:
    """Fog and rain before the camera, and water on the container. Fog also dims the sun.

    Attributes:
        visibility_mm: Visibility in fog; 0 without fog.
        rain: Falling rain, or None.
        wetness: Wetness of painted surfaces.
    """

    visibility_mm: Annotated[float, Bounds(0.0, 1e9, "mm")] = 0.0
    rain: Rain | None = None
    wetness: Share = 0.0
