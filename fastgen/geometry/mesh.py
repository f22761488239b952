"""A triangle mesh with one atlas in millimetres, and the way from a sheet point to the surface.

Container frame: right-handed, z up, origin at the centre of the footprint, z = 0 at the bottom of
the bottom castings, +x the door end.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.errors import ConfigError
from fastgen.files import disk_cache
from fastgen.geometry.distinct_rows import distinct_rows
from fastgen.scene.faces import FACES, SHEET_FACES

MATERIALS = (
    *("paint_sheet", "paint_frame", "casting", "galvanized", "rubber", "underside"),
    *("spreader", "cable"),
)

UNIT_CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
"""Corners of a cube from 0 to 1, int [8, 3]."""

_UNIT_CUBE_FACES = ("013 032", "467 475", "045 051", "237 276", "026 064", "157 173")
UNIT_CUBE_TRIANGLES = np.array(
    [[int(corner) for corner in three] for face in _UNIT_CUBE_FACES for three in face.split()],
    np.uint32,
)
"""Its faces, uint32 [12, 3], counter-clockwise from outside."""

MAX_ZONES = 500
"""Of one mesh: the renderer keeps zone + 1 of a container and of its spreader in ten bits."""

GROUP_SLACK_MM = 12.0
"""A face's frame stands back from the castings' plane by at most this much, see Mesh.groups."""


@dataclass(frozen=True)
class Chart:
    """One part's piece of the atlas.

    face: the side of the container that it belongs to. rect_mm: x0, y0, width, height in the
    atlas. Coordinates relative to (x0, y0) are called sheet mm.
    """

    name: str
    face: str
    material: str
    rect_mm: tuple[float, float, float, float]

    @property
    def material_index(self) -> int:
        """Position of the material in MATERIALS."""
        return MATERIALS.index(self.material)


@dataclass(frozen=True)
class Zone:
    """A part of a chart that wears by itself, such as one side of a beam.

    chart: index into Mesh.charts. rect_mm: x0, y0, width, height in the atlas. quarter_turns: from
    the atlas's +y clockwise to what is up in the world; 0 where the part lies flat. small: whether
    it is pieces all of which are narrow, wherever there was room for them in the chart. level:
    whether it lies flat, and water does not run down it.
    """

    chart: int
    rect_mm: tuple[float, float, float, float]
    quarter_turns: int
    small: bool
    level: bool


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles counter-clockwise from outside, flat normals, vertices split at creases.

    positions_mm: float32 [V, 3]. normals: float32 [V, 3], unit. atlas_mm: float32 [V, 2].
    zone: uint16 [V], index into zones, the largest of each chart first. triangles: uint32 [T, 3].
    atlas_size_mm: width, height.

    groups: range of triangles of each face, and of "frame". A triangle of face F is never the
    first hit of a ray from a point outside the container's outer box unless that point lies in
    front of F's plane of the box moved inward by GROUP_SLACK_MM. What cannot promise that is in
    "frame".

    flats: sheet coordinates (start, end) in mm of the outermost flats of each corrugated face, in
    ascending order: along sheet x, for the door along sheet y.
    """

    positions_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    atlas_mm: NDArray[np.float32]
    zone: NDArray[np.uint16]
    triangles: NDArray[np.uint32]
    charts: tuple[Chart, ...]
    zones: tuple[Zone, ...]
    atlas_size_mm: tuple[float, float]
    groups: Mapping[str, slice]
    flats: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    @cached_property
    def chart(self) -> NDArray[np.uint16]:
        """Index [V] into charts."""
        return np.array([zone.chart for zone in self.zones], np.uint16)[self.zone]

    def chart_index(self, name: str) -> int:
        """Number of the chart called `name`. Raises ConfigError for an unknown one."""
        try:
            return self._numbers[name]
        except KeyError:
            raise ConfigError(
                f"chart {name!r}: no such part of the container; panels are {', '.join(FACES)}"
            ) from None

    def chart_triangles(self, number: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Numbers [T] of the triangles of chart `number`, and their sheet corners [T, 3, 2]."""
        return self._of_chart[number]

    def chart_bounds(self, number: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and greatest sheet coordinates [2, T] of each triangle of chart `number`."""
        if number not in self._bounds:
            corners = self.chart_triangles(number)[1].transpose(2, 1, 0)
            self._bounds[number] = corners.min(axis=1), corners.max(axis=1)
        return self._bounds[number]

    def sheet_to_surface(
        self, chart_name: str, sheet_mm: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions [K, 3] in mm and unit normals [K, 3] of the sheet points [K, 2] of a chart.

        A point on the border of two facets gets either one's normal. A point off the chart's
        triangles (beyond the border, or in the gap between the door leaves) lies in the plane of
        the triangle it is least far outside of. Raises ConfigError for an unknown chart.
        """
        number = self.chart_index(chart_name)
        points = np.asarray(sheet_mm, np.float64).reshape(-1, 2)
        triangle, weights = self._locator(number).find(points)
        corners = self.triangles[triangle]
        positions = np.einsum("kc,kcd->kd", weights, self.positions_mm[corners].astype(np.float64))
        normals = self.normals[corners[:, 0]].astype(np.float64)
        return positions, normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def preload(self, damages: bool) -> None:
        """Compute now what labels ask of the faces, and damages of triangles; it is kept."""
        for face in SHEET_FACES:
            number = self.chart_index(face)
            self.chart_bounds(number)
            self._locator(number)
        if damages:
            _ = self.triangle_bounds_mm

    @cached_property
    def bounds_mm(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates [3] of all vertices."""
        return self.positions_mm.min(axis=0), self.positions_mm.max(axis=0)

    @cached_property
    def triangle_bounds_mm(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates [T, 3] of each triangle."""
        a, b, c = self.positions_mm[self.triangles].transpose(1, 0, 2)
        return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)

    @cached_property
    def points_mm(self) -> NDArray[np.float64]:
        """Positions [P, 3] of all vertices, those that coincide only once."""
        first, _ = distinct_rows(self.positions_mm)
        return self.positions_mm[first].astype(np.float64)

    @cached_property
    def hull(self) -> NDArray[np.int64]:
        """Which of points_mm are corners of their convex hull."""

        def found() -> dict[str, NDArray[np.int64]]:
            from scipy.spatial import ConvexHull  # takes 0.3 s, and hulls are kept on disk

            return {"hull": np.asarray(ConvexHull(self.points_mm).vertices, np.int64)}

        return disk_cache.computed("hull", self.shape_digest, found)["hull"]

    @cached_property
    def shape_digest(self) -> str:
        """SHA-256, in hexadecimal, of positions, normals and triangles."""
        arrays = (self.positions_mm, self.normals, self.triangles)
        return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {chart.name: i for i, chart in enumerate(self.charts)}

    @cached_property
    def _of_chart(self) -> list[tuple[NDArray[np.int64], NDArray[np.float64]]]:
        of_triangle = self.chart[self.triangles[:, 0]]
        found = []
        for number, chart in enumerate(self.charts):
            index = np.flatnonzero(of_triangle == number)
            corners = self.atlas_mm[self.triangles[index]].astype(np.float64)
            found.append((index, corners - chart.rect_mm[:2]))
        return found

    @cached_property
    def _bounds(self) -> dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        return {}

    def _locator(self, number: int) -> "_Locator":
        if number not in self._locators:
            self._locators[number] = _Locator.of(self, number)
        return self._locators[number]

    @cached_property
    def _locators(self) -> dict[int, "_Locator"]:
        return {}


_CELL_MM = 120.0


@dataclass(frozen=True, eq=False)
class _Locator:
    """Point location in one chart: each cell of a grid lists the triangles that touch it.

    candidates: int32 [cells, M] into triangles, -1 where there are fewer. to_weights: float
    [N, 2, 3], (x, y, 1) to the weights of a triangle's second and third corner.
    """

    triangles: NDArray[np.int64]
    to_weights: NDArray[np.float64]
    candidates: NDArray[np.int32]
    shape: tuple[int, int]

    @staticmethod
    def of(mesh: Mesh, number: int) -> "_Locator":
        width, height = mesh.charts[number].rect_mm[2:]
        triangles, corners = mesh.chart_triangles(number)
        a, b, c = corners.transpose(1, 0, 2)
        inverse = np.linalg.inv(np.stack([b - a, c - a], axis=2))
        to_weights = np.concatenate([inverse, -(inverse @ a[:, :, None])], axis=2)
        columns, rows = (max(int(np.ceil(side / _CELL_MM)), 1) for side in (width, height))
        limit = (columns - 1, rows - 1)
        low = np.clip((corners.min(axis=1) - 1e-3) // _CELL_MM, 0, limit).astype(int)
        high = np.clip((corners.max(axis=1) + 1e-3) // _CELL_MM, 0, limit).astype(int)
        wide, tall = (high - low + 1).T
        touched = wide * tall
        triangle = np.repeat(np.arange(len(low)), touched)
        step = np.arange(len(triangle)) - np.repeat(np.cumsum(touched) - touched, touched)
        row, column = np.divmod(step, wide[triangle])
        cell = (low[triangle, 1] + row) * columns + low[triangle, 0] + column
        order = np.argsort(cell, kind="stable")
        count = np.bincount(cell, minlength=columns * rows)
        place = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
        candidates = np.full((columns * rows, count.max()), -1, np.int32)
        candidates[cell[order], place] = triangle[order]
        return _Locator(triangles, to_weights, candidates, (columns, rows))

    def find(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Triangle numbers [K] in the mesh and corner weights [K, 3] of sheet points [K, 2]."""
        limit = np.array(self.shape) - 1
        cells = np.clip(points // _CELL_MM, 0, limit).astype(int)
        listed = self.candidates[cells[:, 1] * self.shape[0] + cells[:, 0]]
        best, inside = self._best(points, listed)
        lost = np.flatnonzero(inside < -1e-3)
        if lost.size:
            everything = np.broadcast_to(
                np.arange(len(self.triangles)), (lost.size, len(self.triangles))
            )
            best[lost], _ = self._best(points[lost], everything)
        return self.triangles[best], np.stack(self._weights(points, best), axis=-1)

    def _best(
        self, points: NDArray[np.float64], listed: NDArray[np.integer]
    ) -> tuple[NDArray[np.integer], NDArray[np.float64]]:
        """The listed triangle that each point is most inside of, and its least weight there."""
        least = reduce(np.minimum, self._weights(points[:, None], listed))
        least[listed < 0] = -np.inf
        chosen = least.argmax(axis=1)
        rows = np.arange(len(points))
        return listed[rows, chosen], least[rows, chosen]

    def _weights(
        self, points: NDArray[np.float64], triangle: NDArray[np.integer]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        x, y = points[..., 0], points[..., 1]
        second, third = (
            row[triangle, 0] * x + row[triangle, 1] * y + row[triangle, 2]
            for row in self.to_weights.transpose(1, 0, 2)
        )
        return 1 - (second + third), second, third
