"""Axis damage: edges and corner posts that are pushed in."""

import math
from dataclasses import asdict, dataclass, replace

import numpy as np

from fastgen.damages.draws import (
    FRAME_MM,
    MOST_REACH_MM,
    Depth,
    Extent,
    Reach,
    draw,
    draw_wear,
    rounded_vector,
)
from fastgen.damages.kinked import KINKED
from fastgen.damages.plain import EDGE
from fastgen.scene import Damage, Vec3
from fastgen.scene.container_kinds import CASTING_MM
from fastgen.scene.damage_kinds import Kind
from fastgen.validation import Range, Share

_KINK_APEX = Range(-0.5, 0.5)
"""Place of a kink's deepest point, in half lengths from its middle."""

_KINK_SOFTNESS = Range(0.03, 0.15)
"""Rounding of a kink's folds, as a share of its depth."""

_KINKS_ABOVE = 0.25
"""Share of the kinks in posts that are just below the upper casting; others are above the lower."""

_TILT_APEX_MM = (20.0, 90.0)
"""Distance from a tilted casting to the deepest point of its kink."""

_LEAN_APEX = Range(0.2, 0.8)
"""Place of the deepest point of a leaning post, in half heights from its middle."""

_TILT_REACH_MM = 200.0
"""Additional reach of a kink that tilts castings, so that a casting moves as a whole instead of
being crushed at its edge."""


@dataclass(frozen=True)
class AxisConfig:
    """Edge or corner post that is pushed in.

    Attributes:
        length_mm: Length along the edge.
        reach_mm: Distance from the edge up to which the faces beside it are bent.
        depth_mm: Largest displacement.
        kinked: Probability that the edge has a local kink instead: a notch of a rail or a bent
            post.
        kink_length_mm: Length of a kink along the edge.
        kink_reach_mm: Distance from the edge up to which a kink bends the faces beside it.
        kink_depth_mm: Largest displacement of a kink.
        kinked_posts: Probability that a kink is in a corner post, just above its lower casting or
            below its upper one. Other kinks may be in any edge.
        leaning_posts: Probability that a kink in a post is as long as the post, which then leans
            from one casting to the deepest point, and both castings tilt.
        tilted_castings: Probability that another kink in a post includes its casting and tilts it.
            The kink is then 118 mm longer. Kinks that tilt castings reach 200 mm farther.
    """

    length_mm: Extent = Range(700, 1900)
    reach_mm: Reach = Range(320, 650)
    depth_mm: Depth = Range(110, 260)
    kinked: Share = 0.85
    kink_length_mm: Extent = Range(200, 500)
    kink_reach_mm: Reach = Range(120, 260)
    kink_depth_mm: Depth = Range(40, 130)
    kinked_posts: Share = 0.5
    leaning_posts: Share = 0.1
    tilted_castings: Share = 0.3


def _place(c: AxisConfig, size_mm: Vec3, rng: np.random.Generator) -> Damage:
    """Sample a dent of one of the twelve edges, pushed in diagonally.

    It is clear of the castings, except for kinks that tilt them.
    """
    half = np.array(size_mm) / 2
    kinked = bool(rng.random() < c.kinked)
    post = kinked and bool(rng.random() < c.kinked_posts)
    leaning = post and bool(rng.random() < c.leaning_posts)
    tilted = post and not leaning and bool(rng.random() < c.tilted_castings)
    axis = 2 if post else int(rng.integers(3))
    others = [i for i in range(3) if i != axis]
    signs = rng.choice([-1.0, 1.0], size=2)
    inward, middle = np.zeros(3), np.array([0.0, 0.0, half[2]])
    for i, sign in zip(others, signs, strict=True):
        inward[i] = -sign / math.sqrt(2)
        middle[i] += sign * half[i]
    along = np.eye(3)[axis]
    room = 2 * half[axis] - 2 * FRAME_MM
    length = draw(rng, c.kink_length_mm if kinked else c.length_mm, room)
    if leaning or tilted:
        room = float(2 * half[axis])
        length = room if leaning else round(length + CASTING_MM[2], 2)
    slack = (room - length) / 2
    at = float(rng.uniform(-slack, slack))
    if post:
        at = slack * (1.0 if rng.random() < _KINKS_ABOVE else -1.0)
    reach = draw(rng, c.kink_reach_mm if kinked else c.reach_mm)
    if leaning or tilted:
        reach = min(reach + _TILT_REACH_MM, MOST_REACH_MM)
    damage = Damage(
        kind="axis",
        face=_edge_name(others, signs),
        origin_mm=rounded_vector(middle + along * at, 1),
        along=rounded_vector(along),
        across=rounded_vector(np.cross(inward, along)),
        inward=rounded_vector(inward),
        size_mm=(length, round(2 * reach, 2)),
        depth_mm=draw(rng, c.kink_depth_mm if kinked else c.depth_mm),
    )
    if not kinked:
        return damage
    apex = draw(rng, _KINK_APEX, digits=3)
    if leaning:
        apex = draw(rng, _LEAN_APEX, digits=3) * float(rng.choice((-1.0, 1.0)))
    if tilted:
        deepest_mm = CASTING_MM[2] + float(rng.uniform(*_TILT_APEX_MM))
        apex = round(math.copysign(1.0, at) * max(1 - 2 * deepest_mm / length, -0.9), 3)
    shape = (apex, draw(rng, _KINK_SOFTNESS, digits=4))
    return replace(damage, form="kinked", shape=shape, **asdict(draw_wear(rng)))


def _edge_name(others: list[int], signs: np.ndarray) -> str:
    """Return the two faces that meet at an edge, for example 'front.door'."""
    names = (("no_door", "door"), ("front", "back"), ("underside", "roof"))
    return ".".join(names[i][int(sign > 0)] for i, sign in zip(others, signs, strict=True))


KIND = Kind("axis", (EDGE, KINKED), AxisConfig, place=_place)
