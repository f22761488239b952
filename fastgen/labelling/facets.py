"""The flat pieces of a scene's surface that an object lies on, cut to its outline in the world.

Decals are clipped in sheet coordinates, where their outlines are convex, so that corners and edges
in the world are exact on the triangles that are drawn. Sutherland and Hodgman 1974, "Reentrant
Polygon Clipping".
"""

from collections.abc import Sequence
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
    if not decals:
        return Facets(np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros(0, np.int64))
    found = [_on_chart(mesh, face, decals) for face in dict.fromkeys(d.face for d in decals)]
    whose, index, sheet = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(whose, kind="stable")
    whose, index, sheet = whose[order], index[order], sheet[order]
    normals, offsets = (np.stack(parts) for parts in zip(*map(half_planes, decals), strict=True))
    # an edge's distance is linear in the weights, so one value a corner of the triangle does
    inside = np.einsum("tcd,ted->tce", sheet, normals[whose]) + offsets[whose, None]
    touches = (highest(inside) > 0).all(axis=1)
    index, whose, inside = index[touches], whose[touches], inside[touches]
    weights = np.broadcast_to(np.eye(3), (len(index), 3, 3))
    for k in range(4):
        weights, left = clip(weights, np.einsum("tmc,tc->tm", weights, inside[..., k]))
        index, whose, inside = index[left], whose[left], inside[left]
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


def in_fours(facets: Facets) -> Facets:
    """The same surface of fewer polygons: of triangles 2 i and 2 i + 1 one with four corners where
    that is flat and convex, as of a box's side. All facets: triangles of one owner."""
    even = len(facets) // 2 * 2
    first, second = facets.corners_mm[:even:2], facets.corners_mm[1:even:2]
    # the corner of the second that the first lacks, before or behind the two that it shares
    ahead = (second[:, 1] == first[:, 0]) & (second[:, 2] == first[:, 2])
    behind = (second[:, 0] == first[:, 0]) & (second[:, 1] == first[:, 2])
    fits = ahead.all(axis=1) | behind.all(axis=1)
    fourth = np.where(ahead.all(axis=1), 0, 2)[:, None, None]

    def with_fourth(corners: Array) -> Array:
        other = np.take_along_axis(corners[1:even:2], fourth, axis=1)
        return np.concatenate([corners[:even:2], other], axis=1)

    four = with_fourth(facets.corners_mm)
    side = np.roll(four, -1, axis=1) - four
    turns = np.cross(side, np.roll(side, -1, axis=1))
    along = (turns * turns[:, :1]).sum(axis=2)
    lengths = np.linalg.norm(turns, axis=2)
    fits &= (along > (1 - 1e-6) * lengths * lengths[:, :1]).all(axis=1)
    single = np.append(np.repeat(~fits, 2), np.ones(len(facets) - even, bool))
    corners, rest = (
        np.concatenate([with_fourth(points)[fits], _padded(points[single], 4)])
        for points in (facets.corners_mm, facets.rest_mm)
    )
    return Facets(corners, rest, np.broadcast_to(facets.owner[:1], len(corners)))


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


def _on_chart(
    mesh: Mesh, face: str, decals: Sequence[Decal]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Pairs of a decal on chart `face`, by its number, and a triangle around it: both [P], and the
    triangle's sheet corners [P, 3, 2] in mm."""
    number = mesh.chart_index(face)
    index, sheet = mesh.chart_triangles(number)
    low, high = mesh.chart_bounds(number)
    here = np.array([i for i, decal in enumerate(decals) if decal.face == face])
    x, y = np.array([decals[i].center_mm for i in here]).T[..., None]
    reach = np.array([np.hypot(*decals[i].size_mm) / 2 for i in here])[:, None]
    near = (high[0] >= x - reach) & (low[0] <= x + reach)
    near &= (high[1] >= y - reach) & (low[1] <= y + reach)
    row, triangle = np.nonzero(near)
    return here[row], index[triangle], sheet[triangle]


def _corners(scene: Scene | None, mesh: Mesh, index: NDArray[np.int64]) -> tuple[Array, Array]:
    """Corners [T, 3, 3] in mm of triangles as damage moved them, and at rest."""
    rest = mesh.positions_mm[mesh.triangles[index]].astype(np.float64)
    return (deform(scene.damages, rest) if scene and scene.damages else rest), rest
