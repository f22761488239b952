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


_KINDS = ("marker", "triangle")
"""Kinds of decals that have an outline of their own; all others are rectangles."""

_EDGES = np.array(
    [
        _along_edges([[-1, -1], [1, -1], [1, 1], [-1, 1]]),
        _along_edges([[0, -1], [1, 0], [0, 1], [-1, 0]]),
        _along_edges([[-1, -1], [1, -1], [0, 1], [0, 1]]),
    ]
)
"""Points along a rectangle, a diamond and a triangle, whose fourth side has no length."""

_SIDES = np.array(
    [
        [[1.0, 0], [0, 1], [-1, 0], [0, -1]],
        [[1, 1], [-1, 1], [-1, -1], [1, -1]],
        [[2, 1], [-2, 1], [0, -1], [0, -1]],
    ]
)
"""Normals n of the sides of the same shapes: points p inside have n . p <= 1."""


@dataclass(frozen=True, eq=False)
class Outlines:
    """Outlines of N decals in sheet coordinates.

    The outline of a marker is the diamond inscribed in its rectangle. That of a triangle has the
    lower corners of its rectangle, and the middle of its upper side. All others are rectangles.

    Attributes:
        center_mm: float64 [N, 2].
        half_mm: float64 [N, 2], half of width and height.
        turn: float64 [N, 2, 2], rotations, see Decal.turn.
        shape: int [N], 0 for a rectangle, 1 for a diamond, 2 for a triangle.
    """

    center_mm: Array
    half_mm: Array
    turn: Array
    shape: NDArray[np.int64]

    @staticmethod
    def of(decals: Sequence[Decal]) -> "Outlines":
        """Return the outlines of decals, in the same order."""
        return Outlines(
            np.array([decal.center_mm for decal in decals], np.float64),
            np.array([decal.size_mm for decal in decals], np.float64) / 2,
            np.array([decal.turn for decal in decals]),
            np.array([("", *_KINDS).index(d.kind) if d.kind in _KINDS else 0 for d in decals]),
        )

    def reach_mm(self) -> Array:
        """Return the largest distances [N, 2] from the centres along the sheet's axes, in mm."""
        tips = np.abs(self.turn * self.half_mm[:, None])
        reach: Array = np.where(self.shape[:, None] == 1, tips.max(axis=2), tips.sum(axis=2))
        return reach

    def half_planes(self) -> tuple[Array, Array]:
        """Return the sides: normals n [N, 4, 2] in 1/mm and offsets c [N, 4].

        Points p inside have n . p + c >= 0 for all sides.
        """
        normals = -(_SIDES[self.shape] / self.half_mm[:, None]) @ self.turn.transpose(0, 2, 1)
        return normals, 1 - (normals @ self.center_mm[..., None])[..., 0]

    def points_mm(self) -> Array:
        """Return sheet points [N, 4 * EDGE_POINTS, 2] along the outlines.

        They begin at the lowest corner of a diamond or the lower left corner of another shape and
        run counter-clockwise seen from outside.
        """
        edges = _EDGES[self.shape] * self.half_mm[:, None]
        return np.asarray(edges @ self.turn.transpose(0, 2, 1) + self.center_mm[:, None])
