"""Pixels that objects cover alone in an unbounded image, and their exact boxes.

A pixel is covered if its centre lies in one of the object's facets that face the camera. A centre
on an edge belongs to one side only, as in rasterizers (OpenGL 4.5 core specification, 14.6.1).
"""

from dataclasses import dataclass, replace

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
"""Runs of pixels, int [R] each: owner, row, first column, and the column after the last."""

_MOST_ROWS = 2000
"""Objects over more rows than this are counted on a coarser grid, accurate to a thousandth."""


@dataclass(frozen=True, eq=False)
class Covered:
    """Pixels that each of several objects covers alone.

    Attributes:
        within: Runs of pixels in the image, ascending by owner, row and column. The runs of one
            object do not overlap.
        width: Width of the image in pixels.
        beyond: int [count], number of pixels that each object covers outside the image.
    """

    within: Runs
    width: int
    beyond: Ints

    @property
    def area(self) -> Ints:
        """Number of pixels of each object in the image, int [count]."""
        return _lengths(self.within, len(self.beyond))

    def pixels(self) -> tuple[Ints, Ints]:
        """Return row * width + column and the owner of each pixel in the image, int [P] each."""
        whose, row, left, right = self.within
        length = right - left
        before = length.cumsum() - length
        pixel = (row * self.width + left - before).repeat(length)
        pixel += np.arange(len(pixel))
        return pixel, whose.repeat(length)

    def shown(self, mask: NDArray[np.bool_]) -> Ints:
        """Count the pixels of each object in a mask [H, W]; int [count]."""
        whose, row, left, right = self.within
        if not len(row):
            return np.zeros(len(self.beyond), np.int64)
        x0, y0, x1, y1 = left.min(), row.min(), right.max(), row.max() + 1
        # number of mask pixels above and to the left of each pixel corner
        shown = cv2.integral(mask[y0:y1, x0:x1].view(np.uint8))
        counts = (shown[1:] - shown[:-1]).ravel()
        start = (row - y0) * shown.shape[1] - x0
        found = counts.take(start + right) - counts.take(start + left)
        return np.bincount(whose, found, len(self.beyond)).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Projected:
    """Facets in the image.

    Attributes:
        facets: The facets in the world.
        pixels: float64 [P, 2], image positions of their points.
        depth_m: float64 [P], depths of their points.
    """

    facets: Facets
    pixels: Array
    depth_m: Array

    @property
    def polygons(self) -> Array:
        """Corners in pixels, float64 [K, M, 2]."""
        return self.pixels.take(self.facets.corners, axis=0)


def project(facets: Facets, view: View) -> Projected:
    """Project the part of the facets beyond the near plane."""
    pixels, depth = view.project(facets.points_mm)
    if depth.size and depth.min() < NEAR_M:
        facets = facets.beyond(depth - NEAR_M)
        pixels, depth = view.project(facets.points_mm)
    return Projected(facets, pixels, depth)


def pixels_beyond(facets: Facets, view: View) -> Array:
    """Return image positions [P, 2] of all corners of the part of facets beyond the near plane."""
    distance = view.to_view(facets.points_mm)[:, 2] - NEAR_M
    pixels, _ = view.project(facets.points_mm.compress(distance >= 0, axis=0))
    # NumPy is slow along short axes
    before = [(distance < 0).take(corner) for corner in facets.corners.T]
    crossing = np.logical_or.reduce(before) & ~np.logical_and.reduce(before)
    cut = replace(facets, corners=facets.corners.compress(crossing, axis=0)).beyond(distance)
    more, _ = view.project(cut.points_mm)
    return np.concatenate([pixels, more])


def facing(polygons: Array) -> NDArray[np.bool_]:
    """Test which polygons [K, M, 2], counter-clockwise from outside, face the camera; bool [K]."""
    x, y = polygons[..., 0], polygons[..., 1]
    most = range(polygons.shape[1])
    area = sum((x[:, k - 1] * y[:, k] - x[:, k] * y[:, k - 1] for k in most), np.zeros(len(x)))
    # y points down in the image, which reverses the winding
    return np.asarray(area < 0)


