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

_MOST_PIXELS = 4_000_000
"""Canvases of more pixels are counted on a coarser grid, to about one part in a thousand."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """Pixels that one object covers alone.

    mask: bool [h, w]. corner: (x, y) of the mask's first pixel, which may lie outside the image.
    scale: side of a mask cell in pixels, a whole number; 1 unless the object is enormous.
    """

    mask: NDArray[np.bool_]
    corner: tuple[int, int]
    scale: int

    @property
    def area(self) -> int:
        """Pixels covered, within the image or not."""
        return int(np.count_nonzero(self.mask)) * self.scale**2

    def split(self, target: NDArray[np.generic], value: int) -> tuple[int, int]:
        """Covered pixels where `target` [H, W] is not `value`, and those beyond the image."""
        step = self.scale
        height, width = self.mask.shape
        (x, y), (bottom, right) = self.corner, target.shape
        x0, y0 = max(-(x // step), 0), max(-(y // step), 0)
        x1, y1 = min((right - x) // step, width), min((bottom - y) // step, height)
        if x1 <= x0 or y1 <= y0:
            return 0, self.area
        inside = self.mask[y0:y1, x0:x1]
        there = target[y + y0 * step : y + y1 * step : step, x + x0 * step : x + x1 * step : step]
        hidden = int(np.count_nonzero(inside & (there != value))) * step**2
        return hidden, self.area - int(np.count_nonzero(inside)) * step**2


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


def canvases(pixels: Array, owner: NDArray[np.int64], count: int) -> list[Canvas]:
    """What each owner's polygons [K, M, 2] cover, their union; `count` canvases."""
    bounds = boxes(pixels, owner, count)
    bounds[~np.isfinite(bounds).all(axis=1)] = 0.0
    scale = _scale(bounds)
    corner = np.floor(bounds[:, :2] / scale[:, None]) * scale[:, None]
    shape = np.ceil((bounds[:, 2:] - corner) / scale[:, None]).astype(np.int64)
    # a row has one cell more, where runs that reach its end are closed
    stride = shape[:, 0] + 1
    ends = np.cumsum(stride * shape[:, 1])
    starts = ends - stride * shape[:, 1]
    local = (pixels - corner[owner, None]) / scale[owner, None, None]
    polygon, row, left, right = spans(local)
    at = starts[owner[polygon]] + row * stride[owner[polygon]]
    total = int(ends[-1]) if count else 0
    steps = np.bincount(at + left, minlength=total) - np.bincount(at + right, minlength=total)
    covered = np.cumsum(steps) > 0
    return [
        Canvas(
            covered[starts[i] : ends[i]].reshape(shape[i, 1], stride[i])[:, :-1],
            (int(corner[i, 0]), int(corner[i, 1])),
            int(scale[i]),
        )
        for i in range(count)
    ]


def _scale(bounds: Array) -> Array:
    """Side in pixels of the cells that boxes [..., 4] are counted in, whole numbers [...]."""
    sides = np.maximum(bounds[..., 2:] - bounds[..., :2], 0.0)
    return np.maximum(np.ceil(np.sqrt(sides.prod(axis=-1) / _MOST_PIXELS)), 1.0)


def spans(
    pixels: Array,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Runs of pixel centres in convex polygons [K, M, 2]: polygon, row, first and past-last column.

    One entry for each polygon and row, those of no pixel left out.
    """
    first = np.ceil(lowest(pixels[..., 1]) - 0.5).astype(np.int64)
    last = np.ceil(highest(pixels[..., 1]) - 0.5).astype(np.int64)
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


@dataclass(frozen=True, eq=False)
class Points:
    """What single pixel centres see. cell: int [P, 2], column and row of cells of scale x scale
    pixels; depth_m: float64 [P]; rest_mm: float64 [P, 3]."""

    cell: NDArray[np.int64]
    scale: int
    depth_m: Array
    rest_mm: Array


def surface_points(seen: Projected) -> Points:
    """Every pixel centre in every facet.

    What is linear on a facet is linear in the image when divided by depth; Blinn 1992,
    "Hyperbolic Interpolation".
    """
    bounds = boxes(seen.pixels, np.zeros(len(seen.owner), np.int64), 1)[0]
    scale = int(_scale(bounds)) if np.isfinite(bounds).all() else 1
    pixels = seen.pixels / scale
    polygon, row, left, right = spans(pixels)
    length = right - left
    run = np.repeat(np.arange(len(row)), length)
    column = left[run] + np.arange(len(run)) - np.repeat(np.cumsum(length) - length, length)
    polygon, row = polygon[run], row[run]
    origin = pixels[:, :1]
    flat = np.concatenate([pixels - origin, np.ones_like(seen.depth_m)[..., None]], axis=2)
    values = np.concatenate([seen.rest_mm, np.ones_like(seen.rest_mm[..., :1])], axis=2)
    to_values = np.linalg.pinv(flat) @ (values / seen.depth_m[..., None])
    cell = np.stack([column, row], axis=1)
    at = np.concatenate([cell + 0.5 - origin[polygon, 0], np.ones((len(cell), 1))], axis=1)
    found = np.einsum("pi,pij->pj", at, to_values[polygon])
    depth = 1 / found[:, 3]
    return Points(cell, scale, depth, found[:, :3] * depth[:, None])
