"""Ranges of lens, sensor and weather effects on an image. All are off by default."""

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import MinLen

from fastgen.errors import ConfigError
from fastgen.scene.limits import CORNERS
from fastgen.scene.optics import (
    CLIP_LIMITS,
    CONTRAST_LIMITS,
    ISO_LIMITS,
    LENS_MODELS,
    SHUTTER_LIMITS_S,
    SPEED_LIMIT,
)
from fastgen.validation import UNIT, Bounds, OneOf, Range, Share

_ZERO = Range(0.0, 0.0)
_Radial = Annotated[Range, Bounds(-10.0, 10.0)]
_Tangential = Annotated[Range, Bounds(-0.1, 0.1)]


@dataclass(frozen=True)
class LensConfig:
    """Distortion in OpenCV's coefficients, which vary a little between lenses of one type.

    Attributes:
        model: brown_conrady uses k1, k2, k3, p1 and p2; fisheye (Kannala-Brandt) uses k1 to k4.
        k1: First radial coefficient.
        k2: Second radial coefficient.
        k3: Third radial coefficient.
        k4: Fourth radial coefficient, of a fisheye only.
        p1: First tangential coefficient, not of a fisheye.
        p2: Second tangential coefficient, not of a fisheye.
    """

    model: Annotated[str, OneOf(tuple(LENS_MODELS))] = "brown_conrady"
    k1: _Radial = _ZERO
    k2: _Radial = _ZERO
    k3: _Radial = _ZERO
    k4: _Radial = _ZERO
    p1: _Tangential = _ZERO
    p2: _Tangential = _ZERO

    def __post_init__(self) -> None:
        """Refuse coefficients that the model does not have."""
        foreign = ("p1", "p2") if self.model == "fisheye" else ("k4",)
        for name in foreign:
            if getattr(self, name) != _ZERO:
                raise ConfigError(f"{name}: {self.model} has no {name}; leave it out")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the model's coefficients in OpenCV's order."""
        fisheye = self.model == "fisheye"
        return ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")


@dataclass(frozen=True)
class NoiseConfig:
    """Photon shot noise and read noise.

    Attributes:
        probability: Probability that an image has noise.
        full_well_e: Electrons of a white pixel without gain, drawn log-uniformly. Pixels of small
            outdoor cameras hold 5,000 to 20,000. The number is divided by the gain of a meter.
        read_noise_e: Standard deviation without light.
    """

    probability: Share = 0.0
    full_well_e: Annotated[Range, Bounds(50, 1e6, "electrons")] = Range(2500, 12000)
    read_noise_e: Annotated[Range, Bounds(0, 1e4, "electrons")] = Range(2, 12)


@dataclass(frozen=True)
class ResponseConfig:
    """Response curve of a camera. Unlike the neutral tone curve, it clips bright light.

    Attributes:
        probability: Probability that an image has a camera's curve; others have the neutral one.
        clip: Linear light that becomes white; a white surface in metered light is about 1. The
            curve is straight up to 2 - clip and then bends toward white.
        contrast: Slope of the encoded curve at middle grey.
        saturation: Factor of each colour's distance from grey.
    """

    probability: Share = 0.0
    clip: Annotated[Range, Bounds(*CLIP_LIMITS)] = Range(1.0, 1.5)
    contrast: Annotated[Range, Bounds(*CONTRAST_LIMITS)] = Range(1.0, 1.5)
    saturation: Annotated[Range, Bounds(0.0, 3.0)] = Range(0.9, 1.3)


@dataclass(frozen=True)
class ChromaNoiseConfig:
    """Blotches of colour that denoising leaves. The luma of a pixel is unchanged.

    Attributes:
        probability: Probability that an image has chroma noise.
        strength: Standard deviation of Cb and Cr as a share of white, without gain. It grows with
            the square root of a meter's gain.
        scale_px: Size of the blotches.
    """

    probability: Share = 0.0
    strength: Annotated[Range, Bounds(0.0, 0.5)] = Range(0.002, 0.01)
    scale_px: Annotated[Range, Bounds(1.0, 100.0, "pixels")] = Range(2.5, 8)


@dataclass(frozen=True)
class SharpeningConfig:
    """Unsharp mask of the camera, which leaves halos along edges.

    Attributes:
        probability: Probability that an image is sharpened.
        amount: Factor of the difference to the blurred image that is added.
        radius_px: Standard deviation of the blur.
    """

    probability: Share = 0.0
    amount: Annotated[Range, Bounds(0.0, 10.0)] = Range(0.2, 1.0)
    radius_px: Annotated[Range, Bounds(0.1, 20.0, "pixels")] = Range(0.6, 1.6)


@dataclass(frozen=True)
class StampConfig:
    """Date and time burnt into the image.

    Attributes:
        probability: Probability that an image has a stamp.
        years: First and last year of the date, both included. The time of day suits the
            environment's light.
        corners: Corners of the image; all are equally likely.
        height: Height of the capitals as a share of the image height, at least 5 px. Text wider
            than the image is scaled down to fit.
    """

    probability: Share = 0.0
    years: Annotated[tuple[int, int], Bounds(1970, 2100)] = (2019, 2027)
    corners: Annotated[tuple[Annotated[str, OneOf(CORNERS)], ...], MinLen(1)] = CORNERS
    height: Annotated[Range, Bounds(0.005, 0.2)] = Range(0.018, 0.032)


@dataclass(frozen=True)
class DefocusConfig:
    """Focus that misses the container.

    Attributes:
        probability: Probability that an image is out of focus.
        focus: Focused distance as a multiple of the distance to the target.
        f_number: F-number of the aperture.
    """

    probability: Share = 0.0
    focus: Annotated[Range, Bounds(0.01, 100.0)] = Range(0.25, 0.8)
    f_number: Annotated[Range, Bounds(0.5, 64.0)] = Range(1.4, 4.0)


@dataclass(frozen=True)
class MotionConfig:
    """Motion of camera and load during the exposure.

    Attributes:
        probability: Probability that an image has motion blur.
        extent: Length of the motion as a share of the image width, for cameras without a meter.
        speed: Speed of the motion in image widths per second, for cameras with a meter. The
            length of the blur is this speed times the shutter time.
    """

    probability: Share = 0.0
    extent: Annotated[Range, Bounds(0.0, 0.2)] = Range(0.001, 0.012)
    speed: Annotated[Range, Bounds(0.0, SPEED_LIMIT)] = Range(0.02, 0.3)


@dataclass(frozen=True)
class MeterConfig:
    """Limits of automatic exposure. They leave dim scenes dark, noisy and blurred.

    Without a meter, every scene is exposed to the same mean, however dark it is. The illuminance of
    each HDRI is a key of `environment`.

    Attributes:
        probability: Probability that a camera has these limits.
        f_number: F-number of the aperture, which is fixed.
        longest_s: Longest time that the shutter is open.
        largest_iso: Highest sensitivity, drawn log-uniformly; 100 is without gain.
        dim_target: Linear value that the metered mean is exposed to at 10 lx and below. It rises to
            0.18 at 1000 lx.
        highlights: Share of the pixels that may clip. The exposure is lowered by up to one stop to
            keep it; 1 for no lowering.
    """

    probability: Share = 0.0
    f_number: Annotated[Range, Bounds(0.5, 64.0)] = Range(1.4, 2.8)
    longest_s: Annotated[Range, Bounds(*SHUTTER_LIMITS_S, "s")] = Range(0.01, 0.04)
    largest_iso: Annotated[Range, Bounds(*ISO_LIMITS)] = Range(800, 3200)
    dim_target: Annotated[Range, Bounds(0.001, 0.18)] = Range(0.05, 0.08)
    highlights: Annotated[Range, UNIT] = Range(0.01, 0.06)


@dataclass(frozen=True)
class SensorConfig:
    """Effects of the sensor on an image, the same for every camera of the rig.

    Attributes:
        vignetting: Share of the light that is lost in the corners.
        exposure_error_ev: Exposure error after the lens, in addition to exposure_ev of the camera.
        white_balance_ev: Deviation of red and of blue from green.
        jpeg_quality: Quality of the camera's own JPEG encoder, 0 for none.
    """

    defocus: DefocusConfig = field(default_factory=DefocusConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    meter: MeterConfig = field(default_factory=MeterConfig)
    vignetting: Annotated[Range, Bounds(0.0, 0.95)] = _ZERO
    exposure_error_ev: Annotated[Range, Bounds(-6.0, 6.0, "stops")] = _ZERO
    white_balance_ev: Annotated[Range, Bounds(-2.0, 2.0, "stops")] = _ZERO
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    response: ResponseConfig = field(default_factory=ResponseConfig)
    chroma_noise: ChromaNoiseConfig = field(default_factory=ChromaNoiseConfig)
    sharpening: SharpeningConfig = field(default_factory=SharpeningConfig)
    stamp: StampConfig = field(default_factory=StampConfig)
    jpeg_quality: Annotated[tuple[int, int], Bounds(0, 100)] = (0, 0)


@dataclass(frozen=True)
class WeatherConfig:
    """Fog, rain and wet surfaces.

    Attributes:
        fog_probability: Probability of fog.
        visibility_mm: Distance at which fog leaves 2 % of the contrast (Koschmieder). Fog is
            defined as a visibility below 1 km.
        rain_probability: Probability of rain.
        rain_up_to_lx: Most light of the environment on level ground with which rain falls. Below
            rain clouds it is about 10000. The default is no limit, so rain also falls in sunshine.
        rate_mm_h: Water that falls as rain.
        shutter_s: Exposure time in which a drop draws its streak, for cameras without a meter.
        wind: Speed of the drops across the image, as a multiple of their falling speed.
        wet_probability: Probability that a scene without rain is wet.
        wetness: Wetness of paint during or after rain.
    """

    fog_probability: Share = 0.0
    visibility_mm: Annotated[Range, Bounds(1000, 1e8, "mm")] = Range(2.5e4, 3e5)
    rain_probability: Share = 0.0
    rain_up_to_lx: Annotated[float, Bounds(0.0, 2e5, "lx")] = 2e5
    rate_mm_h: Annotated[Range, Bounds(0.1, 300, "mm/h")] = Range(2, 50)
    shutter_s: Annotated[Range, Bounds(1e-5, 0.1, "s")] = Range(0.0005, 0.004)
    wind: Annotated[Range, Bounds(-3.0, 3.0)] = Range(-0.5, 0.5)
    wet_probability: Share = 0.0
    wetness: Annotated[Range, UNIT] = Range(0.3, 1.0)
