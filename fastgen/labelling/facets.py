"""The flat pieces of a scene's surface that an object lies on, cut to its outline in the world.

Decals are clipped in sheet coordinates, where their outlines are convex, so that corners and edges
in the world are exact on the triangles that are drawn. Sutherland and Hodgman 1974, "Reentrant
Polygon Clipping".
"""

from dataclasses import dataclass
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fastgen.damage import corners_mm, deform
from fastgen.geometry.mesh import Mesh
from fastgen.scene import Damage, Decal, Scene

Array = NDArray[np.float64]
Number = TypeVar("Number", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Facets:
    """Convex polygons in the world, counter-clockwise from outside.

    corners_mm: float64 [K, M, 3]; where a polygon has fewer than M corners its last one repeats.
    rest_mm: float64 [K, M, 3], the same before damage. owner: int [K], which object each is of.
    """

    corners_mm: Array
    rest_mm: Array
    owner: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.owner)


def decal_facets(scene: Scene, mesh: Mesh) -> Facets:
    """The labelled decals of `scene`; owner counts them in scene order from 0."""
    decals = [decal for decal in scene.decals if decal.class_name]
    triangles, sheets, planes, owner = [], [], [], []
    for number, decal in enumerate(decals):
        found, sheet = _on_chart(mesh, decal)
        normals, offsets = half_planes(decal)
        inmost = highest(sheet @ normals.T + offsets)  # toward each edge
        touches = (inmost > 0).all(axis=1)
        sheets.append(sheet[touches])
        triangles.append(found[touches])
        planes.append(np.broadcast_to(np.column_stack([normals, offsets]), (len(sheets[-1]), 4, 3)))
        owner.append(np.full(len(sheets[-1]), number))
    if not decals:
        return Facets(np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros(0, np.int64))
    index, whose = np.concatenate(triangles), np.concatenate(owner)
    sheet, edges = np.concatenate(sheets), np.concatenate(planes)
    weights = np.broadcast_to(np.eye(3), (len(index), 3, 3))
    for k in range(4):
        # an edge's distance is linear in the weights, so one value a corner of the triangle does
        at_corners = np.einsum("tcd,td->tc", sheet, edges[:, k, :2]) + edges[:, k, 2:]
        weights, left = clip(weights, np.einsum("tmc,tc->tm", weights, at_corners))
        index, whose, sheet, edges = index[left], whose[left], sheet[left], edges[left]
    corners, rest = _corners(scene, mesh, index)
    return Facets(weights @ corners, weights @ rest, whose)


def damage_facets(scene: Scene, mesh: Mesh, damage: Damage, owner: int) -> Facets:
    """The triangles that `damage` may have touched, whole."""
    axes = np.array([damage.along, damage.across, damage.inward])
    origin = np.array(damage.origin_mm)
    within = corners_mm(damage)
    low, high = mesh.triangle_bounds_mm
    # few triangles come near even along the world's axes
    near = (high >= within.min(axis=0)).all(axis=1) & (low <= within.max(axis=0)).all(axis=1)
    index = np.flatnonzero(near)
    box = (within - origin) @ axes.T
    local = (mesh.positions_mm[mesh.triangles[index]] - origin) @ axes.T
    near = (highest(local) >= box.min(axis=0)).all(axis=1)
    near &= (lowest(local) <= box.max(axis=0)).all(axis=1)
    index = index[near]
    corners, kept = _corners(scene, mesh, index)
    return Facets(corners, kept, np.full(len(index), owner))


def mesh_facets(scene: Scene | None, mesh: Mesh, groups: list[str], owner: int) -> Facets:
    """All triangles of `groups` of the mesh, moved by the damages of `scene` if one is given."""
    index = np.concatenate(
        [np.arange(mesh.groups[name].start, mesh.groups[name].stop) for name in groups]
    )
    corners, rest = _corners(scene, mesh, index)
    return Facets(corners, rest, np.full(len(index), owner))


