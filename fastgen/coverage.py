"""What objects would cover alone in an unbounded image: exact boxes, and pixels by scan conversion.

A pixel is covered when its centre lies in one of the object's facets that face the camera; centres
on an edge go to one side only, as rasterizers have it (OpenGL 4.5 core specification, 14.6.1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import NEAR_M, View
from fastgen.facets import Facets, clip, highest, lowest

Array = NDArray[np.float64]

_MOST_ROWS = 100_000
"""Objects that cross more rows than this are counted on a coarser grid, to a thousandth."""


@dataclass(frozen=True, eq=False)
class Cover:
    """Pixels that one object covers alone.

    mask: bool [h, w], those within the image. corner: (x, y) of the mask's first pixel. beyond: how
    many more it covers outside the image.
    """

    mask: NDArray[np.bool_]
    corner: tuple[int, int]
    beyond: int

    def hidden(self, target: NDArray[np.generic], value: int) -> int:
        """Covered pixels of the image where `target` [H, W] is not `value`."""
        (x, y), (height, width) = self.corner, self.mask.shape
        return int(np.count_nonzero(self.mask & (target[y : y + height, x : x + width] != value)))


NOTHING = Cover(np.zeros((0, 0), bool), (0, 0), 0)


@dataclass(frozen=True, eq=False)
class Projected:
    """Facets in the image. pixels: float64 [K, M, 2]; depth_m: [K, M]; rest_mm: [K, M, 3];
    owner: int [K], ascending; faces: bool [K], whether their outside faces the camera."""

    pixels: Array
    depth_m: Array
    rest_mm: Array
    owner: NDArray[np.int64]
    faces: NDArray[np.bool_]


def project(facets: Facets, view: View) -> Projected:
    """The part of the facets beyond the near plane, as `view` sees it."""
    corners, rest, owner = facets.corners_mm, facets.rest_mm, facets.owner
    pixels, depth = view.project(corners)
    if depth.size and depth.min() < NEAR_M:
        joined, seen = clip(np.concatenate([corners, rest], axis=2), depth - NEAR_M)
        corners, rest, owner = joined[..., :3], joined[..., 3:], owner[seen]
        pixels, depth = view.project(corners)
    x, y = pixels[..., 0], pixels[..., 1]
    most = range(pixels.shape[1])
    area = sum((x[:, k - 1] * y[:, k] - x[:, k] * y[:, k - 1] for k in most), np.zeros(len(x)))
    # counter-clockwise from outside turns the other way where y points down
    return Projected(pixels, depth, rest, owner, area < 0)


def boxes(pixels: Array, owner: NDArray[np.int64], count: int) -> Array:
    """Exact bounds (x0, y0, x1, y1) float64 [count, 4] of each owner's polygons [K, M, 2].

    owner: int [K], ascending. One without polygons gets (inf, inf, -inf, -inf).
    """
    found = np.tile([np.inf, np.inf, -np.inf, -np.inf], (count, 1))
    present, first = np.unique(owner, return_index=True)
    if present.size:
        found[present, :2] = np.minimum.reduceat(lowest(pixels), first)
        found[present, 2:] = np.maximum.reduceat(highest(pixels), first)
    return found


def covers(
    pixels: Array, owner: NDArray[np.int64], count: int, size: tuple[int, int]
) -> list[Cover]:
    """What each owner's polygons [K, M, 2] cover, their union, in an image of `size`."""
    rows = np.ptp(pixels[..., 1]) if pixels.size else 0.0
    step = max(int(np.ceil(rows / _MOST_ROWS)), 1)
    polygon, row, left, right = spans(pixels / step)
    whose = owner[polygon]
    total = _union_length(whose, row, left, right, count) * step**2
    if step > 1:  # of something enormous the image sees a small part, which is counted as it is
        polygon, row, left, right = spans(pixels, size[1])
        whose = owner[polygon]
    left, right = np.clip(left, 0, size[0]), np.clip(right, 0, size[0])
    inside = (right > left) & (row >= 0) & (row < size[1])
    whose, row, left, right = whose[inside], row[inside], left[inside], right[inside]
    result = [Cover(NOTHING.mask, (0, 0), int(total[i])) for i in range(count)]
    present, first = np.unique(whose, return_index=True)
    ends = np.append(first[1:], len(whose))[: len(first)]
    for i, begin, end in zip(present.tolist(), first, ends, strict=True):
        runs = slice(begin, end)
        x0, y0 = int(left[runs].min()), int(row[runs].min())
        width, height = int(right[runs].max()) - x0, int(row[runs].max()) + 1 - y0
        at = (row[runs] - y0) * (width + 1) - x0
        # a row has one cell more, where runs that reach its end are closed
        cells = height * (width + 1)
        steps = np.bincount(at + left[runs], minlength=cells)
        steps -= np.bincount(at + right[runs], minlength=cells)
        mask = (np.cumsum(steps) > 0).reshape(height, width + 1)[:, :-1]
        beyond = max(int(total[i]) - int(np.count_nonzero(mask)), 0)
        result[i] = Cover(mask, (x0, y0), beyond)
    return result


