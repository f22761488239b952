"""The triangles of one chart on its unfolded sheet, and point location among them."""

from dataclasses import dataclass
from functools import reduce
from typing import Self

import numpy as np
from numpy.typing import NDArray

VERSION = 1  # raise when the stored arrays change

LAYOUT = {
    "triangles": "int64 T",
    "corners_mm": "float64 T 3 2",
    "lowest_mm": "float64 2 T",
    "highest_mm": "float64 2 T",
    "to_weights": "float64 T 2 3",
    "candidates": "int32 C M",
    "shape": "int64 2",
}
"""Layout of the fields of a ChartSheet in the disk cache."""

_CELL_MM = 120.0


@dataclass(frozen=True, eq=False)
class ChartSheet:
    """The triangles of one chart in sheet coordinates, with a grid to locate points among them.

    Attributes:
        triangles: int [T], indices of the chart's triangles in the mesh.
        corners_mm: float64 [T, 3, 2], their corners in sheet coordinates.
        lowest_mm: float64 [2, T], lowest sheet coordinates of each triangle.
        highest_mm: float64 [2, T], highest sheet coordinates of each triangle.
        to_weights: float64 [T, 2, 3], matrices from (x, y, 1) to the barycentric weights of a
            triangle's second and third corner.
        candidates: int32 [cells, M], triangles that touch each cell of the grid, padded with -1.
        shape: int [2], columns and rows of the grid.
    """

    triangles: NDArray[np.int64]
    corners_mm: NDArray[np.float64]
    lowest_mm: NDArray[np.float64]
    highest_mm: NDArray[np.float64]
    to_weights: NDArray[np.float64]
    candidates: NDArray[np.int32]
    shape: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        triangles: NDArray[np.int64],
        corners_mm: NDArray[np.float64],
        size_mm: tuple[float, float],
    ) -> Self:
        """Return the sheet of a chart with (width, height) = size_mm."""
        a, b, c = corners_mm.transpose(1, 0, 2)
        inverse = np.linalg.inv(np.stack([b - a, c - a], axis=2))
        to_weights = np.concatenate([inverse, -(inverse @ a[:, :, None])], axis=2)
        columns, rows = (max(int(np.ceil(side / _CELL_MM)), 1) for side in size_mm)
        limit = (columns - 1, rows - 1)
        low = np.clip((corners_mm.min(axis=1) - 1e-3) // _CELL_MM, 0, limit).astype(int)
        high = np.clip((corners_mm.max(axis=1) + 1e-3) // _CELL_MM, 0, limit).astype(int)
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
        by_axis = corners_mm.transpose(2, 1, 0)
        return cls(
            triangles,
            corners_mm,
            by_axis.min(axis=1),
            by_axis.max(axis=1),
            to_weights,
            candidates,
            np.array([columns, rows]),
        )

    def find(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Locate sheet points [K, 2] in mm.

        Returns:
            Indices [K] of triangles in the mesh, and barycentric weights [K, 3] of their corners.
            A point outside all triangles gets the triangle that it is least far outside of.
        """
        cells = np.clip(points // _CELL_MM, 0, self.shape - 1).astype(int)
        listed = self.candidates[cells[:, 1] * self.shape[0] + cells[:, 0]]
        best, inside = self._best(points, listed)
        lost = np.flatnonzero(inside < -1e-3)
        if lost.size:
            count = len(self.to_weights)
            everything = np.broadcast_to(np.arange(count), (lost.size, count))
            best[lost], _ = self._best(points[lost], everything)
        return self.triangles[best], np.stack(self._weights(points, best), axis=-1)

    def _best(
        self, points: NDArray[np.float64], listed: NDArray[np.integer]
    ) -> tuple[NDArray[np.integer], NDArray[np.float64]]:
        """Return the listed triangle whose least weight is greatest for each point, and it."""
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
