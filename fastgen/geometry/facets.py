"""Flat pieces of surfaces in the world, whole and cut by planes.

Sutherland and Hodgman 1974, "Reentrant Polygon Clipping".
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.damage_law import corners_mm, deform
from fastgen.geometry.distinct_rows import distinct_rows
from fastgen.geometry.mesh import Mesh
from fastgen.scene import Damage, Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Number = TypeVar("Number", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Facets:
    """Convex polygons in the world, counter-clockwise from outside, by the points they share.

    points_mm: float64 [P, 3]. owner: int [P], ascending, which object each point is of.
    corners: int [K, M], which points a polygon joins, all of one owner; where it has fewer than M
    the last one repeats. rest_mm: float64 [P, 3], the points before damage, None where that is not
    asked for.
    """

    points_mm: Array
    owner: Ints
    corners: Ints
    rest_mm: Array | None = None

    @staticmethod
    def of(polygons: Array, owner: Ints) -> "Facets":
        """From polygons [K, M, 3], or with their rest positions [K, M, 6], and whose they are [K],
        ascending. Where a polygon has fewer than M corners the last one repeats."""
        count, most, channels = polygons.shape
        new = np.ones((count, most), bool)
        new[:, 1:] = reduce(
            np.logical_or, (polygons[:, 1:, c] != polygons[:, :-1, c] for c in range(channels))
        )
        points = polygons.reshape(-1, channels).take(np.flatnonzero(new), axis=0)
        corners = new.ravel().cumsum().reshape(new.shape) - 1
        owner = owner.repeat(np.diff(corners[:, -1], prepend=-1))
        return Facets(points[:, :3], owner, corners, points[:, 3:] if channels > 3 else None)

    def beyond(self, distance: Array) -> "Facets":
        """What of them is left where the points' signed distances [P] to a plane are positive."""
        points = [self.points_mm] if self.rest_mm is None else [self.points_mm, self.rest_mm]
        polygons = np.concatenate(points, axis=1).take(self.corners, axis=0)
        cut, left = clip(polygons, distance.take(self.corners))
        return Facets.of(cut, self.owner[self.corners[left, 0]])


def damage_facets(scene: Scene, mesh: Mesh, damage: Damage) -> Facets:
    """The triangles that `damage` may have touched, whole, and where they were at rest."""
    axes = np.array([damage.along, damage.across, damage.inward])
    origin = np.array(damage.origin_mm)
    within = corners_mm(damage)
    lowest_mm, highest_mm = mesh.triangle_bounds_mm
    index = np.arange(len(mesh.triangles))
    # few triangles come near even along the world's axes
    for axis, (least, most) in enumerate(zip(within.min(axis=0), within.max(axis=0), strict=True)):
        high, low = highest_mm[:, axis].take(index), lowest_mm[:, axis].take(index)
        index = index[(high >= least) & (low <= most)]
    box = (within - origin) @ axes.T
    triangles = mesh.triangles.take(index, axis=0)
    local = (mesh.positions_mm.take(triangles, axis=0) - origin) @ axes.T
    near = (highest(local) >= box.min(axis=0)).all(axis=1)
    near &= (lowest(local) <= box.max(axis=0)).all(axis=1)
    vertices, corners = np.unique(triangles[near], return_inverse=True)
    rest = mesh.positions_mm.take(vertices, axis=0).astype(np.float64)
    moved = deform(scene.damages, rest) if scene.damages else rest
    return Facets(moved, np.zeros(len(rest), np.int64), corners.reshape(-1, 3), rest)


def mesh_facets(mesh: Mesh, damages: Sequence[Damage] = ()) -> Facets:
    """All triangles of a mesh, as damages moved them, each point once."""
    first, which = distinct_rows(mesh.positions_mm)
    points = deform(tuple(damages), mesh.positions_mm.take(first, axis=0))
    return Facets(points, np.zeros(len(points), np.int64), which.take(mesh.triangles))


