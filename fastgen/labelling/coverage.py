"""What objects would cover alone in an unbounded image: exact boxes, and pixels by scan conversion.

A pixel is covered when its centre lies in one of the object's facets that face the camera; centres
on an edge go to one side only, as rasterizers have it (OpenGL 4.5 core specification, 14.6.1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import NEAR_M, View
from fastgen.labelling.facets import Facets, clip, highest, lowest

Array = NDArray[np.float64]
Runs = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]
"""Runs of pixels, int [R] each: whose polygon, row, first column, and the one past the last."""


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
    runs = spans(pixels / step if step > 1 else pixels)
    if step > 1:  # of something enormous the image sees a small part, which is counted as it is
        total = _union_length(runs, owner, count) * step**2
        runs = spans(pixels, size[1])
    else:
        outside = _union_length(_outside(runs, size), owner, count)
    polygon, row, left, right = runs
    left, right = np.clip(left, 0, size[0]), np.clip(right, 0, size[0])
    inside = (right > left) & (row >= 0) & (row < size[1])
    whose = owner[polygon[inside]]
    row, left, right = row[inside], left[inside], right[inside]
    result = []
    borders = np.searchsorted(whose, np.arange(count + 1)).tolist()
    for i, part in enumerate(map(slice, borders, borders[1:])):
        mask, corner = _union(row[part], left[part], right[part])
        beyond = outside[i] if step == 1 else max(total[i] - np.count_nonzero(mask), 0)
        result.append(Cover(mask, corner, int(beyond)))
    return result


def _outside(runs: Runs, size: tuple[int, int]) -> Runs:
    """What of `runs` lies outside an image of `size`."""
    polygon, row, left, right = runs
    off = (row < 0) | (row >= size[1])
    before, behind = ~off & (left < 0), ~off & (right > size[0])
    return (
        np.concatenate([polygon[off], polygon[before], polygon[behind]]),
        np.concatenate([row[off], row[before], row[behind]]),
        np.concatenate([left[off], left[before], np.maximum(left[behind], size[0])]),
        np.concatenate([right[off], np.minimum(right[before], 0), right[behind]]),
    )


def _merged(
    start: NDArray[np.int64], end: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Ascending starts and ends of the union of intervals, of which there is at least one."""
    start, end = np.sort(start), np.sort(end)
    # as many have ended as have begun: a gap follows
    apart = start[1:] > end[:-1]
    return start[np.append(True, apart)], end[np.append(apart, True)]


def _union(
    row: NDArray[np.int64], left: NDArray[np.int64], right: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], tuple[int, int]]:
    """Mask [h, w] of the union of runs, and its corner (x, y)."""
    if not len(row):
        return NOTHING.mask, NOTHING.corner
    x0, y0 = int(left.min()), int(row.min())
    width, height = int(right.max()) - x0, int(row.max()) + 1 - y0
    at = (row - y0) * width - x0
    edges = np.stack(_merged(at + left, at + right), axis=1).ravel()
    lengths = np.diff(edges, prepend=0, append=width * height)
    return np.repeat(np.arange(len(lengths)) % 2 == 1, lengths).reshape(height, width), (x0, y0)


