"""Damage as displacement fields: a handful of parameters each, no mesh surgery.

A damage moves a rest point p (mm, container frame) by amount(p) along its `inward` direction. The
shader evaluates the same fields (shaders/damage.glsl); this module is its slow, obvious twin and
the one that labels, tests and the exporter use. Local coordinates of p: u along the damage, v
across it, w inward from its origin. Section 3.3.2 of the SeaFront paper describes the four kinds.
"""

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.scene import Damage, Vec3
from fastgen.scene.limits import LOBE_LIMIT, LOBES

Array = NDArray[np.floating]

FADE_START_MM, FADE_END_MM = 260.0, 520.0
"""A field acts on what lies within this depth behind its face: not on the opposite wall."""

SLACK_MM = 150.0
"""Corrugation and castings let a face be seen from this little behind its plane."""

HOLE_REACH = 1 + LOBES * LOBE_LIMIT
"""No outline strays farther than this many mean radii."""


def local_coordinates(damage: Damage, points_mm: Array) -> tuple[Array, Array, Array]:
    """(u, v, w) of points [..., 3], each [...] in mm."""
    q = np.asarray(points_mm, np.float64) - np.array(damage.origin_mm)
    return q @ np.array(damage.along), q @ np.array(damage.across), q @ np.array(damage.inward)


def amount_mm(damage: Damage, points_mm: Array) -> NDArray[np.float64]:
    """How far the damage moves rest points [..., 3] along its inward direction, mm [...].

    Negative for a concave damage that bulges outward.
    """
    u, v, w = local_coordinates(damage, points_mm)
    half_length, half_width = damage.size_mm[0] / 2, damage.size_mm[1] / 2
    if damage.kind == "axis":
        return damage.depth_mm * _bump(u / half_length) * _bump(np.hypot(v, w) / half_width)
    fade = 1 - _smoothstep(FADE_START_MM, FADE_END_MM, np.abs(w))
    if damage.kind == "concave":
        return damage.depth_mm * _bump(u / half_length) * _bump(v / half_width) * fade
    if damage.kind == "dented":
        crease_mm, sink_share, *_ = damage.shape
        away = np.abs(v - fold_path_mm(damage, u))
        crease = np.maximum(1 - away / crease_mm, 0.0) ** 1.5
        sink = _bump(away / half_width)
        taper = np.maximum(1 - (u / half_length) ** 2, 0.0)
        return damage.depth_mm * taper * fade * ((1 - sink_share) * crease + sink_share * sink)
    outside = np.hypot(u, v) - hole_radius_mm(damage, np.arctan2(v, u))
    rim_mm = damage.shape[0]
    return damage.depth_mm * np.clip(1 - outside / rim_mm, 0.0, 1.0) ** 2 * fade


def fold_path_mm(damage: Damage, u: Array) -> Array:
    """Where a dent's fold runs: v [...] in mm at u [...], by turns straight and sinusoidal."""
    _, _, amplitude_mm, wavelength_mm, phase, stretch_mm = damage.shape[:6]
    # a stretch is straight where this is 0 and sinusoidal where it is 1
    turn = _smoothstep(-0.25, 0.25, np.sin(np.pi * u / stretch_mm + phase))
    return amplitude_mm * turn * np.sin(2 * np.pi * u / wavelength_mm)


def hole_radius_mm(damage: Damage, angle: Array) -> Array:
    """Radius [...] in mm of a perforation's outline toward `angle` [...] in radians."""
    ratio = np.ones_like(np.asarray(angle, np.float64))
    for k in range(LOBES):
        size, phase = damage.shape[1 + 2 * k], damage.shape[2 + 2 * k]
        ratio = ratio + size * np.cos((2 + k) * angle + phase)
    return damage.size_mm[0] / 2 * ratio


