"""Culling of mesh triangles by bounding boxes around runs of consecutive triangles."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.mesh import UNIT_CUBE, Mesh
from fastgen.render.regions import Region
from fastgen.scene.limits import NEAR_M

_SIZE = 64
"""Triangles in a run. Consecutive triangles of a mesh mostly lie near each other."""

_MARGIN_PX = 2.0
"""Margin around a region, because filters read samples beyond its border."""


class Clusters:
    """Runs of consecutive triangles of a mesh, each with its bounding box."""

    def __init__(self, mesh: Mesh) -> None:
        self._count = len(mesh.triangles)
        first = np.arange(0, self._count, _SIZE)
        corners = mesh.positions_mm[mesh.triangles.ravel()]
        self._low = np.minimum.reduceat(corners, 3 * first)
        self._high = np.maximum.reduceat(corners, 3 * first)

    @staticmethod
    def most_runs(mesh: Mesh) -> int:
        """Return the largest number of slices in a list of `seen_in`.

        The same limit holds for each list that `parted` returns for one slice of triangles.
        """
        return (math.ceil(len(mesh.triangles) / _SIZE) + 1) // 2

    def seen_in(self, view: View, region: Region | None, moved_mm: float) -> list[slice]:
        """Return triangles that include all that are visible in a region of the image.

        Args:
            view: Projection of the image.
            region: Part of the image, or None for the whole image.
            moved_mm: Largest distance that damage moves a vertex.

        Returns:
            Disjoint slices of the mesh's triangles, in ascending order. They cover all triangles
            for the whole image and for views with lens distortion.
        """
        if view.distortion or region is None:
            return [slice(0, self._count)]
        low, high = self._low - moved_mm, self._high + moved_mm
        corners = low[:, None] + UNIT_CUBE * (high - low)[:, None]
        pixels, depth = view.project(corners)
        x, y, width, height = region
        right_of = pixels.max(axis=1) > (x - _MARGIN_PX, y - _MARGIN_PX)
        left_of = pixels.min(axis=1) < (x + width + _MARGIN_PX, y + height + _MARGIN_PX)
        return self._runs((right_of & left_of).all(axis=1) | (depth.min(axis=1) <= NEAR_M))

    def parted(
        self, triangles: Sequence[slice], boxes_mm: Sequence[NDArray[np.float64]], margin_mm: float
    ) -> tuple[list[slice], list[slice]]:
        """Split triangles into those far from all boxes and those that may be near one.

        Args:
            triangles: Slices of the mesh's triangles.
            boxes_mm: Corners [8, 3] of each box in the container frame.
            margin_mm: Triangles at most this far from a box count as near.

        Returns:
            Slices of the far triangles and slices of the near triangles. Together they hold each
            of the given triangles once.
        """
        overlapping = np.zeros(len(self._low), bool)
        for box in boxes_mm:
            low, high = box.min(axis=0) - margin_mm, box.max(axis=0) + margin_mm
            overlapping |= ((self._low <= high) & (self._high >= low)).all(axis=1)
        near = np.repeat(overlapping, _SIZE)[: self._count]
        chosen = np.zeros(self._count, bool)
        for part in triangles:
            chosen[part] = True
        return _slices(chosen & ~near), _slices(chosen & near)

    def _runs(self, shown: NDArray[np.bool_]) -> list[slice]:
        return [
            slice(_SIZE * run.start, min(_SIZE * run.stop, self._count)) for run in _slices(shown)
        ]


def _slices(chosen: NDArray[np.bool_]) -> list[slice]:
    """Return the runs of True values in `chosen`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]))).tolist()
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
