"""The flat pieces of the container's surface that decals lie on, cut to their outlines.

They are clipped in sheet coordinates, where outlines are convex, so that corners and edges in the
world are exact on the triangles that are drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.damage_law import deform
from fastgen.geometry.decal_outlines import Outlines
from fastgen.geometry.facets import Facets, clip, padded
from fastgen.geometry.mesh import Mesh
from fastgen.scene import Decal, Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_ON_EDGE = 1e-6
"""So near an edge of a triangle, as a share of its height, a point may be said to lie on another,
which on the door may be a step away."""


@dataclass(frozen=True, eq=False)
class _Under:
    """Pairs of a labelled decal and a triangle under it, as far as sides of the outline tell.

    whose: int [P], ascending, number of the decal among those with a label. triangle: int [P], of
    the mesh. sheet_mm: float64 [2, 3, P], x and y of its corners. inside: float64 [4, 3, P], how
    far these lie within each side of the outline, see Outlines.half_planes.
    """

    decals: tuple[Decal, ...]
    outlines: Outlines
    whose: Ints
    triangle: Ints
    sheet_mm: Array
    inside: Array


@lru_cache(maxsize=4)
def decal_facets(scene: Scene, mesh: Mesh) -> Facets:
    """The labelled decals of `scene` after damage; owner counts them in scene order from 0. The
    cameras of a scene share them."""
    under = _under_decals(scene, mesh)
    if under is None:
        return Facets.of(np.zeros((0, 3, 3)), np.zeros(0, np.int64))
    corners = mesh.positions_mm.take(mesh.triangles.take(under.triangle, axis=0), axis=0)
    moved = deform(scene.damages, corners)
    whole = (under.inside >= 0).all(axis=(0, 1))
    crossed = np.flatnonzero(~whole)
    # positions and the distances to an outline's sides are both linear on a triangle
    inside = under.inside.take(crossed, axis=2).T
    cut, owner = np.concatenate([moved.take(crossed, axis=0), inside], axis=2), under.whose[crossed]
    for side in range(4):
        cut, left = clip(cut, cut[..., 3 + side])
        owner = owner[left]
    owner = np.concatenate([under.whose[whole], owner])
    pieces = np.concatenate([padded(moved[whole], cut.shape[1]), cut[..., :3]])
    order = np.argsort(owner, kind="stable")
    return Facets.of(pieces.take(order, axis=0), owner[order])


def decal_outlines(scene: Scene, mesh: Mesh) -> Array:
    """Outlines [N, points, 3] in mm of the labelled decals after damage, see Outlines.points_mm."""
    under = _under_decals(scene, mesh)
    if under is None:
        return np.zeros((0, 0, 3))
    edges = under.outlines.points_mm()
    crossed = np.flatnonzero((under.inside < 0).any(axis=(0, 1)))
    whose, triangle = under.whose[crossed], under.triangle[crossed]
    x, y = (along.take(whose, axis=0) for along in (edges[..., 0], edges[..., 1]))
    # weights of a triangle's corners are linear on its sheet
    (ax, bx, cx), (ay, by, cy) = under.sheet_mm.take(crossed, axis=2)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    right, down = x - ax[:, None], y - ay[:, None]
    second = right * ((cy - ay) / area)[:, None] - down * ((cx - ax) / area)[:, None]
    third = down * ((bx - ax) / area)[:, None] - right * ((by - ay) / area)[:, None]
    least = np.minimum(np.minimum(second, third), 1 - second - third)
    pair, point = np.divmod(np.flatnonzero(least > _ON_EDGE), edges.shape[1])
    corners = mesh.positions_mm.take(mesh.triangles.take(triangle[pair], axis=0), axis=0)
    a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
    rest = np.full((*edges.shape[:2], 3), np.nan)
    rest[whose[pair], point] = (
        a + second[pair, point, None] * (b - a) + third[pair, point, None] * (c - a)
    )
    lost = np.isnan(rest[..., 0])  # on edges, beyond the sheet's border, in the gap of the door
    for face in {under.decals[row].face for row in np.flatnonzero(lost.any(axis=1))}:
        off = lost & np.array([decal.face == face for decal in under.decals])[:, None]
        rest[off], _ = mesh.sheet_to_surface(face, edges[off])
    return deform(scene.damages, rest)


@lru_cache(maxsize=2)
def _under_decals(scene: Scene, mesh: Mesh) -> _Under | None:
    """Of the labelled decals of `scene`; None where it has none."""
    decals = tuple(decal for decal in scene.decals if decal.class_name)
    if not decals:
        return None
    outlines = Outlines.of(decals)
    found = [_near(mesh, face, decals, outlines) for face in {decal.face for decal in decals}]
    whose, triangle, sheet = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(whose, kind="stable")
    whose, triangle = whose[order], triangle[order]
    x, y = sheet_mm = np.ascontiguousarray(sheet.take(order, axis=0).T)
    normals, offsets = (part.take(whose, axis=0) for part in outlines.half_planes())
    right, down, offset = np.array([*normals.T, offsets.T])[:, :, None]
    inside = right * x + down * y + offset
    touches = np.flatnonzero((inside.max(axis=1) > 0).all(axis=0))
    sheet_mm, inside = sheet_mm.take(touches, axis=2), inside.take(touches, axis=2)
    return _Under(decals, outlines, whose[touches], triangle[touches], sheet_mm, inside)


def _near(
    mesh: Mesh, face: str, decals: Sequence[Decal], outlines: Outlines
) -> tuple[Ints, Ints, Array]:
    """Pairs of a decal on chart `face`, by its number, and a triangle around it: both [P], and the
    triangle's sheet corners [P, 3, 2] in mm."""
    number = mesh.chart_index(face)
    index, sheet = mesh.chart_triangles(number)
    low, high = mesh.chart_bounds(number)
    here = np.array([i for i, decal in enumerate(decals) if decal.face == face])
    center, reach = outlines.center_mm[here], outlines.reach_mm()[here]
    least, most = (center - reach).T[..., None], (center + reach).T[..., None]
    near = np.flatnonzero((high[0] >= least[0]) & (low[0] <= most[0]))
    row, triangle = np.divmod(near, len(index))
    near = (high[1].take(triangle) >= least[1, row, 0]) & (low[1].take(triangle) <= most[1, row, 0])
    row, triangle = row[near], triangle[near]
    return here[row], index[triangle], sheet.take(triangle, axis=0)
