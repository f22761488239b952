"""Check that the lenses of a configuration can be drawn at an image size."""

from dataclasses import replace

from fastgen.camera.projection import view_of
from fastgen.config.cameras import LONGEST_FOCAL_MM, CameraConfig
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.sampling.coverage import extreme_lenses
from fastgen.scene import Camera

_STEP = 1.05
"""Factor between the focal lengths that are tried."""

_STEPS_PER_MM = 10
"""The focal length of a message is exact to this part of a millimetre."""


def check_lenses(config: Config, size: tuple[int, int]) -> None:
    """Check that every lens which may be drawn for a camera works at this size.

    Args:
        config: Distribution of scenes.
        size: (width, height) of the images in pixels.

    Raises:
        ConfigError: naming the shortest focal length that works, if there is one.
    """
    for name, rig in config.cameras.items():
        problem = _problem(name, rig, size)
        if problem is None:
            continue
        least_mm = _least_focal_mm(name, rig, size)
        if least_mm is None:
            raise problem
        width, height = size
        raise ConfigError(
            f"cameras.{name}.focal_mm: {rig.focal_mm:g} mm is too short for this lens at "
            f"{width}x{height}; use at least {least_mm:g} mm, or check the distortion coefficients"
        )


def _problem(name: str, rig: CameraConfig, size: tuple[int, int]) -> ConfigError | None:
    """Return why one of the lenses of a camera cannot be drawn, or None if all can."""
    for lens in extreme_lenses(rig.lens) if rig.lens else ():
        camera = Camera(
            name,
            (0, 0, 0),
            (0, 1, 0),
            rig.focal_mm,
            sensor_width_mm=rig.sensor_width_mm,
            lens=lens,
            pixel_aspect=rig.pixel_aspect,
            principal_point=rig.principal_point,
        )
        try:
            view_of(camera, size)
        except ConfigError as error:
            return error
    return None


def _least_focal_mm(name: str, rig: CameraConfig, size: tuple[int, int]) -> float | None:
    """Return the shortest longer focal length with which all lenses work, or None."""

    def works(focal_mm: float) -> bool:
        return _problem(name, replace(rig, focal_mm=focal_mm), size) is None

    low = high = rig.focal_mm
    while not works(high):
        low, high = high, high * _STEP
        if high > LONGEST_FOCAL_MM:
            return None
    short, long = int(low * _STEPS_PER_MM), int(high * _STEPS_PER_MM) + 1
    while long - short > 1:
        middle = (short + long) // 2
        short, long = (short, middle) if works(middle / _STEPS_PER_MM) else (middle, long)
    return long / _STEPS_PER_MM
