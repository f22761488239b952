"""Automatic exposure of cameras in photographic units: shutter time, gain and their limits."""

from dataclasses import dataclass

import numpy as np

from fastgen.scene.optics import Meter

MIDDLE_GREY = 0.18
"""Reflectance that a meter exposes as a mid-tone (ISO 2720:1974 calibrates near 0.18)."""

_CALIBRATION = 12.5
"""Constant K of reflected-light meters in cd s/m2 (ISO 2720:1974): L = K N^2 / (t S)."""

_BASE_ISO = 100.0
"""Sensitivity without gain, at which a pixel's full well is white."""

_DIM_LX, _BRIGHT_LX = 10.0, 1000.0
"""Illuminance of middle grey between which the target rises from `Meter.dim_target` to
MIDDLE_GREY."""


@dataclass(frozen=True)
class Exposure:
    """Exposure of one image.

    Attributes:
        factor: Factor on radiance; a white surface in metered light becomes about 1.
        shutter_s: Time that the shutter is open; 0 for a camera without a meter.
        gain: Amplification above base sensitivity. A white pixel holds the full well divided by it.
    """

    factor: float
    shutter_s: float = 0.0
    gain: float = 1.0

    def lowered(self, times: float) -> "Exposure":
        """Return the exposure at `times` the light: with less gain, then a shorter shutter.

        Args:
            times: Above 0 to 1.
        """
        gain = max(self.gain * times, 1.0)
        shutter_s = self.shutter_s * times * self.gain / gain
        return Exposure(self.factor * times, shutter_s, gain)


def limited_exposure(radiance: float, cd_m2: float, meter: Meter, exposure_ev: float) -> Exposure:
    """Return the exposure that a meter chooses within the limits of its camera.

    The shutter opens up to its longest time at base sensitivity; only then the gain rises.

    Args:
        radiance: Metered mean, in units of the environment map; above 0.
        cd_m2: Luminance of a unit of radiance.
        meter: Limits and target.
        exposure_ev: Deviation from the metered exposure, in stops.
    """
    luminance = radiance * cd_m2
    target = _target(luminance, meter.dim_target) * 2.0**exposure_ev
    # product of time and sensitivity at which the metered mean becomes MIDDLE_GREY
    grey = _CALIBRATION * meter.f_number**2 / luminance
    wanted = target / MIDDLE_GREY * grey
    shutter_s = min(wanted / _BASE_ISO, meter.longest_s)
    gain = max(min(wanted / meter.longest_s, meter.largest_iso) / _BASE_ISO, 1.0)
    factor = MIDDLE_GREY / radiance * (shutter_s * gain * _BASE_ISO / grey)
    return Exposure(factor, shutter_s, gain)


def _target(luminance: float, dim_target: float) -> float:
    """Return the linear value that a mean luminance in cd/m2 is exposed to.

    It is a power of the luminance between the dim and the bright limit, and constant outside.
    """
    lx = luminance * np.pi / MIDDLE_GREY  # illuminance at which middle grey has this luminance
    share = np.log(lx / _DIM_LX) / np.log(_BRIGHT_LX / _DIM_LX)
    share = min(max(float(share), 0.0), 1.0)
    return float(dim_target ** (1 - share) * MIDDLE_GREY**share)
