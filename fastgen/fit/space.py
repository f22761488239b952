"""Search space: the keys of `sensor` that a fit changes, as numbers from 0 to 1."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.config.sensor import SensorConfig
from fastgen.scene.optics import CLIP_LIMITS
from fastgen.validation import Range, from_plain

Point = NDArray[np.float64]
"""One value 0..1 for each variable."""

_JPEG_SPREAD = 15
_LEAST_CHANGE = 0.03
"""Variables that move less keep the value of the preset."""

_Values = dict[str, Any]


class Variable(NamedTuple):
    """One number of the search.

    Attributes:
        name: Name for people.
        lo: Value at 0.
        hi: Value at 1.
        of: Returns the value that a configuration has.
    """

    name: str
    lo: float
    hi: float
    of: Callable[[SensorConfig], float]


def _middle(values: Range | tuple[int, int]) -> float:
    return (values[0] + values[1]) / 2


def _half(values: Range) -> float:
    return (values.hi - values.lo) / 2


def _if_used(part: Any, value: float, unused: float) -> float:
    return value if part.probability > 0 else unused


VARIABLES: tuple[Variable, ...] = (
    Variable("exposure", -2.0, 2.0, lambda c: _middle(c.exposure_error_ev)),
    Variable("spread of exposure", 0.0, 1.2, lambda c: _half(c.exposure_error_ev)),
    Variable("red and blue gain", -0.8, 0.8, lambda c: _middle(c.white_balance_ev)),
    Variable("spread of red and blue gain", 0.0, 0.6, lambda c: _half(c.white_balance_ev)),
    Variable("clip", *CLIP_LIMITS, lambda c: _if_used(c.response, _middle(c.response.clip), 1.5)),
    Variable(
        "contrast", 0.8, 1.8, lambda c: _if_used(c.response, _middle(c.response.contrast), 1.0)
    ),
    Variable(
        "saturation", 0.3, 1.9, lambda c: _if_used(c.response, _middle(c.response.saturation), 1.0)
    ),
    # log10 of the mean well on a logarithmic scale; noise falls with it
    Variable(
        "full well",
        2.0,
        5.3,
        lambda c: _if_used(c.noise, _middle(Range(*np.log10(c.noise.full_well_e))), 5.3),
    ),
    Variable(
        "chroma noise", 0.0, 0.04, lambda c: _if_used(c.chroma_noise, c.chroma_noise.strength.hi, 0)
    ),
    Variable("sharpening", 0.0, 3.0, lambda c: _if_used(c.sharpening, c.sharpening.amount.hi, 0)),
    Variable("defocus", 0.0, 0.8, lambda c: c.defocus.probability),
    Variable("vignetting", 0.0, 0.9, lambda c: c.vignetting.hi),
    Variable(
        "JPEG quality", 15, 100, lambda c: _middle(c.jpeg_quality) if any(c.jpeg_quality) else 100
    ),
)


def point_of(sensor: SensorConfig) -> Point:
    """Return the point that is nearest to a sensor configuration."""
    values = [(each.of(sensor) - each.lo) / (each.hi - each.lo) for each in VARIABLES]
    return np.clip(values, 0, 1)


def sensor_at(point: Point, preset: SensorConfig) -> SensorConfig:
    """Return the sensor configuration at a point; everything else is that of the preset."""
    made: SensorConfig = from_plain(SensorConfig, changes_at(point, preset), base=preset)
    return made


def changes_at(point: Point, preset: SensorConfig) -> _Values:
    """Return the values of `sensor` that differ at a point from the preset, nested as in a file.

    A range keeps the width that it has in the preset, unless its width is a variable.

    Args:
        point: [len(VARIABLES)].
        preset: Sensor of the preset.
    """
    moved = np.abs(point - point_of(preset)) >= _LEAST_CHANGE
    value = {
        each.name: each.lo + float(x) * (each.hi - each.lo)
        for each, x in zip(VARIABLES, point, strict=True)
    }
    changed = {each.name for each, far in zip(VARIABLES, moved, strict=True) if far}
    for each in VARIABLES:  # also a value at the end of the variable, as without the change
        if each.name not in changed:
            value[each.name] = float(each.of(preset))
    found: _Values = {}
    if changed & {"exposure", "spread of exposure"}:
        found["exposure_error_ev"] = _around(value["exposure"], value["spread of exposure"])
    if changed & {"red and blue gain", "spread of red and blue gain"}:
        found["white_balance_ev"] = _around(
            value["red and blue gain"], value["spread of red and blue gain"]
        )
    found |= _response(value, changed, preset)
    if "full well" in changed:
        lo, hi = np.log10(preset.noise.full_well_e)
        ends = np.clip(10 ** (value["full well"] + np.array([-1, 1]) * (hi - lo) / 2), 50, 1e6)
        found["noise"] = _on(preset.noise) | {"full_well_e": [float(f"{end:.3g}") for end in ends]}
    if "chroma noise" in changed:
        found["chroma_noise"] = _up_to("strength", value["chroma noise"], preset.chroma_noise)
    if "sharpening" in changed:
        found["sharpening"] = _up_to("amount", value["sharpening"], preset.sharpening)
    if "defocus" in changed:
        found["defocus"] = {"probability": round(value["defocus"], 2)}
    if "vignetting" in changed:
        hi = round(value["vignetting"], 2)
        found["vignetting"] = [min(preset.vignetting.lo, hi), hi]
    if "JPEG quality" in changed:
        quality = value["JPEG quality"]
        found["jpeg_quality"] = [
            max(round(quality - _JPEG_SPREAD), 1),
            min(round(quality + _JPEG_SPREAD), 100),
        ]
    return found


def _response(value: dict[str, float], changed: set[str], preset: SensorConfig) -> _Values:
    names = ("clip", "contrast", "saturation")
    if not changed & set(names):
        return {}
    limits = {"clip": CLIP_LIMITS, "contrast": (0.8, 2.0), "saturation": (0.0, 3.0)}
    used = preset.response.probability > 0
    found: _Values = _on(preset.response)
    for name in names:
        if name in changed or not used:
            half = _half(getattr(preset.response, name)) if used else 0.0
            lo, hi = limits[name]
            ends = np.clip([value[name] - half, value[name] + half], lo, hi)
            found[name] = [round(float(end), 2) for end in ends]
    return {"response": found}


def _on(part: Any) -> _Values:
    """Return the probability of an effect that is to be used, if the preset does not use it."""
    return {} if part.probability > 0 else {"probability": 1.0}


def _up_to(name: str, largest: float, part: Any) -> _Values:
    """Return a range whose ends have the ratio that they have in the preset."""
    old: Range = getattr(part, name)
    ratio = old.lo / old.hi if old.hi else 0.0
    return _on(part) | {name: [round(largest * ratio, 4), round(largest, 4)]}


def _around(middle: float, half: float) -> list[float]:
    return [round(middle - half, 2), round(middle + half, 2)]
