"""The labelled decals of a scene as polygons on the container's surface after damage.

Decals are clipped in sheet coordinates, where their outlines are convex. Their corners and edges in
the world are therefore exact on the triangles that are drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastgen.decals.lettering import PartBox
from fastgen.geometry.damage_law import deform
from fastgen.geometry.decal_outlines import EDGE_POINTS, Outlines
from fastgen.geometry.facets import Facets, clip, padded
from fastgen.geometry.mesh import Mesh
from fastgen.scene import Decal, Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_ON_EDGE = 1e-6
"""Least barycentric weight of a point that certainly lies in a triangle. Points nearer to an edge
may lie on the neighbour, which on the door can be at another depth."""


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Pairs of a decal and a triangle that no side of the decal's outline separates.

    Attributes:
        whose: int [P], index of the decal, ascending.
        triangle: int [P], index into the mesh's triangles.
        sheet_mm: float64 [2, 3, P], x and y of the triangle's corners on the sheet.
        inside: float64 [4, 3, P], signed distances of the corners from the sides of the outline,
            see Outlines.half_planes.
    """

    whose: Ints
    triangle: Ints
    sheet_mm: Array
    inside: Array


class DecalSurface:
    """The labelled decals of a scene on the mesh of its container.

    `facets` (polygons), `outlines_mm` (float64 [N, points, 3]) and `corners_mm` (float64 [N, 4, 3])
    are in mm in the container frame, after damage. They are computed on first use and kept.

    Attributes:
        decals: The decals that have a class name, in scene order.
    """

    def __init__(self, scene: Scene, mesh: Mesh) -> None:
        self.decals = tuple(decal for decal in scene.decals if decal.class_name)
        self._damages = scene.damages
        self._mesh = mesh

    @cached_property
    def facets(self) -> Facets:
        """The decals after damage as polygons; Facets.owner is the index into `decals`."""
        if not self.decals:
            return Facets.of(np.zeros((0, 3, 3)), np.zeros(0, np.int64))
        mesh, pairs = self._mesh, self._pairs
        corners = mesh.positions_mm.take(mesh.triangles.take(pairs.triangle, axis=0), axis=0)
        moved = deform(self._damages, corners)
        whole = (pairs.inside >= 0).all(axis=(0, 1))
        crossed = np.flatnonzero(~whole)
        # positions and the distances from an outline's sides are both linear on a triangle
        inside = pairs.inside.take(crossed, axis=2).T
        cut = np.concatenate([moved.take(crossed, axis=0), inside], axis=2)
        owner = pairs.whose[crossed]
        for side in range(4):
            cut, left = clip(cut, cut[..., 3 + side])
            owner = owner[left]
        owner = np.concatenate([pairs.whose[whole], owner])
        pieces = np.concatenate([padded(moved[whole], cut.shape[1]), cut[..., :3]])
        order = np.argsort(owner, kind="stable")
        return Facets.of(pieces.take(order, axis=0), owner[order])

    @cached_property
    def outlines_mm(self) -> Array:
        """Outlines float64 [N, points, 3] of the decals after damage, clipped to their sheets.

        See Outlines.points_mm.
        """
        if not self.decals:
            return np.zeros((0, 0, 3))
        mesh, pairs = self._mesh, self._pairs
        edges = self._outlines.points_mm()
        for row in self._overhanging:
            edges[row] = _clipped(edges[row], self._sheet_size_mm(row))
        crossed = np.flatnonzero((pairs.inside < 0).any(axis=(0, 1)))
        whose, triangle = pairs.whose[crossed], pairs.triangle[crossed]
        x, y = (along.take(whose, axis=0) for along in (edges[..., 0], edges[..., 1]))
        # barycentric weights are linear on the sheet
        (ax, bx, cx), (ay, by, cy) = pairs.sheet_mm.take(crossed, axis=2)
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
        # points on edges, beyond the sheet's border, or between the door leaves
        lost = np.isnan(rest[..., 0])
        for face in {self.decals[row].face for row in np.flatnonzero(lost.any(axis=1))}:
            off = lost & np.array([decal.face == face for decal in self.decals])[:, None]
            rest[off], _ = mesh.sheet_to_surface(face, edges[off])
        return deform(self._damages, rest)

    @cached_property
    def corners_mm(self) -> Array:
        """Corners float64 [N, 4, 3] of the whole decals after damage, clockwise.

        A corner beyond the sheet lies in the plane of the sheet's border.
        """
        corners = self.outlines_mm[:, ::EDGE_POINTS].copy()
        whole = self._outlines.points_mm()[:, ::EDGE_POINTS] if len(self._overhanging) else corners
        for row in self._overhanging:
            rest, _ = self._mesh.sheet_to_surface(self.decals[row].face, whole[row])
            corners[row] = deform(self._damages, rest)
        return corners[:, ::-1]

    @cached_property
    def parts(self) -> list[tuple[int, PartBox]]:
        """Index into `decals` and box of each labelled part of a text, in scene order."""
        return [
            (row, box)
            for row, decal in enumerate(self.decals)
            if decal.parts
            for box in decal.lettering.parts
            if box.role
        ]

    @cached_property
    def part_corners_mm(self) -> Array:
        """Corners float64 [P, 4, 3] of `parts` after damage, clockwise from the upper left."""
        rest = np.zeros((len(self.parts), 4, 3))
        faces = np.array([self.decals[row].face for row, _ in self.parts])
        sheet = np.zeros((len(self.parts), 4, 2))
        for corners, (row, box) in zip(sheet, self.parts, strict=True):
            decal = self.decals[row]
            local = np.array(
                [[box.x0, box.y1], [box.x1, box.y1], [box.x1, box.y0], [box.x0, box.y0]]
            )
            corners[:] = (local - np.array(decal.size_mm) / 2) @ decal.turn.T + decal.center_mm
        for face in set(faces.tolist()):
            here = faces == face
            points, _ = self._mesh.sheet_to_surface(face, sheet[here].reshape(-1, 2))
            rest[here] = points.reshape(-1, 4, 3)
        return deform(self._damages, rest)

    @cached_property
    def _outlines(self) -> Outlines:
        return Outlines.of(self.decals)

    @cached_property
    def _overhanging(self) -> list[int]:
        """Indices of the decals that reach beyond their sheets."""
        if not self.decals:
            return []
        reach = self._outlines.reach_mm()
        sizes = np.array([self._sheet_size_mm(row) for row in range(len(self.decals))])
        low, high = self._outlines.center_mm - reach, self._outlines.center_mm + reach
        return np.flatnonzero((low < 0).any(axis=1) | (high > sizes).any(axis=1)).tolist()

    def _sheet_size_mm(self, row: int) -> tuple[float, float]:
        *_, width, height = self._mesh.charts[self._mesh.chart_index(self.decals[row].face)].rect_mm
        return width, height

    @cached_property
    def _pairs(self) -> _Pairs:
        outlines = self._outlines
        faces = {decal.face for decal in self.decals}
        found = [_near(self._mesh, face, self.decals, outlines) for face in faces]
        whose, triangle, sheet = (np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.argsort(whose, kind="stable")
        whose, triangle = whose[order], triangle[order]
        x, y = sheet_mm = np.ascontiguousarray(sheet.take(order, axis=0).T)
        normals, offsets = (part.take(whose, axis=0) for part in outlines.half_planes())
        right, down, offset = np.array([*normals.T, offsets.T])[:, :, None]
        inside = right * x + down * y + offset
        touches = np.flatnonzero((inside.max(axis=1) > 0).all(axis=0))
        sheet_mm, inside = sheet_mm.take(touches, axis=2), inside.take(touches, axis=2)
        return _Pairs(whose[touches], triangle[touches], sheet_mm, inside)


def _clipped(outline: Array, size_mm: tuple[float, float]) -> Array:
    """Return an outline [points, 2], clipped to a sheet, with the same number of points."""
    cut = outline[None, ::EDGE_POINTS]
    for axis, sign, offset in ((0, 1, 0), (0, -1, size_mm[0]), (1, 1, 0), (1, -1, size_mm[1])):
        cut, _ = clip(cut, sign * cut[..., axis] + offset)
        if not len(cut):
            return np.clip(outline, 0, size_mm)
    (corners,) = cut
    corners = corners[(corners != np.roll(corners, 1, axis=0)).any(axis=1)]
    share = np.diff(np.arange(len(corners) + 1) * len(outline) // len(corners))
    sides = zip(corners, np.roll(corners, -1, axis=0), share.tolist(), strict=True)
    points = [begin + np.arange(n)[:, None] / n * (end - begin) for begin, end, n in sides]
    return np.concatenate(points)


def _near(
    mesh: Mesh, face: str, decals: Sequence[Decal], outlines: Outlines
) -> tuple[Ints, Ints, Array]:
    """Return pairs of a decal on chart `face` and a triangle near it.

    Returns:
        Indices [P] of decals, indices [P] of triangles, and the triangles' sheet corners [P, 3, 2].
    """
    chart = mesh.sheet(mesh.chart_index(face))
    low, high = chart.lowest_mm, chart.highest_mm
    here = np.array([i for i, decal in enumerate(decals) if decal.face == face])
    center, reach = outlines.center_mm[here], outlines.reach_mm()[here]
    least, most = (center - reach).T[..., None], (center + reach).T[..., None]
    near = np.flatnonzero((high[0] >= least[0]) & (low[0] <= most[0]))
    row, triangle = np.divmod(near, len(chart.triangles))
    near = (high[1].take(triangle) >= least[1, row, 0]) & (low[1].take(triangle) <= most[1, row, 0])
    row, triangle = row[near], triangle[near]
    return here[row], chart.triangles[triangle], chart.corners_mm.take(triangle, axis=0)
