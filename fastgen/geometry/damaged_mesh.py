"""A damaged container as plain triangles, with bent dents and cut holes, for export.

The renderer bends the vertices of the same mesh, discards the pixels of holes, and computes normals
of the displacement field at each pixel. For export, triangles near damages are divided, so that
vertex normals can follow the field and the outlines of holes can be cut.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.damages.fields import FADE_START_MM
from fastgen.geometry.damage_law import deform, local_coordinates, reach_mm
from fastgen.geometry.door_gear import is_gear
from fastgen.geometry.mesh import Mesh
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import form_of

BENT_EDGE_MM = 45.0
"""Longest edge near a damage; a fold is about 60 mm wide."""

HOLE_EDGE_MM = 8.0
"""Longest edge near a hole; a chord of this length is within 1 mm of the teeth of a tear, whose
radius is 8 mm or more."""

_SLOPE_STEP_MM = 0.5

_REST, _MOVED, _NORMAL, _ATLAS = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 11)
_SPARED = 11
"""Columns of the corner arrays [T, 3, 12] in this module; `spared` is 1 for parts without holes."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DamagedMesh:
    """Triangles of a damaged container.

    Attributes:
        positions_mm: float64 [V, 3] in the container frame.
        normals: float64 [V, 3], unit length.
        atlas_mm: float64 [V, 2].
        triangles: uint32 [T, 3], counter-clockwise from outside.
    """

    positions_mm: Array
    normals: Array
    atlas_mm: Array
    triangles: NDArray[np.uint32]


def damaged_mesh(mesh: Mesh, damages: tuple[Damage, ...]) -> DamagedMesh:
    """Apply damages to the mesh of a container."""
    rest = mesh.positions_mm.astype(np.float64)
    spared = np.array([is_gear(chart) for chart in mesh.charts])[mesh.chart, None]
    moved = deform(damages, rest)
    vertices = np.concatenate([rest, moved, mesh.normals, mesh.atlas_mm, spared], axis=1)
    corners = vertices[mesh.triangles]
    kept = np.ones(len(corners), bool)
    made = []
    for damage in damages:
        if form_of(damage).amount is None:
            continue
        near = kept & _within_reach(damage, corners)
        kept &= ~near
        # pieces that one damage has divided are small enough for the next
        part = _refined(corners[near], BENT_EDGE_MM)
        made.append(part)
    fine = np.concatenate([np.empty((0, 3, vertices.shape[1])), *made])
    for damage in damages:
        if form_of(damage).outline:
            near = _within_reach(damage, fine) & (fine[:, 0, _SPARED] == 0)
            fine = np.concatenate([fine[~near], _cut(damage, _refined(fine[near], HOLE_EDGE_MM))])

    used, triangles = np.unique(mesh.triangles[kept], return_inverse=True)
    flat = fine.reshape(-1, vertices.shape[1])
    added = np.arange(len(flat)).reshape(-1, 3) + len(used)
    whole = np.concatenate([vertices[used], flat])
    return DamagedMesh(
        positions_mm=whole[:, _MOVED],
        normals=_bent_normals(damages, whole[:, _REST], whole[:, _NORMAL]),
        atlas_mm=whole[:, _ATLAS],
        triangles=np.concatenate([triangles.reshape(-1, 3), added]).astype(np.uint32),
    )


def _within_reach(damage: Damage, corners: Array) -> NDArray[np.bool_]:
    """Test which triangles a damage may move or tear; bool [T]."""
    local = np.stack(local_coordinates(damage, corners[..., _REST]), axis=-1)
    reach = np.array(reach_mm(damage))
    touches: NDArray[np.bool_] = ((local.min(1) < reach) & (local.max(1) > -reach)).all(axis=1)
    return touches


def _refined(corners: Array, max_edge_mm: float) -> Array:
    """Divide triangles into four until no edge at rest is longer than max_edge_mm."""
    done = []
    while len(corners):
        rest = corners[..., _REST]
        edges = np.linalg.norm(rest - np.roll(rest, 1, axis=1), axis=-1)
        long = edges.max(axis=1) > max_edge_mm
        done.append(corners[~long])
        a, b, c = np.moveaxis(corners[long], 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    return np.concatenate(done) if done else corners


def _cut(hole: Damage, corners: Array) -> Array:
    """Cut a perforation out of small triangles, along straight pieces of its outline."""
    u, v, w = local_coordinates(hole, corners[..., _REST])
    outline = form_of(hole).outline
    assert outline is not None
    outside_mm = outline(hole, u, v)
    level = np.maximum(outside_mm, np.abs(w) - FADE_START_MM)
    left = (level >= 0).sum(axis=1)
    one, two = (corners[left == count] for count in (1, 2))
    parts = [corners[left == 3]]
    if len(one):
        a, b, c, at = _turned(one, level[left == 1], (level[left == 1] >= 0).argmax(axis=1))
        parts.append(np.stack([a, _crossing(a, b, at, 1), _crossing(a, c, at, 2)], axis=1))
    if len(two):
        a, b, c, at = _turned(two, level[left == 2], (level[left == 2] < 0).argmax(axis=1))
        ab, ca = _crossing(a, b, at, 1), _crossing(a, c, at, 2)
        parts += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ca], axis=1)]
    return np.concatenate(parts)


def _turned(corners: Array, level: Array, first: NDArray[np.intp]) -> tuple[Array, ...]:
    """Return corners a, b, c [T, 12] and levels [T, 3], rotated so that `first` is corner a."""
    order = (first[:, None] + np.arange(3)) % 3
    rows = np.arange(len(corners))[:, None]
    turned = corners[rows, order]
    return turned[:, 0], turned[:, 1], turned[:, 2], level[rows, order]


def _crossing(a: Array, other: Array, level: Array, corner: int) -> Array:
    """Interpolate the points [T, 12] of level 0 between corner 0 and another corner."""
    share = level[:, :1] / (level[:, :1] - level[:, corner : corner + 1])
    return a + share * (other - a)


def _bent_normals(damages: tuple[Damage, ...], rest_mm: Array, normals: Array) -> Array:
    """Return unit normals [V, 3] after damage, by the cofactor matrix of the deformation."""
    steps = np.eye(3) * _SLOPE_STEP_MM
    x, y, z = (
        (deform(damages, rest_mm + step) - deform(damages, rest_mm - step)) / (2 * _SLOPE_STEP_MM)
        for step in steps
    )
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
    bent = np.einsum("vi,vik->vk", normals, cofactors)
    return np.asarray(bent / np.linalg.norm(bent, axis=1, keepdims=True), np.float64)
