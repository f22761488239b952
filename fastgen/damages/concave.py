"""Concave damage: an area of a face that is pushed inward or outward."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from fastgen.damages.buckled import BUCKLED
from fastgen.damages.creased import CREASED, SIDES
from fastgen.damages.draws import FRAME_MM, Depth, Extent, Size, draw, draw_angle, draw_wear
from fastgen.damages.plain import BOW
from fastgen.scene.damage_kinds import Kind, SheetForm
from fastgen.scene.faces import CORRUGATED_ALONG_Y
from fastgen.validation import UNIT, Bounds, Range, Share

_CREASED_SIDES = Range(0.3, 0.95)
"""Distance of each side of a folded area from its middle, as a share of half its size."""

_BEND, _RUN_OUT = Range(0.02, 0.2), Range(0.3, 0.9)
"""Lengths over which the bend of a buckled area is rounded at its line and fades out, as shares of
its reach."""

_TILT, _SWINGS, _WAVELENGTH_MM = Range(-0.3, 0.3), Range(0.0, 0.12), Range(250.0, 900.0)
"""Its line: offset of the ends and amplitude of the swings in half widths, and their wavelength."""

_CRUSHED, _CRUSHED_MM = Range(0.2, 1.0), Range(50.0, 160.0)
"""Share by which its crests are crushed at the line, and length crushed on each side of it."""


@dataclass(frozen=True)
class ConcaveConfig:
    """Area of a face that is pushed inward or outward.

    Attributes:
        length_mm: Horizontal size; along the container on the roof.
        width_mm: Vertical size; across the container on the roof.
        depth_mm: Depth before bends and folds are rounded, which reduces the displacement.
        outward: Probability that the area bulges outward.
        at_bottom: Probability that a bulge is at the lower wall and ends at the bottom rail.
        buckled: Probability that the ribs buckle along one line.
        creased: Probability that an area that does not buckle breaks into flat parts between sharp
            folds.
        crease_softness: Length over which a fold is rounded, as a share of the depth.
        flattened: Share by which the corrugation between the folds is flattened.
    """

    length_mm: Extent = Range(900, 2600)
    width_mm: Extent = Range(800, 2000)
    depth_mm: Depth = Range(110, 250)
    outward: Share = 0.3
    at_bottom: Share = 0.7
    buckled: Share = 0.7
    creased: Share = 0.85
    crease_softness: Annotated[Range, Bounds(1e-3, 1.0)] = Range(0.02, 0.2)
    flattened: Annotated[Range, UNIT] = Range(0.0, 0.3)


def _draw(c: ConcaveConfig, face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    chance = rng.random()
    buckled = chance < c.buckled
    creased = not buckled and chance < c.buckled + c.creased * (1 - c.buckled)
    length = draw(rng, c.length_mm, size[0] - 2 * FRAME_MM)
    width = draw(rng, c.width_mm, size[1] - 2 * FRAME_MM)
    depth = draw(rng, c.depth_mm)
    outward = rng.random() < c.outward
    low = outward and face != "roof" and bool(rng.random() < c.at_bottom)
    form = SheetForm(
        (length, width), -depth if outward else depth, place="bottom" if low else "anywhere"
    )
    if buckled:
        shape = (
            *(draw(rng, each, digits=4) for each in (_BEND, _RUN_OUT, _TILT, _SWINGS)),
            draw(rng, _WAVELENGTH_MM),
            draw_angle(rng),
            *(draw(rng, each) for each in (_CRUSHED, _CRUSHED_MM)),
        )
        form = replace(form, shape=shape, name="buckled", wear=draw_wear(rng))
        if face == CORRUGATED_ALONG_Y:  # its length is across the ribs
            form = replace(form, size_mm=(width, length), turn_deg=90.0)
        return form
    if creased:
        shape = (
            draw_angle(rng),
            *(draw(rng, _CREASED_SIDES, digits=3) for _ in range(SIDES)),
            draw(rng, c.crease_softness, digits=4),
            draw(rng, c.flattened),
        )
        return replace(form, shape=shape, name="creased", wear=draw_wear(rng))
    return form


def _bulge_mm(c: ConcaveConfig) -> float:
    return c.depth_mm.hi if c.outward > 0 else 0.0


KIND = Kind(
    "concave", (BOW, CREASED, BUCKLED), ConcaveConfig, _draw, bulge_mm=_bulge_mm, rubbed=True
)
