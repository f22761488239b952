"""Perforations: torn holes."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from fastgen.damages.draws import FRAME_MM, Depth, Extent, Size, draw, draw_angle, draw_wear
from fastgen.damages.plain import LOBE_LIMIT, LOBES, STAR
from fastgen.damages.torn import TORN
from fastgen.scene.damage_kinds import Kind, SheetForm
from fastgen.validation import Bounds, Range, Share

_TEAR_BELLY, _TEAR_WEDGE = (0.5, 0.5), (0.4, 0.4)
"""Beta distributions of a tear's belly (share below its line) and wedge; extremes are likely."""

_TEAR_LEAST_MM = 12.0
"""Smallest width of a tear that is not a split."""

_TEARS_WITH_ARM, _TEAR_ARM = 0.2, Range(0.4, 0.9)
"""Share of tears, except splits, with a second slit; its length as a share of the first."""

_TEAR_TURNS_DEG, _TEAR_SPREAD_DEG, _SPLIT_SPREAD_DEG = (0.0, 90.0), 12.0, 2.0
"""Tears run along a rail or follow a rib, with these standard deviations."""


@dataclass(frozen=True)
class PerforationConfig:
    """Torn hole.

    Attributes:
        diameter_mm: Mean diameter.
        rim_mm: Width of the rim that is bent inward.
        depth_mm: Displacement of the rim at the edge of the hole.
        lobes: Amplitude of each of the five harmonics of the outline, as a share of the radius.
        torn: Probability that the hole is a slit, flap, triangle or L instead of a star.
        tear_length_mm: Length of such a tear.
        tear_aspect: Length divided by width.
        split: Probability that a tear is a long split along a rib or across the ribs.
        split_length_mm: Length of such a split.
        split_gape_mm: Width of such a split.
        teeth_mm: Height of the teeth of its edges.
        twist: Amount by which its lower lip bends less than the upper; above 1 it bends outward.
        at_castings: Probability that a hole in the roof is near a casting. Its rim then ends within
            350 mm of the frame in both directions.
    """

    diameter_mm: Annotated[Range, Bounds(5, 2000, "mm")] = Range(90, 320)
    rim_mm: Annotated[Range, Bounds(5, 1000, "mm")] = Range(50, 150)
    depth_mm: Depth = Range(35, 100)
    lobes: Annotated[Range, Bounds(0.0, LOBE_LIMIT)] = Range(0.05, 0.16)
    torn: Share = 0.85
    tear_length_mm: Extent = Range(90, 700)
    tear_aspect: Annotated[Range, Bounds(1.0, 100.0)] = Range(2.0, 7.0)
    split: Share = 0.15
    split_length_mm: Extent = Range(500, 2500)
    split_gape_mm: Extent = Range(15, 90)
    teeth_mm: Depth = Range(1, 9)
    twist: Annotated[Range, Bounds(0.0, 2.0)] = Range(0.0, 1.6)
    at_castings: Share = 0.7


def _draw(c: PerforationConfig, face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    place = "casting" if face == "roof" and rng.random() < c.at_castings else "anywhere"
    if rng.random() < c.torn:
        return replace(_tear(c, size, rng), place=place)
    diameter = draw(rng, c.diameter_mm)
    shape = [draw(rng, c.rim_mm)]
    for _ in range(LOBES):
        shape.append(round(draw(rng, c.lobes) * float(rng.choice([-1, 1])), 4))
        shape.append(draw_angle(rng))
    half = diameter / 2 * (1 + LOBES * c.lobes.hi) + shape[0]
    depth = draw(rng, c.depth_mm)
    return SheetForm((diameter, diameter), depth, tuple(shape), half_mm=(half, half), place=place)


def _tear(c: PerforationConfig, size: Size, rng: np.random.Generator) -> SheetForm:
    split = bool(rng.random() < c.split)
    if split:
        length = draw(rng, c.split_length_mm, min(size) - 2 * FRAME_MM)
        width = draw(rng, c.split_gape_mm, length)
    else:
        length = draw(rng, c.tear_length_mm, min(size) / 2)
        width = round(max(length / draw(rng, c.tear_aspect), _TEAR_LEAST_MM), 2)
    has_arm = not split and rng.random() < _TEARS_WITH_ARM
    arm = round(length * _TEAR_ARM.draw(rng), 2) if has_arm else 0.0
    shape = (
        draw(rng, c.rim_mm),
        round(float(rng.beta(*_TEAR_BELLY)), 3),
        round(float(rng.beta(*_TEAR_WEDGE)), 3),
        draw(rng, c.teeth_mm),
        draw_angle(rng),
        arm,
        draw(rng, c.twist),
    )
    spread = _SPLIT_SPREAD_DEG if split else _TEAR_SPREAD_DEG
    turn = round(float(rng.choice(_TEAR_TURNS_DEG) + rng.normal(0, spread)), 2)
    half = (length / 2 + width / 2 + shape[0], max(width + shape[3], arm) + shape[0])
    depth = draw(rng, c.depth_mm)
    return SheetForm((length, width), depth, shape, turn, half, "torn", draw_wear(rng))


def _bulge_mm(c: PerforationConfig) -> float:
    return c.depth_mm.hi * (c.twist.hi - 1) if c.torn > 0 else 0.0


KIND = Kind("perforation", (STAR, TORN), PerforationConfig, _draw, bulge_mm=_bulge_mm, leaks=True)
