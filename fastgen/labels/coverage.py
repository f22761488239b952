"""What objects would cover alone in an unbounded image: exact boxes, and pixels by scan conversion.

A pixel is covered when its centre lies in one of the object's facets that face the camera; centres
on an edge go to one side only, as rasterizers have it (OpenGL 4.5 core specification, 14.6.1).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.facets import Facets
from fastgen.sample import Box
from fastgen.scene.limits import NEAR_M

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Runs = tuple[Ints, Ints, Ints, Ints]
"""Runs of pixels, int [R] each: whose they are, row, first column, and the one past the last."""

_MOST_ROWS = 100_000
"""Objects that cross more rows than this are counted on a coarser grid, to a thousandth."""


@dataclass(frozen=True, eq=False)
class Covered:
    """Pixels that each of some objects covers alone.

    within: runs of those in the image, `width` pixels across, each object's once, ascending by
    owner, row and column. beyond: int [count], how many more each object covers outside the image.
    """

    within: Runs
    width: int
    beyond: Ints

    @property
    def area(self) -> Ints:
        """How many pixels of each object are within, int [count]."""
        return _lengths(self.within, len(self.beyond))

    def pixels(self) -> tuple[Ints, Ints]:
        """Of each pixel within, row * width + column and whose it is, int [P] each."""
        whose, row, left, right = self.within
        length = right - left
        before = length.cumsum() - length
        pixel = (row * self.width + left - before).repeat(length)
        pixel += np.arange(len(pixel))
        return pixel, whose.repeat(length)

    def shown(self, mask: NDArray[np.bool_]) -> Ints:
        """How many of each object's pixels `mask` [H, W] shows, int [count]."""
        whose, row, left, right = self.within
        if not len(row):
            return np.zeros(len(self.beyond), np.int64)
        x0, y0, x1, y1 = left.min(), row.min(), right.max(), row.max() + 1
        # how many pixels are shown above and to the left of each corner between pixels
        shown = cv2.integral(mask[y0:y1, x0:x1].view(np.uint8))
        counts = (shown[1:] - shown[:-1]).ravel()
        start = (row - y0) * shown.shape[1] - x0
        found = counts.take(start + right) - counts.take(start + left)
        return np.bincount(whose, found, len(self.beyond)).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Projected:
    """Facets in the image. pixels: float64 [P, 2] and depth_m: [P], of their points."""

    facets: Facets
    pixels: Array
    depth_m: Array

    @property
    def polygons(self) -> Array:
        """Corners in pixels, float64 [K, M, 2]."""
        return self.pixels.take(self.facets.corners, axis=0)


def project(facets: Facets, view: View) -> Projected:
    """The part of the facets beyond the near plane, as `view` sees it."""
    pixels, depth = view.project(facets.points_mm)
    if depth.size and depth.min() < NEAR_M:
        facets = facets.beyond(depth - NEAR_M)
        pixels, depth = view.project(facets.points_mm)
    return Projected(facets, pixels, depth)


def facing(polygons: Array) -> NDArray[np.bool_]:
    """Which of polygons [K, M, 2] in the image, counter-clockwise from outside, face the camera."""
    x, y = polygons[..., 0], polygons[..., 1]
    most = range(polygons.shape[1])
    area = sum((x[:, k - 1] * y[:, k] - x[:, k] * y[:, k - 1] for k in most), np.zeros(len(x)))
    # they turn the other way where y points down
    return np.asarray(area < 0)


def boxes(pixels: Array, owner: Ints, count: int) -> Array:
    """Exact bounds (x0, y0, x1, y1) float64 [count, 4] of each owner's points [P, 2].

    owner: int [P], ascending. One without points gets (inf, inf, -inf, -inf).
    """
    found = np.tile([np.inf, np.inf, -np.inf, -np.inf], (count, 1))
    if len(owner):
        first = np.append(0, np.flatnonzero(owner[1:] != owner[:-1]) + 1)
        present = owner[first]
        found[present, :2] = np.minimum.reduceat(pixels, first)
        found[present, 2:] = np.maximum.reduceat(pixels, first)
    return found