def boxes(pixels: Array, owner: Ints, count: int) -> Array:
    """Return the exact bounds of each owner's points.

    Args:
        pixels: float64 [P, 2].
        owner: int [P], ascending.
        count: Number of owners.

    Returns:
        Bounds (x0, y0, x1, y1) float64 [count, 4]; (inf, inf, -inf, -inf) for owners without
        points.
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
    clip_box: Box | None = None,
) -> Covered:
    """Return the pixels that the union of each owner's polygons covers.

    Args:
        polygons: Convex polygons float64 [K, M, 2] in pixels.
        owner: int [K].
        count: Number of owners.
        size: Width and height of the image.
        clip_box: Part of the image to return pixels of; by default the whole image.
    """
    width, height = size
    rows = np.ptp(polygons[..., 1]) if polygons.size else 0.0
    step = max(int(np.ceil(rows / _MOST_ROWS)), 1)
    if step > 1:  # only the part in the image is counted at full resolution
        whole = _lengths(_merged(spans(polygons / step), owner), count) * step**2
        runs = _merged(spans(polygons, height), owner)
    else:
        runs = _merged(spans(polygons), owner)
        whole = _lengths(runs, count)
    within = _inside(runs, (0, 0, width, height))
    beyond = np.maximum(whole - _lengths(within, count), 0)
    return Covered(within if clip_box is None else _inside(within, clip_box), width, beyond)


def _merged(runs: Runs, owner: Ints) -> Runs:
    """Return the union of the polygons' runs of each owner, ascending."""
    polygon, row, left, right = runs
    if not len(row):
        return runs
    # all rows of all owners on one line, separated by one uncovered pixel
    low, top = int(left.min()), int(row.min())
    width, height = int(right.max()) - low + 1, int(row.max()) - top + 1
    line = (owner.take(polygon) * height + (row - top)) * width - low
    start, end = line + left, line + right
    if end.max() < 2**31:  # sorting takes half the time
        start, end = start.astype(np.int32), end.astype(np.int32)
    start.sort()
    end.sort()
    # a gap follows where as many runs have ended as have begun
    gap = np.flatnonzero(start[1:] > end[:-1])
    start, end = start[np.append(0, gap + 1)], end[np.append(gap, len(end) - 1)]
    line = start.astype(np.int64) // width
    whose = line // height
    back = low - line * width
    return whose, line - whose * height + top, start + back, end + back


def _inside(runs: Runs, box: Box) -> Runs:
    """Clip runs to a box."""
    x0, y0, x1, y1 = box
    whose, row, left, right = runs
    left, right = np.maximum(left, x0), np.minimum(right, x1)
    some = np.flatnonzero((left < right) & (row >= y0) & (row < y1))
    if len(some) == len(row):
        return whose, row, left, right
    return whose[some], row[some], left[some], right[some]


def _lengths(runs: Runs, count: int) -> Ints:
    """Count the pixels in each object's runs; int [count]."""
    whose, _, left, right = runs
    return np.bincount(whose, right - left, count).astype(np.int64)


def spans(polygons: Array, rows: int | None = None) -> Runs:
    """Scan-convert convex polygons.

    Args:
        polygons: float64 [K, M, 2] in pixels.
        rows: Return only rows from 0 to below this number; by default all rows.

    Returns:
        Runs of pixels whose centres lie in a polygon, one per polygon and row, without empty runs.
        Their owner is the polygon's index.
    """
    number, most = polygons.shape[:2]
    # first corners of all polygons, then second corners: NumPy is slow along short axes
    x, y = polygons.transpose(2, 1, 0).reshape(2, -1)
    # first row whose centres are at or below the corner
    first = np.ceil(y - 0.5).astype(np.int64)
    if rows is not None:
        first = first.clip(0, rows)
    by_corner = first.reshape(most, number)
    top = by_corner.min(axis=0)
    height = by_corner.max(axis=0) - top
    start = height.cumsum() - height
    # each row crosses one downward and one upward edge of a convex polygon
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
    # integers as floats are exact, and NumPy converts slowly between the two
    step = (crossing - before.repeat(length)).astype(np.float64)
    columns = np.empty(2 * count)
    # first column whose centre is at or right of a crossing
    columns[(place - before).repeat(length) + crossing] = np.ceil(
        (at_begin - 0.5).repeat(length) + step * slope.repeat(length)
    )
    falling, rising = columns[:count], columns[count:]
    left, right = np.minimum(falling, rising), np.maximum(falling, rising)
    some = np.flatnonzero(right > left)
    polygon = np.arange(number).repeat(height).take(some)
    row = some + (top - start).take(polygon)
    return polygon, row, left.take(some).astype(np.int64), right.take(some).astype(np.int64)
