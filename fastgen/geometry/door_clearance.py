"""Where locking gear and hinges cover the door's sheet, so that lettering can keep clear."""

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import Mesh

CELL_MM = 10.0
"""Size of the cells of the map."""

_BAR_SHARE = 0.9
"""Least share of the height that gear covers in a column of cells with a locking bar."""

_HIDING = ("bar", "brackets", "cams", "handle", "hinges", "keepers")
_SEAM_MM = 30.0
"""Distance from the middle of the door within which the leaves end."""

_SHIFT = 4
"""Fractional bits of polygon corners."""

_ROWS = 512
"""Sample points of the map from z to sheet y."""


@dataclass(frozen=True, eq=False)
class DoorClearance:
    """Map of the door's sheet.

    Attributes:
        covered: bool [rows, columns], cells of CELL_MM that gear covers seen from the front, or
            that lie between the leaves; row 0 is the lowest.
        bars: Range (x0, x1) of each locking bar in sheet coordinates in mm, from left to right.
    """

    covered: NDArray[np.bool_]
    bars: tuple[tuple[float, float], ...]

    def clear(self, x0: float, y0: float, x1: float, y1: float) -> bool:
        """Test whether no gear covers a rectangle, in mm on the sheet."""
        rows, columns = self.covered.shape
        left, low = max(int(x0 / CELL_MM), 0), max(int(y0 / CELL_MM), 0)
        right = min(math.ceil(x1 / CELL_MM), columns)
        high = min(math.ceil(y1 / CELL_MM), rows)
        if left >= right or low >= high:
            return True
        sums = self._sums
        inside = sums[high][right] - sums[low][right] - sums[high][left] + sums[low][left]
        return bool(inside == 0)

    @cached_property
    def _sums(self) -> list[list[int]]:
        """Covered cells below and left of each cell; lists are faster than arrays to look up."""
        sums: list[list[int]] = np.pad(self.covered.cumsum(0).cumsum(1), ((1, 0), (1, 0))).tolist()
        return sums


def door_clearance(mesh: Mesh) -> DoorClearance:
    """Return the map of a container's door.

    Args:
        mesh: Container at rest.
    """
    rect = mesh.charts[mesh.chart_index("door")].rect_mm
    width, height = rect[2], rect[3]
    up = np.linspace(0.0, height, _ROWS)
    points, _ = mesh.sheet_to_surface("door", np.column_stack([np.full(_ROWS, 1.0), up]))
    left = points[0, 1] - 1.0
    names = [
        chart.name.split(".")[1] if chart.name.startswith("door.") else "" for chart in mesh.charts
    ]
    hiding = np.array([name in _HIDING for name in names])
    triangles = mesh.triangles[hiding[mesh.chart[mesh.triangles[:, 0]]]]
    corners = mesh.positions_mm[triangles].astype(np.float64)
    x = corners[..., 1] - left
    y = np.interp(corners[..., 2], points[:, 2], up)
    cells = np.zeros((int(np.ceil(height / CELL_MM)), int(np.ceil(width / CELL_MM))), np.uint8)
    polygons = np.rint((np.stack([x, y], axis=-1) / CELL_MM - 0.5) * 2**_SHIFT).astype(np.int32)
    for polygon in polygons:
        cv2.fillConvexPoly(cells, polygon, 1, shift=_SHIFT)
    covered = cells.astype(bool)
    bar = covered.mean(axis=0) > _BAR_SHARE
    seam = np.abs((np.arange(covered.shape[1]) + 0.5) * CELL_MM - width / 2) < _SEAM_MM
    covered |= seam
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bar, [False]]).astype(int)))
    bars = tuple((a * CELL_MM, b * CELL_MM) for a, b in edges.reshape(-1, 2).tolist())
    return DoorClearance(covered, bars)
