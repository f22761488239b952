"""Damages as displacement fields with a few parameters each; meshes keep their triangles.

A damage moves a point p at rest (mm, container frame) by amount(p) along its `inward` direction.
shaders/damage_law.glsl is the GLSL twin. This module serves labels, tests and the exporter. Local
coordinates of p are u along the damage, v across it and w inward, from its origin. Section 3.3.2 of
the SeaFront paper describes the four kinds.
"""

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.scene import Damage, Vec3
from fastgen.scene.limits import LOBE_LIMIT, LOBES

Array = NDArray[np.floating]

FADE_START_MM, FADE_END_MM = 260.0, 520.0
"""Distances |w| from the face between which a field fades to 0, so that it spares the opposite
wall."""

SLACK_MM = 150.0
"""Distance behind a face's plane from which parts of the face can still be visible, because of
corrugation and castings."""

HOLE_REACH = 1 + LOBES * LOBE_LIMIT
"""Largest distance of a perforation's outline from its centre, in mean radii."""


def local_coordinates(damage: Damage, points_mm: Array) -> tuple[Array, Array, Array]:
    """Return local coordinates u, v and w, each [...] in mm, of points [..., 3] in mm."""
    q = np.asarray(points_mm, np.float64) - np.array(damage.origin_mm)
    return q @ np.array(damage.along), q @ np.array(damage.across), q @ np.array(damage.inward)


def amount_mm(damage: Damage, points_mm: Array) -> NDArray[np.float64]:
    """Return the displacement of points at rest along the damage's inward direction.

    Args:
        damage: The damage.
        points_mm: Points [..., 3] at rest, in mm in the container frame.

    Returns:
        float64 [...] in mm; negative where a concave damage bulges outward.
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
        profile = (1 - sink_share) * crease + sink_share * sink
        amount: NDArray[np.float64] = damage.depth_mm * taper * fade * profile
        return amount
    outside = np.hypot(u, v) - hole_radius_mm(damage, np.arctan2(v, u))
    rim_mm = damage.shape[0]
    amount = damage.depth_mm * np.clip(1 - outside / rim_mm, 0.0, 1.0) ** 2 * fade
    return amount


def fold_path_mm(damage: Damage, u: Array) -> Array:
    """Return v [...] in mm of a dent's fold at u [...]; it alternates between straight and
    sinusoidal stretches."""
    _, _, amplitude_mm, wavelength_mm, phase, stretch_mm = damage.shape[:6]
    # 0 on straight stretches, 1 on sinusoidal ones
    turn = _smoothstep(-0.25, 0.25, np.sin(np.pi * u / stretch_mm + phase))
    path: Array = amplitude_mm * turn * np.sin(2 * np.pi * u / wavelength_mm)
    return path


def hole_radius_mm(damage: Damage, angle: Array) -> Array:
    """Return the radius [...] in mm of a perforation's outline at angles [...] in radians."""
    ratio = np.ones_like(np.asarray(angle, np.float64))
    for k in range(LOBES):
        size, phase = damage.shape[1 + 2 * k], damage.shape[2 + 2 * k]
        ratio = ratio + size * np.cos((2 + k) * angle + phase)
    return damage.size_mm[0] / 2 * ratio


def in_hole(damage: Damage, points_mm: Array) -> NDArray[np.bool_]:
    """Test which points [..., 3] at rest a perforation tears away; bool [...]. It spares door gear,
    which the caller must exclude."""
    if damage.kind != "perforation":
        return np.zeros(np.shape(points_mm)[:-1], bool)
    u, v, w = local_coordinates(damage, points_mm)
    through = np.abs(w) < FADE_START_MM
    return (np.hypot(u, v) < hole_radius_mm(damage, np.arctan2(v, u))) & through


def deform(damages: tuple[Damage, ...], points_mm: Array) -> NDArray[np.float64]:
    """Return the positions [..., 3] in mm to which all damages together move points at rest."""
    rest = np.asarray(points_mm, np.float64).reshape(-1, 3)
    moved = rest.copy()
    for damage in damages:
        away = sum((x - at) ** 2 for x, at in zip(rest.T, damage.origin_mm, strict=True))
        # points beyond its reach do not move
        near = np.flatnonzero(away < np.square(reach_mm(damage)).sum())
        if len(near):
            amount = amount_mm(damage, rest.take(near, axis=0))
            for axis, inward in enumerate(damage.inward):
                moved[near, axis] += amount * inward
    return moved.reshape(np.shape(points_mm))


def reach_mm(damage: Damage) -> tuple[float, float, float]:
    """Return the distances from the origin, along, across and inward, within which a damage acts on
    points at rest."""
    u, v = damage.size_mm[0] / 2, damage.size_mm[1] / 2
    if damage.kind == "perforation":
        u = v = u * HOLE_REACH + damage.shape[0]
    if damage.kind == "dented":
        v = max(v, damage.shape[0]) + damage.shape[2]  # the fold swings aside
    return u, v, v if damage.kind == "axis" else FADE_END_MM


def corners_mm(damage: Damage) -> NDArray[np.float64]:
    """Return the corners [8, 3] in mm of a box around a damage, before and after displacement."""
    u, v, inward = reach_mm(damage)
    depth = abs(damage.depth_mm) + 60.0
    low, high = -depth, inward + max(damage.depth_mm, 0.0)
    if damage.kind == "axis":
        low, high = -v, v + depth
    axes = np.array([damage.along, damage.across, damage.inward])
    inside = np.array([-u, -v, low]) + UNIT_CUBE * np.array([2 * u, 2 * v, high - low])
    corners: NDArray[np.float64] = np.array(damage.origin_mm) + inside @ axes
    return corners


def variant(damages: tuple[Damage, ...]) -> str:
    """Return the shader variant that draws these damages, see render/variant.py."""
    if not damages:
        return "undamaged"
    return "holed" if any(damage.kind == "perforation" for damage in damages) else "damaged"


def may_be_seen(damage: Damage, position_mm: Vec3, beside: tuple[Damage, ...] = ()) -> bool:
    """Test whether a camera may see a damage from outside the container.

    A dented sheet is hidden from behind its plane, an edge from behind both of its faces.

    Args:
        damage: The damage.
        position_mm: Position of the camera, outside the container.
        beside: Damages of the scene; those that bulge outward may move this damage with them.
    """
    if damage.depth_mm < 0:
        return True
    toward = np.array(position_mm) - np.array(damage.origin_mm)
    # the inward axis is a coordinate axis for a sheet, and lies between two for an edge
    outward = [-np.sign(c) * toward[i] for i, c in enumerate(damage.inward) if abs(c) > 0.1]
    pushed_mm = sum(max(-other.depth_mm, 0.0) for other in beside)
    outside: bool = max(outward) > -SLACK_MM - pushed_mm
    return outside


def seen_damages(damages: tuple[Damage, ...], position_mm: Vec3) -> tuple[Damage, ...]:
    """Return the damages that an image from a position must draw.

    If a hole is visible, these are all damages, because each may change the visible inside.
    """
    seen = tuple(damage for damage in damages if may_be_seen(damage, position_mm, damages))
    return damages if variant(seen) == "holed" else seen


def _bump(t: Array) -> Array:
    """Return a smooth bump: 1 at t = 0, 0 for |t| >= 1, with zero slope at both."""
    return np.maximum(1 - t * t, 0.0) ** 2


def _smoothstep(low: float, high: float, x: Array) -> Array:
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    eased: Array = t * t * (3 - 2 * t)
    return eased
