"""What objects would cover alone in an unbounded image: exact boxes, and pixels by scan conversion.

A pixel is covered when its centre lies in one of the object's facets that face the camera; centres
on an edge go to one side only, as rasterizers have it (OpenGL 4.5 core specification, 14.6.1).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import NEAR_M, View
from fastgen.labelling.facets import Facets, clip, highest, lowest
from fastgen.sample import Box

Array = NDArray[np.float64]
Runs = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]
"""Runs of pixels, int [R] each: whose polygon, row, first column, and the one past the last."""


_MOST_ROWS = 100_000
"""Objects that cross more rows than this are counted on a coarser grid, to a thousandth."""


@dataclass(frozen=True, eq=False)
class Covered:
    """Pixels that each of some objects covers alone.

    pixel: int [P], row * width + column of those within the image, each object's once; owner: int
    [P], whose they are. beyond: int [count], how many more each object covers outside the image.
    """

    pixel: NDArray[np.int64]
    owner: NDArray[np.int64]
    beyond: NDArray[np.int64]

    def hidden(self, seen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """How many of each object's pixels are not `seen` [P], int [count]."""
        return np.bincount(self.owner[~seen], minlength=len(self.beyond))


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


def covered(
    pixels: Array,
    owner: NDArray[np.int64],
    count: int,
    size: tuple[int, int],
    asked: Box | None = None,
) -> Covered:
    """What each owner's polygons [K, M, 2] cover, their union, in an image of `size`.

    asked: the part of the image whose pixels are asked for; all of it by default.
    """
    width, height = size
    rows = np.ptp(pixels[..., 1]) if pixels.size else 0.0
    step = max(int(np.ceil(rows / _MOST_ROWS)), 1)
    if step > 1:  # of something enormous the image sees a small part, which is counted as it is
        whole = _union_length(spans(pixels / step), owner, count) * step**2
        runs, asked = spans(pixels, height), None
    else:
        runs = spans(pixels)
    polygon, row, left, right = runs
    x0, y0, x1, y1 = asked or (0, 0, width, height)
    first, last = np.maximum(left, x0), np.minimum(right, x1)
    inside = np.flatnonzero((last > first) & (row >= y0) & (row < y1))
    # one long line of all owners' rows, with a pixel between them that none has
    line = width * height + 1
    start = owner[polygon[inside]] * line + row[inside] * width
    start, end = _merged(start + first[inside], start + last[inside])
    length, whose = end - start, start // line
    pixel = np.arange(length.sum()) + np.repeat(
        start - whose * line - np.cumsum(length) + length, length
    )
    if step > 1:
        within = np.bincount(whose, weights=length, minlength=count)
        beyond = np.maximum(whole - within, 0).astype(np.int64)
    else:
        beyond = _union_length(_outside(runs, size), owner, count)
    return Covered(pixel, np.repeat(whose, length), beyond)


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
    """Ascending starts and ends of the union of intervals."""
    start, end = np.sort(start), np.sort(end)
    # as many have ended as have begun: a gap follows
    apart = start[1:] > end[:-1]
    edge = np.ones(min(len(start), 1), bool)
    return start[np.append(edge, apart)], end[np.append(apart, edge)]


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
    crossed = np.abs(following - first).ravel()
    edge = np.flatnonzero(crossed)
    whose, length = edge // pixels.shape[1], crossed[edge]
    begin = np.minimum(first, following).ravel()[edge]
    rises = (following < first).ravel()[edge]
    slope = slope.ravel()[edge]
    at_begin = x.ravel()[edge] + (begin + 0.5 - y.ravel()[edge]) * slope
    count, total = int(height.sum()), int(length.sum())
    before = np.cumsum(length) - length
    step = np.arange(total) - np.repeat(before, length)
    place = np.repeat(start[whose] + begin - top[whose] + rises * count, length) + step
    columns = np.empty(2 * count, np.int64)
    # the first column whose centre a crossing is not right of
    columns[place] = np.ceil(np.repeat(at_begin - 0.5, length) + step * np.repeat(slope, length))
    falling, rising = columns.reshape(2, count)
    left, right = np.minimum(falling, rising), np.maximum(falling, rising)
    some = np.flatnonzero(right > left)
    polygon = np.repeat(np.arange(len(pixels)), height)
    row = np.arange(count) + np.repeat(top - start, height)
    return polygon[some], row[some], left[some], right[some]


_MOST_POINTS = 1_000_000
"""Of things that cover more, what lies outside the image is looked at on a coarser grid."""


