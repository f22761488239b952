"""Convex polygons of surfaces in the world, and clipping by planes.

Sutherland and Hodgman 1974, "Reentrant Polygon Clipping".
"""

from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.damage_law import corners_mm, deform
from fastgen.geometry.mesh import Mesh
from fastgen.scene import Damage, Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Number = TypeVar("Number", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Facets:
    """Convex polygons that share points.

    Attributes:
        points_mm: float64 [P, 3] in the container frame.
        owner: int [P], ascending, index of the object that each point belongs to.
        corners: int [K, M], indices into points_mm, counter-clockwise from outside. A
            polygon has one owner. With fewer than M corners, its last corner repeats.
        rest_mm: float64 [P, 3], the points before damage, None if they are not needed.
    """

    points_mm: Array
    owner: Ints
    corners: Ints
    rest_mm: Array | None = None

    @staticmethod
    def of(polygons: Array, owner: Ints) -> "Facets":
        """Create facets from separate polygons.

        Args:
            polygons: float64 [K, M, 3], or [K, M, 6] with the positions before damage. The last
                corner of a polygon with fewer than M corners repeats.
            owner: int [K], ascending, index of each polygon's object.
        """
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
        """Clip to the side of a plane where the points' signed distances [P] are positive."""
        points = [self.points_mm] if self.rest_mm is None else [self.points_mm, self.rest_mm]
        polygons = np.concatenate(points, axis=1).take(self.corners, axis=0)
        cut, left = clip(polygons, distance.take(self.corners))
        return Facets.of(cut, self.owner[self.corners[left, 0]])


def damage_facets(scene: Scene, mesh: Mesh, damage: Damage) -> Facets:
    """Return the whole triangles that a damage may have moved, with their positions at rest."""
    axes = np.array([damage.along, damage.across, damage.inward])
    origin = np.array(damage.origin_mm)
    within = corners_mm(damage)
    lowest_mm, highest_mm = mesh.triangle_bounds_mm
    index = np.arange(len(mesh.triangles))
    # a box along the coordinate axes excludes most triangles
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


def mesh_facets(mesh: Mesh) -> Facets:
    """Return all triangles of a mesh, with each point of mesh.points_mm once."""
    _, which = mesh.distinct
    owner = np.zeros(len(mesh.points_mm), np.int64)
    return Facets(mesh.points_mm, owner, which.take(mesh.triangles))


def in_fours(facets: Facets) -> Facets:
    """Join pairs of triangles into polygons with four corners.

    Triangles 2 i and 2 i + 1, such as the two halves of a box's side, become one polygon if it is
    flat and convex. All facets must be triangles of one owner.
    """
    triangles = facets.corners
    even = len(triangles) // 2 * 2
    first, second = (facets.points_mm.take(triangles[i:even:2], axis=0) for i in (0, 1))
    # the corner that only the second triangle has comes before or after the two shared ones
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
    """Clip convex polygons by one plane each.

    Args:
        corners: [K, M, C], positions and other linear values, padded by repeating the last corner.
        inside: [K, M], signed distances of the corners from the plane; parts with distances of 0 or
            more are kept.

    Returns:
        The parts that are kept [K', up to M + 1, C], and bool [K]: polygons with such a part.
    """
    keep = inside >= 0
    inner = keep.sum(axis=1)
    left = inner > 0
    kept = corners if left.all() else corners.take(np.flatnonzero(left), axis=0)
    crossed = np.flatnonzero(left & (inner < keep.shape[1]))
    if len(crossed):  # most polygons are on one side
        pieces = _cut(corners.take(crossed, axis=0), inside.take(crossed, axis=0))
        kept, pieces = padded(kept, pieces.shape[1]), padded(pieces, kept.shape[1])
        kept[left.cumsum()[crossed] - 1] = pieces
    return kept, left


def padded(corners: NDArray[Number], most: int) -> NDArray[Number]:
    """Return a copy of polygons [K, M, ...] with at least `most` corners, the last one repeated."""
    more = max(most - corners.shape[1], 0)
    return np.concatenate([corners, *[corners[:, -1:]] * more], axis=1)


def _cut(corners: Array, inside: Array) -> Array:
    """Clip polygons that have corners on both sides, see `clip`."""
    count, most, channels = corners.shape
    after = np.arange(1, most + 1) % most
    following, ahead = corners.take(after, axis=1), inside.take(after, axis=1)
    span = inside - ahead
    share = np.divide(inside, span, out=np.zeros_like(span), where=span != 0)
    keep = inside >= 0
    # two slots per corner: the corner if it is inside, and the crossing of its outgoing edge
    slots = np.empty((count, most, 2, channels))
    slots[:, :, 0] = corners
    slots[:, :, 1] = corners + share[..., None] * (following - corners)
    valid = np.stack([keep, keep != (ahead >= 0)], axis=2).reshape(count, 2 * most)
    # used slots move to the front; sorting takes ten times as long
    used = valid.sum(axis=1)
    slot = np.flatnonzero(valid)
    column = np.minimum(np.arange(max(int(used.max()), 3)), used[:, None] - 1)
    order = slot.take((used.cumsum() - used)[:, None] + column)
    kept: Array = slots.reshape(-1, channels).take(order, axis=0)
    return kept


def lowest(values: NDArray[Number]) -> NDArray[Number]:
    """Return the minimum of [K, M, ...] over M; NumPy's reduction is slow along short axes."""
    return reduce(np.minimum, np.moveaxis(values, 1, 0))


def highest(values: NDArray[Number]) -> NDArray[Number]:
    """Return the maximum of [K, M, ...] over M; see `lowest`."""
    return reduce(np.maximum, np.moveaxis(values, 1, 0))