def _union_length(runs: Runs, owner: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Pixels in the union of each owner's runs, int [count]."""
    polygon, row, left, right = runs
    if not len(row):
        return np.zeros(count, np.int64)
    # one long line of all rows of all owners, none of which reaches into the next
    low, top = int(left.min()), int(row.min())
    width, height = int(right.max()) - low + 1, int(row.max()) - top + 1
    line = (owner[polygon] * height + row - top) * width - low
    start, end = _merged(line + left, line + right)
    whose = start // (width * height)
    return np.bincount(whose, weights=end - start, minlength=count).astype(np.int64)


def spans(pixels: Array, rows: int | None = None) -> Runs:
    """Runs of pixel centres in convex polygons [K, M, 2], one for each polygon and row.

    Those of no pixel are left out. rows: only rows from 0 up to this one.
    """
    x, y = pixels[..., 0], pixels[..., 1]
    after = np.roll(pixels, -1, axis=1)
    drop = after[..., 1] - y
    slope = np.divide(after[..., 0] - x, drop, out=np.zeros_like(drop), where=drop != 0)
    # the first row whose centres a corner is not below
    first = np.ceil(y - 0.5).astype(np.int64)
    if rows is not None:
        first = np.clip(first, 0, rows)
    top = lowest(first)
    height = highest(first) - top
    start = np.cumsum(height) - height
    # of a convex polygon one edge crosses a row on its way down the image, and one on its way up
    following = np.roll(first, -1, axis=1)
    rows_crossed = np.abs(following - first)
    edge = np.flatnonzero(rows_crossed)
    whose = edge // pixels.shape[1]
    length = rows_crossed.ravel()[edge]
    begin = np.minimum(first, following).ravel()[edge]
    rises = (following < first).ravel()[edge]
    count = int(height.sum())
    ends = np.cumsum(length)
    step = np.arange(int(length.sum())) - np.repeat(ends - length, length)
    y_center = np.repeat(begin, length) + step + 0.5
    at = np.repeat(start[whose] + begin - top[whose] + rises * count, length) + step
    crossings = np.empty(2 * count)
    crossings[at] = np.repeat(x.ravel()[edge], length) + (
        y_center - np.repeat(y.ravel()[edge], length)
    ) * np.repeat(slope.ravel()[edge], length)
    falling, rising = crossings.reshape(2, count)
    left = np.ceil(np.minimum(falling, rising) - 0.5).astype(np.int64)
    right = np.ceil(np.maximum(falling, rising) - 0.5).astype(np.int64)
    some = np.flatnonzero(right > left)
    polygon = np.repeat(np.arange(len(pixels)), height)
    row = np.arange(count) + np.repeat(top - start, height)
    return polygon[some], row[some], left[some], right[some]


_MOST_POINTS = 1_000_000
"""Of things that cover more, what lies outside the image is looked at on a coarser grid."""


@dataclass(frozen=True, eq=False)
class Points:
    """What single pixel centres see. pixel: int [P, 2], column and row; within: bool [P], whether
    that is in the image; depth_m: float64 [P]; rest_mm: float64 [P, 3]. Outside the image a point
    is the centre of `step` by `step` pixels, of which `pixel` is the first."""

    pixel: NDArray[np.int64]
    within: NDArray[np.bool_]
    depth_m: Array
    rest_mm: Array
    step: int


def surface_points(seen: Projected, size: tuple[int, int]) -> Points:
    """Every pixel centre in every facet, also outside an image of `size`: there on a grid that is
    coarser the larger the facets are together."""
    bounds = boxes(seen.pixels, np.zeros(len(seen.owner), np.int64), 1)[0]
    area = np.prod(bounds[2:] - bounds[:2]) if np.isfinite(bounds).all() else 0.0
    if area <= _MOST_POINTS:
        return _points(seen, spans(seen.pixels), 1, size)
    polygon, row, left, right = spans(seen.pixels, size[1])
    left, right = np.clip(left, 0, size[0]), np.clip(right, 0, size[0])
    fine = _points(seen, (polygon, row, left, right), 1, size)
    step = int(np.ceil(2 * np.sqrt(area / _MOST_POINTS)))
    coarse = _points(seen, spans(seen.pixels / step), step, size)
    off = ~coarse.within
    return Points(
        np.concatenate([fine.pixel, coarse.pixel[off]]),
        np.concatenate([fine.within, coarse.within[off]]),
        np.concatenate([fine.depth_m, coarse.depth_m[off]]),
        np.concatenate([fine.rest_mm, coarse.rest_mm[off]]),
        step,
    )


def _points(seen: Projected, runs: Runs, step: int, size: tuple[int, int]) -> Points:
    """The centres of squares of `step` pixels along `runs`, which count such squares.

    What is linear on a facet is linear in the image when divided by depth; Blinn 1992,
    "Hyperbolic Interpolation".
    """
    polygon, row, left, right = runs
    length = right - left
    run = np.repeat(np.arange(len(row)), length)
    column = left[run] + np.arange(len(run)) - np.repeat(np.cumsum(length) - length, length)
    met, polygon = np.unique(polygon, return_inverse=True)
    corners, depth_m, rest_mm = seen.pixels[met], seen.depth_m[met], seen.rest_mm[met]
    polygon, row = polygon[run], row[run]
    origin = corners[:, :1]
    flat = np.concatenate([corners - origin, np.ones_like(depth_m)[..., None]], axis=2)
    values = np.concatenate([rest_mm, np.ones_like(rest_mm[..., :1])], axis=2)
    # clipping leaves corners that repeat; of three as drawn the inverse is the same for less
    inverse = np.linalg.pinv if flat.shape[1] > 3 else np.linalg.inv
    to_values = inverse(flat) @ (values / depth_m[..., None])
    pixel = np.stack([column, row], axis=1) * step
    center = pixel + 0.5 * step
    within = np.all((center >= 0) & (center < size), axis=1)
    at = np.concatenate([center - origin[polygon, 0], np.ones((len(pixel), 1))], axis=1)
    found = np.einsum("pi,pij->pj", at, to_values[polygon])
    depth = 1 / found[:, 3]
    return Points(pixel, within, depth, found[:, :3] * depth[:, None], step)
