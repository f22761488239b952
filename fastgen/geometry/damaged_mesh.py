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
"""Columns of the vertex arrays [V, 12] in this module; `spared` is 1 for parts without holes."""

Array = NDArray[np.float64]

Indices = NDArray[np.intp]
"""Indices of vertices, edges or corners."""


@dataclass(frozen=True, eq=False)
class DamagedMesh:
    """Indices of a damaged container.

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
    coarse = mesh.triangles.astype(np.intp)
    made = [np.empty((0, 3), np.intp)]
    for damage in damages:
        if form_of(damage).amount is None:
            continue
        near = _within_reach(damage, vertices, coarse)
        # pieces that one damage has divided are small enough for the next
        vertices, part = _refined(vertices, coarse[near], BENT_EDGE_MM)
        made.append(part)
        coarse = coarse[~near]
    fine = np.concatenate(made)
    for damage in damages:
        if form_of(damage).outline:
            near = _within_reach(damage, vertices, fine) & (vertices[fine[:, 0], _SPARED] == 0)
            vertices, part = _refined(vertices, fine[near], HOLE_EDGE_MM)
            vertices, part = _cut(damage, vertices, part)
            fine = np.concatenate([fine[~near], part])

    triangles = np.concatenate([coarse, fine])
    used = np.zeros(len(vertices), bool)
    used[triangles] = True
    whole = vertices[used]
    return DamagedMesh(
        positions_mm=whole[:, _MOVED],
        normals=_bent_normals(damages, whole[:, _REST], whole[:, _NORMAL]),
        atlas_mm=whole[:, _ATLAS],
        triangles=(np.cumsum(used) - 1)[triangles].astype(np.uint32),
    )


def _within_reach(damage: Damage, vertices: Array, triangles: Indices) -> NDArray[np.bool_]:
    """Test which triangles a damage may move or tear; bool [T]."""
    local = np.stack(local_coordinates(damage, vertices[:, _REST]), axis=-1)[triangles]
    reach = np.array(reach_mm(damage))
    touches: NDArray[np.bool_] = ((local.min(1) < reach) & (local.max(1) > -reach)).all(axis=1)
    return touches


def _refined(vertices: Array, triangles: Indices, max_edge_mm: float) -> tuple[Array, Indices]:
    """Divide triangles into four until no edge at rest is longer than max_edge_mm.

    Returns:
        The vertices, with the middles of divided edges appended, and the new triangles.
    """
    done = []
    while len(triangles):
        rest = vertices[triangles, _REST]
        edges = np.linalg.norm(rest - np.roll(rest, 1, axis=1), axis=-1)
        long = edges.max(axis=1) > max_edge_mm
        done.append(triangles[~long])
        a, b, c = triangles[long].T
        ends, middles = _distinct_edges(len(vertices), np.stack([a, b, c]), np.stack([b, c, a]))
        ab, bc, ca = middles + len(vertices)
        vertices = np.concatenate([vertices, vertices[ends].mean(axis=0)])
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    return vertices, np.concatenate([triangles, *done])


def _distinct_edges(count: int, start: Indices, end: Indices) -> tuple[Indices, Indices]:
    """Return the distinct edges, regardless of direction.

    Args:
        count: Number of vertices.
        start: First vertex of each edge [...].
        end: Second vertex of each edge [...].

    Returns:
        Ends of each distinct edge, lower index first, [2, E]; and the index [...] of each given
        edge in them.
    """
    keys = np.minimum(start, end) * count + np.maximum(start, end)
    each, places = np.unique(keys, return_inverse=True)
    return np.stack(np.divmod(each, count)), places.reshape(keys.shape)


def _cut(hole: Damage, vertices: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Cut a perforation out of small triangles, along straight pieces of its outline.

    Returns:
        The vertices, with new ones on the outline appended, and the triangles outside the hole.
    """
    touched, places = np.unique(triangles, return_inverse=True)
    u, v, w = local_coordinates(hole, vertices[touched, _REST])
    outline = form_of(hole).outline
    assert outline is not None
    level = np.maximum(outline(hole, u, v), np.abs(w) - FADE_START_MM)
    outside = (level >= 0)[places.reshape(-1, 3)]
    left = outside.sum(axis=1)
    one, two = left == 1, left == 2
    # corner a is the only one outside, or the only one within
    a, b, c = _turned(triangles[one], outside[one].argmax(axis=1))
    d, e, f = _turned(triangles[two], (~outside[two]).argmax(axis=1))
    ends, crossings = _distinct_edges(
        len(vertices), np.concatenate([a, a, d, d]), np.concatenate([b, c, e, f])
    )
    low, high = level[np.searchsorted(touched, ends)]
    share = (low / (low - high))[:, None]
    added = vertices[ends[0]] + share * (vertices[ends[1]] - vertices[ends[0]])
    ab, ac, de, df = np.split(crossings + len(vertices), np.cumsum([len(a), len(a), len(d)]))
    parts = [(a, ab, ac), (de, e, f), (de, f, df)]
    kept = [np.stack(part, axis=1) for part in parts]
    return np.concatenate([vertices, added]), np.concatenate([triangles[left == 3], *kept])


def _turned(triangles: Indices, first: Indices) -> Indices:
    """Return corners a, b and c of triangles, [3, T], rotated so that corner `first` is a."""
    order = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(triangles, order, axis=1).T


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