def in_fours(facets: Facets) -> Facets:
    """The same surface of fewer polygons: of triangles 2 i and 2 i + 1 one with four corners where
    that is flat and convex, as of a box's side. All facets: triangles of one owner."""
    triangles = facets.corners
    even = len(triangles) // 2 * 2
    first, second = (facets.points_mm.take(triangles[i:even:2], axis=0) for i in (0, 1))
    # the corner of the second that the first lacks, before or behind the two that it shares
    ahead = (second[:, 1] == first[:, 0]) & (second[:, 2] == first[:, 2])
    behind = (second[:, 0] == first[:, 0]) & (second[:, 1] == first[:, 2])
    fits = ahead.all(axis=1) | behind.all(axis=1)
    fourth = np.where(ahead.all(axis=1), triangles[1:even:2, 0], triangles[1:even:2, 2])
    fours = np.column_stack([triangles[:even:2], fourth])
    corners = facets.points_mm.take(fours, axis=0)
    side = np.roll(corners, -1, axis=1) - corners
    turns = np.cross(side, np.roll(side, -1, axis=1))
    along = (turns * turns[:, :1]).sum(axis=2)
    lengths = np.linalg.norm(turns, axis=2)
    fits &= (along > (1 - 1e-6) * lengths * lengths[:, :1]).all(axis=1)
    single = np.append(np.repeat(~fits, 2), np.ones(len(triangles) - even, bool))
    return replace(facets, corners=np.concatenate([fours[fits], padded(triangles[single], 4)]))


def clip(corners: Array, inside: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Cut convex polygons by a plane each.

    corners: [K, M, C], padded by repeating the last one. inside: [K, M], the corners' signed
    distances, kept where not negative. Returns what is left, [K', M + 1 or fewer, C], and bool [K]:
    which polygons something is left of.
    """
    keep = inside >= 0
    inner = keep.sum(axis=1)
    left = inner > 0
    kept = corners if left.all() else corners.take(np.flatnonzero(left), axis=0)
    crossed = np.flatnonzero(left & (inner < keep.shape[1]))
    if len(crossed):  # most polygons lie on one side
        pieces = _cut(corners.take(crossed, axis=0), inside.take(crossed, axis=0))
        kept, pieces = padded(kept, pieces.shape[1]), padded(pieces, kept.shape[1])
        kept[left.cumsum()[crossed] - 1] = pieces
    return kept, left


def padded(corners: NDArray[Number], most: int) -> NDArray[Number]:
    """Polygons [K, M, ...] with at least `most` corners, the last one repeated; a copy."""
    more = max(most - corners.shape[1], 0)
    return np.concatenate([corners, *[corners[:, -1:]] * more], axis=1)


def _cut(corners: Array, inside: Array) -> Array:
    """As `clip`, of polygons with corners on both sides."""
    count, most, channels = corners.shape
    after = np.arange(1, most + 1) % most
    following, ahead = corners.take(after, axis=1), inside.take(after, axis=1)
    span = inside - ahead
    share = np.divide(inside, span, out=np.zeros_like(span), where=span != 0)
    keep = inside >= 0
    # each corner gives itself where inside, then the crossing of the edge that it starts
    slots = np.empty((count, most, 2, channels))
    slots[:, :, 0] = corners
    slots[:, :, 1] = corners + share[..., None] * (following - corners)
    valid = np.stack([keep, keep != (ahead >= 0)], axis=2).reshape(count, 2 * most)
    # which slot comes first, second and so on; sorting takes ten times as long
    used = valid.sum(axis=1)
    slot = np.flatnonzero(valid)
    column = np.minimum(np.arange(max(int(used.max()), 3)), used[:, None] - 1)
    order = slot.take((used.cumsum() - used)[:, None] + column)
    return slots.reshape(-1, channels).take(order, axis=0)


def lowest(values: NDArray[Number]) -> NDArray[Number]:
    """Least of [K, M, ...] over M; NumPy's own reduction is slow along so short an axis."""
    return reduce(np.minimum, np.moveaxis(values, 1, 0))


def highest(values: NDArray[Number]) -> NDArray[Number]:
    """Greatest of [K, M, ...] over M, as `lowest`."""
    return reduce(np.maximum, np.moveaxis(values, 1, 0))
