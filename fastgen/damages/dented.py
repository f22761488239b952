"""Dents: narrow folds along a path, and rows of crush marks on the ribs."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from fastgen.damages.draws import (
    FRAME_MM,
    Depth,
    Extent,
    Reach,
    Size,
    draw,
    draw_angle,
    draw_wear,
)
from fastgen.damages.plain import FOLD
from fastgen.damages.ribs import RIBS
from fastgen.scene.damage_kinds import Kind, SheetForm
from fastgen.validation import UNIT, Bounds, Range, Share

_RIBS_SOFTNESS_MM = Range(1.0, 14.0)
"""Length over which the edge of a rib mark is rounded: small where a hard edge cut in, large where
a rounded object bent the sheet."""

_RIBS_RAMP_MM, _RIBS_RAMP = 60.0, 1 / 3
"""Length over which a row of rib marks runs out, and its largest share of the row."""

_RIBS_WAVELENGTH_MM = Range(300.0, 1200.0)
"""Wavelength of the unevenness of rib marks."""

_RIBS_GIVE = Range(0.8, 0.95)
"""Displacement of a rib as a share of how far the object reached in; the rest sprang back."""


@dataclass(frozen=True)
class RibMarksConfig:
    """Crush marks on the outer ribs, in a row at one height.

    Attributes:
        probability: Probability that a dent is such a row.
        length_mm: Length of the row.
        height_mm: Height of its marks.
        depth_mm: Distance by which the object that was pressed against the wall reaches in.
        unevenness: Variation of the depth along the row.
        turn_deg: Angle between the row and the horizontal.
    """

    probability: Share = 0.7
    length_mm: Extent = Range(120, 2200)
    height_mm: Reach = Range(90, 380)
    depth_mm: Depth = Range(20, 65)
    unevenness: Annotated[Range, UNIT] = Range(0.0, 0.7)
    turn_deg: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(-6, 6)


@dataclass(frozen=True)
class DentedConfig:
    """Narrow fold along a path.

    Attributes:
        length_mm: Length of the path.
        width_mm: Width of the area that sinks along the path.
        depth_mm: Largest depth of the crease.
        crease_mm: Half width of the crease.
        sink_share: Depth of the sunken area as a share of depth_mm.
        amplitude_mm: Amplitude of the swings of the path.
        wavelength_mm: Wavelength of the swings.
        stretch_mm: Length of the stretches in which the path alternately swings and runs straight.
        turn_deg: Angle between the path and the horizontal.
        marks: Rows of crush marks on the ribs, which take the place of most folds.
    """

    length_mm: Extent = Range(600, 1700)
    width_mm: Reach = Range(180, 420)
    depth_mm: Depth = Range(40, 90)
    crease_mm: Annotated[Range, Bounds(5, 1000, "mm")] = Range(35, 70)
    sink_share: Annotated[Range, UNIT] = Range(0.25, 0.5)
    amplitude_mm: Depth = Range(25, 110)
    wavelength_mm: Annotated[Range, Bounds(20, 1e5, "mm")] = Range(280, 800)
    stretch_mm: Annotated[Range, Bounds(20, 1e5, "mm")] = Range(250, 600)
    turn_deg: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(-50, 50)
    marks: RibMarksConfig = field(default_factory=RibMarksConfig)


def _draw(c: DentedConfig, _face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    if rng.random() < c.marks.probability:
        return _rib_marks(c.marks, size, rng)
    length = draw(rng, c.length_mm, min(size) - 2 * FRAME_MM)
    shape = (
        draw(rng, c.crease_mm),
        draw(rng, c.sink_share),
        draw(rng, c.amplitude_mm),
        draw(rng, c.wavelength_mm),
        draw_angle(rng),
        draw(rng, c.stretch_mm),
    )
    # the fold swings by its amplitude to both sides of its axis, which widens the damage
    width = round(draw(rng, c.width_mm) + 2 * shape[2], 2)
    depth, turn = draw(rng, c.depth_mm), draw(rng, c.turn_deg)
    return SheetForm((length, width), depth, shape, turn, wear=draw_wear(rng))


def _rib_marks(c: RibMarksConfig, size: Size, rng: np.random.Generator) -> SheetForm:
    length = draw(rng, c.length_mm, size[0] - 2 * FRAME_MM)
    height = draw(rng, c.height_mm)
    shape = (
        draw(rng, _RIBS_SOFTNESS_MM),
        round(min(_RIBS_RAMP_MM, _RIBS_RAMP * length), 2),
        draw(rng, c.unevenness),
        draw(rng, _RIBS_WAVELENGTH_MM, digits=1),
        draw_angle(rng),
        draw(rng, _RIBS_GIVE, digits=3),
    )
    depth, turn = draw(rng, c.depth_mm), draw(rng, c.turn_deg)
    return SheetForm((length, height), depth, shape, turn, name="ribs", wear=draw_wear(rng))


KIND = Kind("dented", (FOLD, RIBS), DentedConfig, _draw, leaks=True, rubbed=True)