def covered(
    polygons: Array,
    owner: Ints,
    count: int,
    size: tuple[int, int],
    asked: Box | None = None,
) -> Covered:
    """What each owner's polygons [K, M, 2] cover, their union, in an image of `size`.

    owner: int [K]. asked: the part of the image whose pixels are asked for; all of it by default.
    """
    width, height = size
    rows = np.ptp(polygons[..., 1]) if polygons.size else 0.0
    step = max(int(np.ceil(rows / _MOST_ROWS)), 1)
    if step > 1:  # of something enormous the image sees a small part, which is counted as it is
        whole = _lengths(_merged(spans(polygons / step), owner), count) * step**2
        runs = _merged(spans(polygons, height), owner)
    else:
        runs = _merged(spans(polygons), owner)
        whole = _lengths(runs, count)
    within = _inside(runs, (0, 0, width, height))
    beyond = np.maximum(whole - _lengths(within, count), 0)
    return Covered(within if asked is None else _inside(within, asked), width, beyond)


def _merged(runs: Runs, owner: Ints) -> Runs:
    """Each owner's runs where polygons have some, the union of them, ascending."""
    polygon, row, left, right = runs
    if not len(row):
        return runs
    # one long line of all rows of all owners, with a pixel between them that none has
    low, top = int(left.min()), int(row.min())
    width, height = int(right.max()) - low + 1, int(row.max()) - top + 1
    line = (owner.take(polygon) * height + (row - top)) * width - low
    start, end = line + left, line + right
    if end.max() < 2**31:  # they are sorted in half the time
        start, end = start.astype(np.int32), end.astype(np.int32)
    start.sort()
    end.sort()
    # as many have ended as have begun: a gap follows
    gap = np.flatnonzero(start[1:] > end[:-1])
    start, end = start[np.append(0, gap + 1)], end[np.append(gap, len(end) - 1)]
    line = start.astype(np.int64) // width
    whose = line // height
    back = low - line * width
    return whose, line - whose * height + top, start + back, end + back


def _inside(runs: Runs, box: Box) -> Runs:
    """What of `runs` lies inside a box."""
    x0, y0, x1, y1 = box
    whose, row, left, right = runs
    left, right = np.maximum(left, x0), np.minimum(right, x1)
    some = np.flatnonzero((left < right) & (row >= y0) & (row < y1))
    if len(some) == len(row):
        return whose, row, left, right
    return whose[some], row[some], left[some], right[some]


def _lengths(runs: Runs, count: int) -> Ints:
    """Pixels in each object's runs, int [count]."""
    whose, _, left, right = runs
    return np.bincount(whose, right - left, count).astype(np.int64)


def spans(polygons: Array, rows: int | None = None) -> Runs:
    """Runs of pixel centres in convex polygons [K, M, 2], one for each polygon and row.

    Those of no pixel are left out. rows: only rows from 0 up to this one.
    """
    number, most = polygons.shape[:2]
    # all first corners, all second ones and so on: NumPy is slow along short axes
    x, y = polygons.transpose(2, 1, 0).reshape(2, -1)
    # the first row whose centres a corner is not below
    first = np.ceil(y - 0.5).astype(np.int64)
    if rows is not None:
        first = first.clip(0, rows)
    by_corner = first.reshape(most, number)
    top = by_corner.min(axis=0)
    height = by_corner.max(axis=0) - top
    start = height.cumsum() - height
    # of a convex polygon one edge crosses a row on its way down the image, and one on its way up
    climb = np.append(first[number:], first[:number]) - first
    edge = np.flatnonzero(climb)
    until, climb, whose = (edge + number) % len(first), climb[edge], edge % number
    length, rises = np.abs(climb), climb < 0
    begin = first[np.where(rises, until, edge)]
    at_x, at_y = x[edge], y[edge]
    slope = (x[until] - at_x) / (y[until] - at_y)
    at_begin = at_x + (begin + 0.5 - at_y) * slope
    count = int(height.sum())
    place = start[whose] + begin - top[whose] + rises * count
    before = length.cumsum() - length
    crossing = np.arange(int(length.sum()))
    # whole numbers as floats, which lose nothing: NumPy is slow to turn them into each other
    step = (crossing - before.repeat(length)).astype(np.float64)
    columns = np.empty(2 * count)
    # the first column whose centre a crossing is not right of
    columns[(place - before).repeat(length) + crossing] = np.ceil(
        (at_begin - 0.5).repeat(length) + step * slope.repeat(length)
    )
    falling, rising = columns[:count], columns[count:]
    left, right = np.minimum(falling, rising), np.maximum(falling, rising)
    some = np.flatnonzero(right > left)
    polygon = np.arange(number).repeat(height).take(some)
    row = some + (top - start).take(polygon)
    return polygon, row, left.take(some).astype(np.int64), right.take(some).astype(np.int64)
