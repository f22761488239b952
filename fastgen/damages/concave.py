"""Concave damage: an area of a face that is bowed inward or outward."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from fastgen.damages.creased import CREASED, SIDES
from fastgen.damages.draws import FRAME_MM, Depth, Extent, Size, draw, draw_angle, draw_wear
from fastgen.damages.plain import BOW
from fastgen.scene.damage_kinds import Kind, SheetForm
from fastgen.validation import UNIT, Bounds, Range, Share

_CREASED_SIDES = Range(0.3, 0.95)
"""Distance of each side of a folded area from its middle, as a share of half its size."""


@dataclass(frozen=True)
class ConcaveConfig:
    """Area of a face that is bowed inward or outward.

    Attributes:
        length_mm: Horizontal size; along the container on the roof.
        width_mm: Vertical size; across the container on the roof.
        depth_mm: Largest displacement.
        outward: Probability that the area bulges outward.
        at_bottom: Probability that a bulge is at the lower wall and ends at the bottom rail.
        creased: Probability that the sheet breaks into flat parts between sharp folds.
        crease_softness: Length over which a fold is rounded, as a share of the depth.
        flattened: Share by which the corrugation between the folds is flattened.
    """

    length_mm: Extent = Range(900, 2600)
    width_mm: Extent = Range(800, 2000)
    depth_mm: Depth = Range(110, 250)
    outward: Share = 0.3
    at_bottom: Share = 0.7
    creased: Share = 0.85
    crease_softness: Annotated[Range, Bounds(1e-3, 1.0)] = Range(0.02, 0.2)
    flattened: Annotated[Range, UNIT] = Range(0.0, 0.3)


def _draw(c: ConcaveConfig, face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    creased = rng.random() < c.creased
    length = draw(rng, c.length_mm, size[0] - 2 * FRAME_MM)
    width = draw(rng, c.width_mm, size[1] - 2 * FRAME_MM)
    depth = draw(rng, c.depth_mm)
    outward = rng.random() < c.outward
    low = outward and face != "roof" and bool(rng.random() < c.at_bottom)
    form = SheetForm(
        (length, width), -depth if outward else depth, place="bottom" if low else "anywhere"
    )
    if not creased:
        return form
    shape = (
        draw_angle(rng),
        *(draw(rng, _CREASED_SIDES, digits=3) for _ in range(SIDES)),
        draw(rng, c.crease_softness, digits=4),
        draw(rng, c.flattened),
    )
    return replace(form, shape=shape, name="creased", wear=draw_wear(rng))


def _bulge_mm(c: ConcaveConfig) -> float:
    return c.depth_mm.hi if c.outward > 0 else 0.0


KIND = Kind("concave", (BOW, CREASED), ConcaveConfig, _draw, bulge_mm=_bulge_mm, rubbed=True)
