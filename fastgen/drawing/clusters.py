"""Which triangles of a mesh may be seen in a part of an image, by boxes around runs of them."""

import math

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import NEAR_M, View
from fastgen.drawing.regions import Region
from fastgen.geometry.mesh import UNIT_CUBE, Mesh

_SIZE = 64
"""Triangles in a run. Neighbours in the order of a mesh mostly are neighbours on its sheets."""

_MARGIN_PX = 2.0
"""Filters read samples beyond a region's border."""


class Clusters:
    """Runs of a mesh's triangles, each with the box around it."""

    def __init__(self, mesh: Mesh) -> None:
        self._count = len(mesh.triangles)
        first = np.arange(0, self._count, _SIZE)
        corners = mesh.positions_mm[mesh.triangles.ravel()]
        self._low = np.minimum.reduceat(corners, 3 * first)
        self._high = np.maximum.reduceat(corners, 3 * first)

    @staticmethod
    def most_runs(mesh: Mesh) -> int:
        """The longest list that `seen_in` may give."""
        return (math.ceil(len(mesh.triangles) / _SIZE) + 1) // 2

    def seen_in(self, view: View, region: Region | None, moved_mm: float) -> list[slice]:
        """Triangles, as slices of their array, among them all that `region` of the image shows.

        None is the whole image. moved_mm: by how much damage may have moved a vertex. With a lens,
        and for the whole image, that is all triangles.
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

    def _runs(self, shown: NDArray[np.bool_]) -> list[slice]:
        edges = np.flatnonzero(np.diff(np.concatenate([[False], shown, [False]]))) * _SIZE
        ends = np.minimum(edges[1::2], self._count)
        return [slice(int(a), int(b)) for a, b in zip(edges[::2], ends, strict=True)]