def _union_length(
    whose: NDArray[np.int64],
    row: NDArray[np.int64],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    count: int,
) -> NDArray[np.int64]:
    """Pixels in the union of each owner's runs, int [count]."""
    if not len(row):
        return np.zeros(count, np.int64)
    # one long line of all rows of all owners, none of which reaches into the next
    low, top = int(left.min()), int(row.min())
    width, height = int(right.max()) - low + 1, int(row.max()) - top + 1
    line = (whose * height + row - top) * width - low
    order = np.argsort(line + left, kind="stable")
    start, end = (line + left)[order], (line + right)[order]
    reached = np.concatenate([[start[0]], np.maximum.accumulate(end)[:-1]])
    fresh = np.maximum(end - np.maximum(start, reached), 0)
    return np.bincount(whose[order], weights=fresh, minlength=count).astype(np.int64)


def spans(
    pixels: Array, rows: int | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Runs of pixel centres in convex polygons [K, M, 2]: polygon, row, first and past-last column.

    One entry for each polygon and row, those of no pixel left out. rows: only rows from 0 up to
    this one.
    """
    first = np.ceil(lowest(pixels[..., 1]) - 0.5).astype(np.int64)
    last = np.ceil(highest(pixels[..., 1]) - 0.5).astype(np.int64)
    if rows is not None:
        first, last = np.clip(first, 0, rows), np.clip(last, 0, rows)
    height = last - first
    polygon = np.repeat(np.arange(len(pixels)), height)
    offset = np.arange(len(polygon)) - np.repeat(np.cumsum(height) - height, height)
    row = first[polygon] + offset
    y = row + 0.5
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for k in range(pixels.shape[1]):
        a, b = pixels[:, k], pixels[:, (k + 1) % pixels.shape[1]]
        drop = b[:, 1] - a[:, 1]
        slope = np.divide(b[:, 0] - a[:, 0], drop, out=np.zeros_like(drop), where=drop != 0)
        crosses = (a[polygon, 1] <= y) != (b[polygon, 1] <= y)
        x = a[polygon, 0] + (y - a[polygon, 1]) * slope[polygon]
        left = np.where(crosses, np.minimum(left, x), left)
        right = np.where(crosses, np.maximum(right, x), right)
    some = right > left
    polygon, row, left, right = polygon[some], row[some], left[some], right[some]
    begin, end = (np.ceil(x - 0.5).astype(np.int64) for x in (left, right))
    some = end > begin
    return polygon[some], row[some], begin[some], end[some]


_MOST_POINTS = 4_000_000
"""Of things that cover more, only what lies within the image is looked at."""


@dataclass(frozen=True, eq=False)
class Points:
    """What single pixel centres see. pixel: int [P, 2], column and row; depth_m: float64 [P];
    rest_mm: float64 [P, 3]."""

    pixel: NDArray[np.int64]
    depth_m: Array
    rest_mm: Array


def surface_points(seen: Projected, size: tuple[int, int]) -> Points:
    """Every pixel centre in every facet, also outside an image of `size` unless they are too many.

    What is linear on a facet is linear in the image when divided by depth; Blinn 1992,
    "Hyperbolic Interpolation".
    """
    bounds = boxes(seen.pixels, np.zeros(len(seen.owner), np.int64), 1)[0]
    if np.isfinite(bounds).all() and np.prod(bounds[2:] - bounds[:2]) > _MOST_POINTS:
        polygon, row, left, right = spans(seen.pixels, size[1])
        left, right = np.clip(left, 0, size[0]), np.clip(right, 0, size[0])
    else:
        polygon, row, left, right = spans(seen.pixels)
    length = right - left
    run = np.repeat(np.arange(len(row)), length)
    column = left[run] + np.arange(len(run)) - np.repeat(np.cumsum(length) - length, length)
    polygon, row = polygon[run], row[run]
    origin = seen.pixels[:, :1]
    flat = np.concatenate([seen.pixels - origin, np.ones_like(seen.depth_m)[..., None]], axis=2)
    values = np.concatenate([seen.rest_mm, np.ones_like(seen.rest_mm[..., :1])], axis=2)
    to_values = np.linalg.pinv(flat) @ (values / seen.depth_m[..., None])
    pixel = np.stack([column, row], axis=1)
    at = np.concatenate([pixel + 0.5 - origin[polygon, 0], np.ones((len(pixel), 1))], axis=1)
    found = np.einsum("pi,pij->pj", at, to_values[polygon])
    depth = 1 / found[:, 3]
    return Points(pixel, depth, found[:, :3] * depth[:, None])
