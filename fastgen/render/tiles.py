"""Square tiles of an image, tiles that bodies touch or fill, and rectangles of sets of tiles."""

from collections.abc import Iterator
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.render.constants import TILE_PX
from fastgen.render.regions import Region, hull_corners

_FEW = 3
"""A body over at most so many tiles keeps all tiles of its rectangle."""

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Tiles:
    """Tiles of TILE_PX pixels a side over an image; the last ones of a row or column may be cut.

    Attributes:
        view: Projection of the image.
        columns_px, rows_px: Borders of the tiles, int [C + 1] and [R + 1].
    """

    def __init__(self, view: View) -> None:
        self.view = view
        self.columns_px, self.rows_px = (
            np.append(np.arange(0, side, TILE_PX), side) for side in view.size
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return len(self.rows_px) - 1, len(self.columns_px) - 1

    @cached_property
    def rays(self) -> Array:
        """Unit view rays [R + 1, C + 1, 3] through the corners of the tiles, in the world."""
        x, y = np.meshgrid(self.columns_px, self.rows_px)
        return self.view.rays(np.stack([x, y], axis=-1))[1]

    @cached_property
    def _plane(self) -> Array:
        """Corners [R + 1, C + 1, 2] in the plane at depth 1 of a pinhole camera."""
        seen = self.rays @ self.view.rotation.T
        plane: Array = seen[..., :2] / seen[..., 2:]
        return plane

    @cached_property
    def _margin(self) -> float:
        """Deviation of the sides of tiles from straight lines in that plane, and half a pixel."""
        bow = max(np.abs(np.diff(self._plane, n=2, axis=axis)).max(initial=0) for axis in (0, 1))
        return float(bow / 8 + 0.5 / self.view.focals_px.min())

    def touched(self, points_mm: Array) -> Mask:
        """Return at least the tiles that the convex hulls of groups of points touch.

        Args:
            points_mm: Points [N, P, 3] in the world; a group in each row.

        Returns:
            bool [N, R, C].
        """
        found = np.zeros((len(points_mm), *self.shape), bool)
        for number, (part, hull) in enumerate(self._hulls(points_mm)):
            found[number][part] = True
            if hull is not None and found[number][part].size > _FEW:
                beyond = _corners(self._beyond(hull, part) > self._margin)
                found[number][part] = ~np.logical_and.reduce(beyond).any(axis=0)
        return found

    def filled(self, points_mm: Array) -> Mask:
        """Return tiles that the convex hulls of groups of points fill; bool [N, R, C].

        Args:
            points_mm: Points [N, P, 3] in the world; a group in each row.
        """
        found = np.zeros((len(points_mm), *self.shape), bool)
        for number, (part, hull) in enumerate(self._hulls(points_mm)):
            if hull is not None:
                beyond = self._beyond(hull, part).max(axis=0)
                found[number][part] = np.logical_and.reduce(_corners(beyond < -self._margin))
        return found

    def _hulls(self, points_mm: Array) -> Iterator[tuple[tuple[slice, slice], Array | None]]:
        """Yield the rows and columns that groups of points may touch, and their hulls.

        A hull is its corners [E, 2] in the plane; None if it is outside the image.
        """
        rectangles, hulls = hull_corners(self.view, points_mm)
        first, last = rectangles[:, :2] // TILE_PX, -(-rectangles[:, 2:] // TILE_PX)
        for (x0, y0), (x1, y1), points in zip(
            first.tolist(), np.maximum(first, last).tolist(), hulls, strict=True
        ):
            hull = None
            if x0 < x1 and y0 < y1:
                hull = cv2.convexHull(points.astype(np.float32))[:, 0].astype(np.float64)
            yield (slice(y0, y1), slice(x0, x1)), hull

    def _beyond(self, hull: Array, part: tuple[slice, slice]) -> Array:
        """Return how far corners of tiles lie outside of each edge of a hull.

        Args:
            hull: Corners [E, 2] in the plane, counter-clockwise if y pointed up.
            part: Rows and columns of tiles.

        Returns:
            Signed distances [E, rows + 1, columns + 1] in the plane.
        """
        # NumPy is slow along short axes
        x, y = hull.T
        right, down = (np.append(side[1:], side[0]) - side for side in (x, y))
        length = np.maximum(np.sqrt(right * right + down * down), 1e-12)
        normal_x, normal_y = down / length, -right / length
        rows, columns = part
        corners = self._plane[rows.start : rows.stop + 1, columns.start : columns.stop + 1]
        offset = normal_x * x + normal_y * y
        distance = np.stack([normal_x, normal_y], 1) @ corners.reshape(-1, 2).T - offset[:, None]
        return np.asarray(distance.reshape(-1, *corners.shape[:2]), np.float64)

    def bounding_region(self, mask: Mask) -> Region:
        """Return the smallest region that contains a set of tiles, at least one."""
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        left, right = self.columns_px[[columns[0], columns[-1] + 1]].tolist()
        top, bottom = self.rows_px[[rows[0], rows[-1] + 1]].tolist()
        return left, top, right - left, bottom - top

    def rectangles(self, mask: Mask) -> NDArray[np.int32]:
        """Return disjoint rectangles that cover a set of tiles.

        Args:
            mask: bool [R, C].

        Returns:
            int32 [N, 4] in pixels: first column and row, and the column and row after the last.
        """
        change = np.diff(mask.astype(np.int8), axis=1, prepend=0, append=0)
        found: list[list[int]] = []
        above: dict[tuple[int, int], list[int]] = {}
        rows, first = np.nonzero(change == 1)
        last = np.nonzero(change == -1)[1]
        row_before, runs = -1, above
        for row, run in zip(
            rows.tolist(), zip(first.tolist(), last.tolist(), strict=True), strict=True
        ):
            if row != row_before:
                above, runs = runs if row == row_before + 1 else {}, {}
                row_before = row
            if run in above:
                above[run][3] = row + 1
                runs[run] = above[run]
            else:
                runs[run] = [run[0], row, run[1], row + 1]
                found.append(runs[run])
        borders = np.array(found, np.int64).reshape(-1, 4)
        pixels = np.empty(borders.shape, np.int32)
        pixels[:, ::2] = self.columns_px[borders[:, ::2]]
        pixels[:, 1::2] = self.rows_px[borders[:, 1::2]]
        return pixels


def bit_masks(which: Mask) -> NDArray[np.uint32]:
    """Return the bit masks of tiles: bit k is set where which[k] is.

    Args:
        which: bool [N, R, C], N up to 64.

    Returns:
        uint32 [R, C, 2], low word first.
    """
    bits = np.zeros((64, *which.shape[1:]), bool)
    bits[: len(which)] = which
    packed = np.packbits(bits, axis=0, bitorder="little")
    return np.moveaxis(packed, 0, -1).copy().view("<u4").astype(np.uint32)


def _corners(values: NDArray[np.bool_]) -> tuple[Mask, Mask, Mask, Mask]:
    """Return the values at the four corners of all tiles."""
    up, down = values[..., :-1, :], values[..., 1:, :]
    return up[..., :-1], up[..., 1:], down[..., :-1], down[..., 1:]