def in_hole(damage: Damage, points_mm: Array) -> NDArray[np.bool_]:
    """Which rest points [..., 3] a perforation has torn away, bool [...], but for door gear."""
    if damage.kind != "perforation":
        return np.zeros(np.shape(points_mm)[:-1], bool)
    u, v, w = local_coordinates(damage, points_mm)
    through = np.abs(w) < FADE_START_MM
    return (np.hypot(u, v) < hole_radius_mm(damage, np.arctan2(v, u))) & through


def deform(damages: tuple[Damage, ...], points_mm: Array) -> NDArray[np.float64]:
    """Rest points [..., 3] to where all damages together move them, mm [..., 3]."""
    rest = np.asarray(points_mm, np.float64).reshape(-1, 3)
    moved = rest.copy()
    for damage in damages:
        away = sum((x - at) ** 2 for x, at in zip(rest.T, damage.origin_mm, strict=True))
        # what lies farther away than all it reaches does not move
        near = np.flatnonzero(away < np.square(reach_mm(damage)).sum())
        if len(near):
            amount = amount_mm(damage, rest.take(near, axis=0))
            for axis, inward in enumerate(damage.inward):
                moved[near, axis] += amount * inward
    return moved.reshape(np.shape(points_mm))


def reach_mm(damage: Damage) -> tuple[float, float, float]:
    """How far from its origin a damage may move or tear what is at rest: along, across, inward."""
    u, v = damage.size_mm[0] / 2, damage.size_mm[1] / 2
    if damage.kind == "perforation":
        u = v = u * HOLE_REACH + damage.shape[0]
    if damage.kind == "dented":
        v = max(v, damage.shape[0]) + damage.shape[2]  # its path swings
    return u, v, v if damage.kind == "axis" else FADE_END_MM


def corners_mm(damage: Damage) -> NDArray[np.float64]:
    """Corners [8, 3] in mm of a box that holds all that a damage touches, before and after."""
    u, v, inward = reach_mm(damage)
    depth = abs(damage.depth_mm) + 60.0
    low, high = -depth, inward + max(damage.depth_mm, 0.0)
    if damage.kind == "axis":
        low, high = -v, v + depth
    axes = np.array([damage.along, damage.across, damage.inward])
    inside = np.array([-u, -v, low]) + UNIT_CUBE * np.array([2 * u, 2 * v, high - low])
    return np.array(damage.origin_mm) + inside @ axes


def variant(damages: tuple[Damage, ...]) -> str:
    """Which of programs.DAMAGE_VARIANTS draws these damages."""
    if not damages:
        return "sound"
    return "holed" if any(damage.kind == "perforation" for damage in damages) else "damaged"


def may_be_seen(damage: Damage, position_mm: Vec3, beside: tuple[Damage, ...] = ()) -> bool:
    """Whether a camera outside at `position_mm` may see what the damage did from outside.

    A sheet pushed in is hidden from behind its plane; an edge from behind both of its faces. What
    bulges of the damages `beside` it may push out with it.
    """
    if damage.depth_mm < 0:
        return True
    toward = np.array(position_mm) - np.array(damage.origin_mm)
    # an edge's inward axis lies between two coordinate axes, a sheet's on one
    outward = [-np.sign(c) * toward[i] for i, c in enumerate(damage.inward) if abs(c) > 0.1]
    pushed_mm = sum(max(-other.depth_mm, 0.0) for other in beside)
    return max(outward) > -SLACK_MM - pushed_mm


def seen_damages(damages: tuple[Damage, ...], position_mm: Vec3) -> tuple[Damage, ...]:
    """The damages that a frame from `position_mm` must draw; all of them where a hole shows the
    inside, which every damage may have moved."""
    seen = tuple(damage for damage in damages if may_be_seen(damage, position_mm, damages))
    return damages if variant(seen) == "holed" else seen


def _bump(t: Array) -> Array:
    """Smooth hill: 1 at 0, flat there, 0 from 1 on with zero slope."""
    return np.maximum(1 - t * t, 0.0) ** 2


def _smoothstep(low: float, high: float, x: Array) -> Array:
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)
