"""Damages as displacement fields with a few parameters each; meshes keep their triangles.

A damage moves a point p at rest (mm, container frame) by amount(p) along its `inward` direction.
The fields of all forms are in the package damages. shaders/damage_law.glsl is the GLSL twin;
this module serves labels, tests and the exporter.
"""

import numpy as np
from numpy.typing import NDArray

from fastgen.damages.fields import FADE_END_MM, FADE_START_MM, smoothstep
from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.scene import Damage, Vec3
from fastgen.scene.damage_kinds import form_of
from fastgen.scene.faces import FACE_AXES

Array = NDArray[np.floating]

SLACK_MM = 150.0
"""Distance behind a face's plane from which parts of the face can still be visible, because of
corrugation and castings."""


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
        float64 [...] in mm; negative where a damage bulges outward.
    """
    u, v, w = local_coordinates(damage, points_mm)
    form = form_of(damage)
    if form.amount is None:
        return np.zeros(np.shape(u))
    amount = np.asarray(form.amount(damage, u, v, w), np.float64)
    if form.along_edge:
        return amount
    return np.asarray(amount * (1 - smoothstep(FADE_START_MM, FADE_END_MM, np.abs(w))))


def in_hole(damage: Damage, points_mm: Array) -> NDArray[np.bool_]:
    """Test which points [..., 3] at rest a damage tears away; bool [...]. It spares door gear,
    which the caller must exclude."""
    outline = form_of(damage).outline
    if outline is None:
        return np.zeros(np.shape(points_mm)[:-1], bool)
    u, v, w = local_coordinates(damage, points_mm)
    return np.asarray((outline(damage, u, v) < 0) & (np.abs(w) < FADE_START_MM))


def is_marked(damage: Damage, points_mm: Array) -> NDArray[np.bool_]:
    """Test at which points [..., 3] at rest a damage without displacement changes the surface; bool
    [...]."""
    marked = form_of(damage).marked
    if marked is None:
        return np.zeros(np.shape(points_mm)[:-1], bool)
    return marked(damage, *local_coordinates(damage, points_mm))


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
    form = form_of(damage)
    u, v = form.reach(damage)
    return u, v, v if form.along_edge else FADE_END_MM


def outward_mm(damage: Damage) -> float:
    """Return an upper bound of the outward displacement by a damage, 0 or more."""
    return -form_of(damage).span(damage)[0]


def inward_mm(damage: Damage) -> float:
    """Return an upper bound of the inward displacement of the outermost sheet, 0 or more."""
    return form_of(damage).span(damage)[1]


def largest_mm(damage: Damage) -> float:
    """Return the largest displacement by a damage in either direction."""
    return form_of(damage).largest(damage)


def corners_mm(damage: Damage) -> NDArray[np.float64]:
    """Return the corners [8, 3] in mm of a box around a damage, before and after displacement."""
    u, v, inward = reach_mm(damage)
    depth = abs(damage.depth_mm) + 60.0
    low, high = -depth, inward + inward_mm(damage)
    if form_of(damage).along_edge:
        low, high = -v - outward_mm(damage), v + depth
    axes = np.array([damage.along, damage.across, damage.inward])
    inside = np.array([-u, -v, low]) + UNIT_CUBE * np.array([2 * u, 2 * v, high - low])
    corners: NDArray[np.float64] = np.array(damage.origin_mm) + inside @ axes
    return corners


def variant(damages: tuple[Damage, ...]) -> str:
    """Return the shader variant that draws these damages, see render/variant.py."""
    if not damages:
        return "undamaged"
    return "holed" if any(form_of(damage).outline for damage in damages) else "damaged"


def may_be_seen(damage: Damage, position_mm: Vec3, beside: tuple[Damage, ...] = ()) -> bool:
    """Test whether a camera may see a damage from outside the container.

    Sheet that is bent outward may be seen from anywhere, beyond the edge of its face.

    Args:
        damage: The damage.
        position_mm: Position of the camera, outside the container.
        beside: Damages of the scene; those that bulge outward may move this damage with them.
    """
    return outward_mm(damage) > 0 or faces(damage, position_mm, beside)


def faces(damage: Damage, position_mm: Vec3, beside: tuple[Damage, ...] = ()) -> bool:
    """Test whether a camera is on the outer side of a damaged sheet, or of a face at its edge.

    A dented sheet is hidden from behind its plane, an edge from behind both of its faces. The
    arguments are those of may_be_seen.
    """
    toward = np.array(position_mm) - np.array(damage.origin_mm)
    outward = [float(toward @ FACE_AXES[face].out) for face in damage.face.split(".")]
    pushed_mm = sum(map(outward_mm, beside))
    outside: bool = max(outward) > -SLACK_MM - pushed_mm
    return outside


def seen_damages(damages: tuple[Damage, ...], position_mm: Vec3) -> tuple[Damage, ...]:
    """Return the damages that an image from a position must draw.

    If a hole is visible, these are all damages, because each may change the visible inside.
    """
    seen = tuple(damage for damage in damages if may_be_seen(damage, position_mm, damages))
    return damages if variant(seen) == "holed" else seen