def half_planes(decal: Decal) -> tuple[Array, Array]:
    """Edges of a decal's outline: normals [4, 2] and offsets [4], n . p + c >= 0 inside.

    p is in sheet mm. A marker's outline is the diamond in its rectangle, others' the rectangle.
    """
    half = np.array(decal.size_mm) / 2
    if decal.kind == "marker":
        local = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / half
        reach = np.ones(4)
    else:
        local = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])
        reach = np.array([half[0], half[1], half[0], half[1]])
    normals = -local @ decal.turn.T
    return normals, reach - normals @ np.array(decal.center_mm)


def clip(corners: Array, inside: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Cut convex polygons by a plane each.

    corners: [K, M, C], padded by repeating the last one. inside: [K, M], the corners' signed
    distances, kept where not negative. Returns what is left, [K', M + 1 or fewer, C], and bool [K]:
    which polygons something is left of.
    """
    keep = inside >= 0
    left: NDArray[np.bool_] = np.asarray(keep.any(axis=1))
    crossed = left & ~keep.all(axis=1)
    kept = corners[left]
    if crossed.any():  # most polygons lie on one side
        pieces = _cut(corners[crossed], inside[crossed])
        kept, pieces = _padded(kept, pieces.shape[1]), _padded(pieces, kept.shape[1])
        kept[crossed[left]] = pieces
    return kept, left


def _padded(corners: Array, most: int) -> Array:
    """Polygons [K, M, C] with at least `most` corners, the last one repeated."""
    more = max(most - corners.shape[1], 0)
    return np.concatenate([corners, *[corners[:, -1:]] * more], axis=1)


def _cut(corners: Array, inside: Array) -> Array:
    """As `clip`, of polygons with corners on both sides."""
    following = np.roll(corners, -1, axis=1)
    ahead = np.roll(inside, -1, axis=1)
    span = inside - ahead
    share = np.divide(inside, span, out=np.zeros_like(span), where=span != 0)
    cut = corners + share[..., None] * (following - corners)
    keep = inside >= 0
    crosses = keep != (ahead >= 0)
    count, most, channels = corners.shape
    # each corner gives itself where inside, then the crossing of the edge that it starts
    slots = np.stack([corners, cut], axis=2).reshape(count, 2 * most, channels)
    valid = np.stack([keep, crosses], axis=2).reshape(count, 2 * most)
    # which slot comes first, second and so on; sorting takes ten times as long
    place = np.cumsum(valid, axis=1)
    used = place[:, -1]
    order = np.zeros(valid.shape, np.int64)
    row, slot = np.nonzero(valid)
    order[row, place[row, slot] - 1] = slot
    width = max(int(used.max()), 3)
    column = np.minimum(np.arange(width), used[:, None] - 1)
    rows = np.arange(count)[:, None]
    return slots[rows, order[rows, column]]


def lowest(values: NDArray[Number]) -> NDArray[Number]:
    """Least of [K, M, ...] over M; NumPy's own reduction is slow along so short an axis."""
    return reduce(np.minimum, np.moveaxis(values, 1, 0))


def highest(values: NDArray[Number]) -> NDArray[Number]:
    """Greatest of [K, M, ...] over M, as `lowest`."""
    return reduce(np.maximum, np.moveaxis(values, 1, 0))


def _on_chart(mesh: Mesh, decal: Decal) -> tuple[NDArray[np.int64], Array]:
    """Triangles of the decal's chart around it, and their sheet corners [T, 3, 2] in mm."""
    number = mesh.chart_index(decal.face)
    index, sheet = mesh.chart_triangles(number)
    low, high = mesh.chart_bounds(number)
    reach = np.hypot(*decal.size_mm) / 2
    center = np.array(decal.center_mm)
    near = (high[0] >= center[0] - reach) & (low[0] <= center[0] + reach)
    near &= (high[1] >= center[1] - reach) & (low[1] <= center[1] + reach)
    return index[near], sheet[near]


def _corners(scene: Scene | None, mesh: Mesh, index: NDArray[np.int64]) -> tuple[Array, Array]:
    """Corners [T, 3, 3] in mm of triangles as damage moved them, and at rest."""
    rest = mesh.positions_mm[mesh.triangles[index]].astype(np.float64)
    return (deform(scene.damages, rest) if scene and scene.damages else rest), rest
