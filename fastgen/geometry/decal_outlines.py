"""Outlines of decals on their sheets: points along them, their sides, how far they reach."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.scene import Decal

Array = NDArray[np.float64]

EDGE_POINTS = 16
"""Points along each side of a decal's outline, which follows the corrugation."""


def _along_edges(corners: ArrayLike) -> Array:
    """Points [EDGE_POINTS * K, 2] along the polygon of `corners` [K, 2]."""
    begin = np.array(corners, np.float64)[:, None]
    steps = np.arange(EDGE_POINTS)[:, None] / EDGE_POINTS
    return (begin + steps * (np.roll(begin, -1, axis=0) - begin)).reshape(-1, 2)


_DIAMOND = _along_edges([[0, -1], [1, 0], [0, 1], [-1, 0]])
_RECTANGLE = _along_edges([[-1, -1], [1, -1], [1, 1], [-1, 1]])

_DIAMOND_SIDES = np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
_RECTANGLE_SIDES = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])


@dataclass(frozen=True, eq=False)
class Outlines:
    """Outlines of N decals: a marker's is the diamond inscribed in its rectangle, others' the
    rectangle itself.

    center_mm, half_mm: float64 [N, 2], centre on the sheet, half of width and height. turn: float64
    [N, 2, 2], as of Decal. diamond: bool [N].
    """

    center_mm: Array
    half_mm: Array
    turn: Array
    diamond: NDArray[np.bool_]

    @staticmethod
    def of(decals: Sequence[Decal]) -> "Outlines":
        """Those of `decals`, in their order."""
        return Outlines(
            np.array([decal.center_mm for decal in decals], np.float64),
            np.array([decal.size_mm for decal in decals], np.float64) / 2,
            np.array([decal.turn for decal in decals]),
            np.array([decal.kind == "marker" for decal in decals]),
        )

    def reach_mm(self) -> Array:
        """How far they reach from their centres along the sheet's axes, [N, 2]."""
        tips = np.abs(self.turn * self.half_mm[:, None])
        return np.where(self.diamond[:, None], tips.max(axis=2), tips.sum(axis=2))

    def half_planes(self) -> tuple[Array, Array]:
        """Their sides: normals [N, 4, 2] and offsets [N, 4], n . p + c >= 0 inside, in no unit."""
        sides = np.where(self.diamond[:, None, None], _DIAMOND_SIDES, _RECTANGLE_SIDES)
        normals = -(sides / self.half_mm[:, None]) @ self.turn.transpose(0, 2, 1)
        return normals, 1 - (normals @ self.center_mm[..., None])[..., 0]

    def points_mm(self) -> Array:
        """Sheet points [N, 4 * EDGE_POINTS, 2] along them.

        They start at the lowest corner of a diamond, the lower left one of a rectangle, and go
        round counter-clockwise from outside.
        """
        edges = np.where(self.diamond[:, None, None], _DIAMOND, _RECTANGLE) * self.half_mm[:, None]
        return np.asarray(edges @ self.turn.transpose(0, 2, 1) + self.center_mm[:, None])
