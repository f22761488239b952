"""Outlines of decals on their sheets: points, sides and extents."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.scene import Decal

Array = NDArray[np.float64]

EDGE_POINTS = 16
"""Points along each side of an outline, which follows the corrugation."""


def _along_edges(corners: ArrayLike) -> Array:
    """Return points [EDGE_POINTS * K, 2] along the polygon of `corners` [K, 2]."""
    begin = np.array(corners, np.float64)[:, None]
    steps = np.arange(EDGE_POINTS)[:, None] / EDGE_POINTS
    return (begin + steps * (np.roll(begin, -1, axis=0) - begin)).reshape(-1, 2)


_DIAMOND = _along_edges([[0, -1], [1, 0], [0, 1], [-1, 0]])
_RECTANGLE = _along_edges([[-1, -1], [1, -1], [1, 1], [-1, 1]])

_DIAMOND_SIDES = np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
_RECTANGLE_SIDES = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])


@dataclass(frozen=True, eq=False)
class Outlines:
    """Outlines of N decals in sheet coordinates.

    The outline of a marker is the diamond inscribed in its rectangle. All others are rectangles.

    Attributes:
        center_mm: float64 [N, 2].
        half_mm: float64 [N, 2], half of width and height.
        turn: float64 [N, 2, 2], rotations, see Decal.turn.
        diamond: bool [N].
    """

    center_mm: Array
    half_mm: Array
    turn: Array
    diamond: NDArray[np.bool_]

    @staticmethod
    def of(decals: Sequence[Decal]) -> "Outlines":
        """Return the outlines of decals, in the same order."""
        return Outlines(
            np.array([decal.center_mm for decal in decals], np.float64),
            np.array([decal.size_mm for decal in decals], np.float64) / 2,
            np.array([decal.turn for decal in decals]),
            np.array([decal.kind == "marker" for decal in decals]),
        )

    def reach_mm(self) -> Array:
        """Return the largest distances [N, 2] from the centres along the sheet's axes, in mm."""
        tips = np.abs(self.turn * self.half_mm[:, None])
        reach: Array = np.where(self.diamond[:, None], tips.max(axis=2), tips.sum(axis=2))
        return reach

    def half_planes(self) -> tuple[Array, Array]:
        """Return the sides: normals n [N, 4, 2] in 1/mm and offsets c [N, 4].

        Points p inside have n . p + c >= 0 for all sides.
        """
        sides = np.where(self.diamond[:, None, None], _DIAMOND_SIDES, _RECTANGLE_SIDES)
        normals = -(sides / self.half_mm[:, None]) @ self.turn.transpose(0, 2, 1)
        return normals, 1 - (normals @ self.center_mm[..., None])[..., 0]

    def points_mm(self) -> Array:
        """Return sheet points [N, 4 * EDGE_POINTS, 2] along the outlines.

        They begin at the lowest corner of a diamond or the lower left corner of a rectangle and run
        counter-clockwise seen from outside.
        """
        edges = np.where(self.diamond[:, None, None], _DIAMOND, _RECTANGLE) * self.half_mm[:, None]
        return np.asarray(edges @ self.turn.transpose(0, 2, 1) + self.center_mm[:, None])
