"""Ranges of what a real camera and its weather do to an image; everything is off by default."""

from dataclasses import dataclass, field

from fastgen.errors import ConfigError
from fastgen.scene.limits import CORNERS
from fastgen.scene.optics import LENS_MODELS
from fastgen.validation import UNIT, Range, bounds, check_known, check_order

_ZERO = Range(0.0, 0.0)
_COEFFICIENT = bounds(-10.0, 10.0)


@dataclass(frozen=True)
class LensConfig:
    """A lens's distortion by OpenCV's coefficients, which differ a little between lenses of a kind.

    model: brown_conrady takes k1, k2, k3, p1 and p2, fisheye (Kannala-Brandt) k1 to k4.
    k1, k2, k3, k4: radial.
    p1, p2: tangential.
    """

    model: str = "brown_conrady"
    k1: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    k2: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    k3: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    k4: Range = field(default=_ZERO, metadata=_COEFFICIENT)
    p1: Range = field(default=_ZERO, metadata=bounds(-0.1, 0.1))
    p2: Range = field(default=_ZERO, metadata=bounds(-0.1, 0.1))

    def __post_init__(self) -> None:
        """Refuse coefficients that the model has not."""
        check_known("model", self.model, LENS_MODELS)
        foreign = ("p1", "p2") if self.model == "fisheye" else ("k4",)
        for name in foreign:
            if getattr(self, name) != _ZERO:
                raise ConfigError(f"{name}: {self.model} has no {name}; leave it out")

    @property
    def names(self) -> tuple[str, ...]:
        """The model's coefficients in OpenCV's order."""
        fisheye = self.model == "fisheye"
        return ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")


@dataclass(frozen=True)
class NoiseConfig:
    """Photon shot and read noise. Small outdoor cameras' pixels hold 5,000 to 20,000 electrons.

    probability: of an image that has it.
    full_well_e: electrons that make white; drawn so that twice as many are as likely at any level.
    read_noise_e: standard deviation without light.
    """

    probability: float = field(default=0.0, metadata=UNIT)
    full_well_e: Range = field(default=Range(2500, 12000), metadata=bounds(50, 1e6, "electrons"))
    read_noise_e: Range = field(default=Range(2, 12), metadata=bounds(0, 1e4, "electrons"))


@dataclass(frozen=True)
class StampConfig:
    """Date and time burnt in.

    probability: of an image that has it.
    years: of the date.
    corners: where it may stand: top left, top right, bottom left, bottom right.
    height: of its capitals, as a share of the image's.
    """

    probability: float = field(default=0.0, metadata=UNIT)
    years: tuple[int, int] = field(default=(2019, 2027), metadata=bounds(1970, 2100))
    corners: tuple[str, ...] = CORNERS
    height: Range = field(default=Range(0.018, 0.032), metadata=bounds(0.005, 0.2))

    def __post_init__(self) -> None:
        """Hold corners to those that exist, and the years to their order."""
        for corner in self.corners:
            check_known("corners", corner, CORNERS)
        if not self.corners:
            raise ConfigError("corners: the list is empty; give at least one")
        check_order("years", self.years)


@dataclass(frozen=True)
class DefocusConfig:
    """A focus that misses the container.

    probability: of an image that has it.
    focus: what is sharp, as a share of the distance to the target.
    f_number: of the aperture.
    """

    probability: float = field(default=0.0, metadata=UNIT)
    focus: Range = field(default=Range(0.25, 0.8), metadata=bounds(0.01, 100.0))
    f_number: Range = field(default=Range(1.4, 4.0), metadata=bounds(0.5, 64.0))


@dataclass(frozen=True)
class MotionConfig:
    """Camera and load move while the shutter is open.

    probability: of an image that has it.
    extent: how far, as a share of the image's width.
    """

    probability: float = field(default=0.0, metadata=UNIT)
    extent: Range = field(default=Range(0.001, 0.012), metadata=bounds(0.0, 0.2))


@dataclass(frozen=True)
class SensorConfig:
    """What cameras do to their images; applies to each camera of the rig.

    vignetting: share of the light that is lost in the corners.
    exposure_error_ev: beyond the rig's exposure_ev, after the lens, clipping included.
    white_balance_ev: by which red and blue stray from green.
    jpeg_quality: of the camera's own encoder, 0 for none.
    """

    defocus: DefocusConfig = field(default_factory=DefocusConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    vignetting: Range = field(default=_ZERO, metadata=bounds(0.0, 0.95))
    exposure_error_ev: Range = field(default=_ZERO, metadata=bounds(-6.0, 6.0, "stops"))
    white_balance_ev: Range = field(default=_ZERO, metadata=bounds(-2.0, 2.0, "stops"))
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    stamp: StampConfig = field(default_factory=StampConfig)
    jpeg_quality: tuple[int, int] = field(default=(0, 0), metadata=bounds(0, 100))

    def __post_init__(self) -> None:
        """Hold the qualities to their order."""
        check_order("jpeg_quality", self.jpeg_quality)


@dataclass(frozen=True)
class WeatherConfig:
    """How often there is fog or rain, and how wet what was rained on is.

    fog_probability: of a scene in fog.
    visibility_mm: distance at which fog leaves 2 % of a contrast (Koschmieder); fog is below 1 km.
    rain_probability: of a scene in rain.
    rate_mm_h: of water that falls.
    shutter_s: for how long a drop draws its streak.
    wind: speed of drops across the image over that of their fall.
    wet_probability: of a scene that is wet without rain.
    wetness: of paint in rain or after it.
    """

    fog_probability: float = field(default=0.0, metadata=UNIT)
    visibility_mm: Range = field(default=Range(2.5e4, 3e5), metadata=bounds(1000, 1e8, "mm"))
    rain_probability: float = field(default=0.0, metadata=UNIT)
    rate_mm_h: Range = field(default=Range(2, 50), metadata=bounds(0.1, 300, "mm/h"))
    shutter_s: Range = field(default=Range(0.0005, 0.004), metadata=bounds(1e-5, 0.1, "s"))
    wind: Range = field(default=Range(-0.5, 0.5), metadata=bounds(-3.0, 3.0))
    wet_probability: float = field(default=0.0, metadata=UNIT)
    wetness: Range = field(default=Range(0.3, 1.0), metadata=UNIT)
