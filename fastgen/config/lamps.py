"""Floodlights of scenes that their HDRI leaves dark."""

from dataclasses import dataclass
from typing import Annotated

from fastgen.config.fields import HexColors
from fastgen.scene.limits import MAX_LAMPS
from fastgen.scene.optics import LAMP_LIMITS_LX
from fastgen.validation import Bounds, Range, Share


@dataclass(frozen=True)
class LampsConfig:
    """Floodlights of a gate or a crane, in scenes that the environment leaves dark.

    Attributes:
        probability: Probability of lamps in a dark scene.
        below_lx: Illuminance of the environment below which a scene is dark.
        count: Fewest and most lamps.
        illuminance_lx: Light of each lamp on a surface that faces it.
        elevation_deg: Elevation of each lamp above the horizon, seen from the container.
        azimuth_deg: Direction of each lamp, counter-clockwise from the door end.
        colors: Colors of the light; all are equally likely.
    """

    probability: Share = 0.0
    below_lx: Annotated[float, Bounds(0.0, 2e5, "lx")] = 250.0
    count: Annotated[tuple[int, int], Bounds(1, MAX_LAMPS)] = (1, 2)
    illuminance_lx: Annotated[Range, Bounds(*LAMP_LIMITS_LX, "lx")] = Range(30, 200)
    elevation_deg: Annotated[Range, Bounds(1.0, 90.0, "degrees")] = Range(20, 70)
    azimuth_deg: Annotated[Range, Bounds(-360.0, 360.0, "degrees")] = Range(0, 360)
    colors: HexColors = ("#fff4e8", "#eef3ff", "#ffca8a")