@dataclass(frozen=True, eq=False)
class Points:
    """What single pixel centres see. column, row: int [P]; within: bool [P], whether that is in the
    image; depth_m: float64 [P]. Outside the image a point is the centre of `step` by `step` pixels,
    of which (column, row) is the first.

    facet: int [P], index into `plane`, float64 [F, 3, 4]: what each facet's rest position over
    depth, in mm / m, and inverse depth are at its origin, and by how much they grow a pixel to the
    right and down. away: float64 [2, P], right and down from that origin.
    """

    column: NDArray[np.int64]
    row: NDArray[np.int64]
    within: NDArray[np.bool_]
    depth_m: Array
    step: int
    facet: NDArray[np.int64]
    plane: Array
    away: Array

    def rest_mm(self, which: NDArray[np.int64]) -> Array:
        """Rest positions [W, 3] of the points numbered `which` [W]."""
        plane, (right, down) = self.plane[self.facet[which], :, :3], self.away[:, which, None]
        over_depth = plane[:, 0] + right * plane[:, 1] + down * plane[:, 2]
        return np.asarray(over_depth * self.depth_m[which, None])


def surface_points(seen: Projected, size: tuple[int, int]) -> list[Points]:
    """Every pixel centre in every facet, also outside an image of `size`: there on a grid that is
    coarser the larger the facets are together, as Points of its own."""
    bounds = boxes(seen.pixels, np.zeros(len(seen.owner), np.int64), 1)[0]
    area = np.prod(bounds[2:] - bounds[:2]) if np.isfinite(bounds).all() else 0.0
    if area <= _MOST_POINTS:
        return [_points(seen, spans(seen.pixels), 1, size)]
    polygon, row, left, right = spans(seen.pixels, size[1])
    left, right = np.clip(left, 0, size[0]), np.clip(right, 0, size[0])
    fine = _points(seen, (polygon, row, left, right), 1, size)
    step = int(np.ceil(2 * np.sqrt(area / _MOST_POINTS)))
    coarse = _points(seen, spans(seen.pixels / step), step, size)
    off = ~coarse.within
    outside = replace(
        coarse,
        **{name: getattr(coarse, name)[off] for name in ("column", "row", "within", "depth_m")},
        facet=coarse.facet[off],
        away=coarse.away[:, off],
    )
    return [fine, outside]


def _points(seen: Projected, runs: Runs, step: int, size: tuple[int, int]) -> Points:
    """The centres of squares of `step` pixels along `runs`, which count such squares.

    What is linear on a facet is linear in the image when divided by depth; Blinn 1992,
    "Hyperbolic Interpolation".
    """
    polygon, row, left, right = runs
    length = right - left
    ends = np.cumsum(length)
    column = np.arange(length.sum()) + np.repeat(left - ends + length, length)
    met = np.zeros(len(seen.owner), bool)
    met[polygon] = True
    origin, plane = _planes(seen, np.flatnonzero(met))
    facet = np.repeat((np.cumsum(met) - 1)[polygon], length)
    column, row = column * step, np.repeat(row, length) * step
    x, y = column + 0.5 * step, row + 0.5 * step
    within = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
    away = np.stack([x - origin[facet, 0], y - origin[facet, 1]])
    inverse, right_of, down_of = plane[..., 3].T.copy()
    depth = 1 / (inverse[facet] + away[0] * right_of[facet] + away[1] * down_of[facet])
    return Points(column, row, within, depth, step, facet, plane, away)


def _planes(seen: Projected, which: NDArray[np.int64]) -> tuple[Array, Array]:
    """Origins [F, 2] in pixels and planes [F, 3, 4], as of Points, of the facets `which` [F]."""
    corners, depth, rest = seen.pixels[which], seen.depth_m[which], seen.rest_mm[which]
    values = np.concatenate([rest, np.ones_like(rest[..., :1])], axis=2) / depth[..., None]
    # three corners fix a plane: of more, as clipping leaves, those of the largest triangle of a fan
    sides = corners[:, 1:] - corners[:, :1]
    doubled = sides[:, :-1, 0] * sides[:, 1:, 1] - sides[:, :-1, 1] * sides[:, 1:, 0]
    k, row = np.abs(doubled).argmax(axis=1), np.arange(len(which))
    b, c, area = sides[row, k], sides[row, k + 1], doubled[row, k, None]
    grows, other = values[row, k + 1] - values[:, 0], values[row, k + 2] - values[:, 0]
    right = (grows * c[:, 1:] - other * b[:, 1:]) / area
    down = (other * b[:, :1] - grows * c[:, :1]) / area
    return corners[:, 0], np.stack([values[:, 0], right, down], axis=1)
