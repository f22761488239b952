"""Which triangles of a mesh may be seen in a part of an image, by boxes around runs of them."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.mesh import UNIT_CUBE, Mesh
from fastgen.render.regions import Region
from fastgen.scene.limits import NEAR_M

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
        """The longest list that `seen_in` may give, and each of those that `parted` cuts a run of
        triangles into."""
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

    def parted(
        self, triangles: Sequence[slice], boxes_mm: Sequence[NDArray[np.float64]], margin_mm: float
    ) -> tuple[list[slice], list[slice]]:
        """Those of `triangles` that are far from some boxes, and the others. boxes_mm: corners
        [8, 3] each; margin_mm: how near to one of them is far."""
        met = np.zeros(len(self._low), bool)
        for box in boxes_mm:
            low, high = box.min(axis=0) - margin_mm, box.max(axis=0) + margin_mm
            met |= ((self._low <= high) & (self._high >= low)).all(axis=1)
        near = np.repeat(met, _SIZE)[: self._count]
        asked = np.zeros(self._count, bool)
        for part in triangles:
            asked[part] = True
        return _slices(asked & ~near), _slices(asked & near)

    def _runs(self, shown: NDArray[np.bool_]) -> list[slice]:
        return [
            slice(_SIZE * run.start, min(_SIZE * run.stop, self._count)) for run in _slices(shown)
        ]


def _slices(chosen: NDArray[np.bool_]) -> list[slice]:
    """Where `chosen` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]))).tolist()
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
