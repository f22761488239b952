"""Points of facets at pixel centres, in the image and around it.

Values that are linear on a facet are linear in the image after division by depth (Blinn 1992,
"Hyperbolic Interpolation").
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastgen.labels.coverage import Projected, Runs, spans

Array = NDArray[np.float64]

_MOST_POINTS = 1_000_000
"""Facets over a larger area are sampled on a coarser grid outside the image."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points of facets at pixel centres.

    Attributes:
        column: int [P], column of the pixel. Outside the image, a point is the centre of a square
            of `step` by `step` pixels, and `column` and `row` are those of its upper left pixel.
        row: int [P], row of the pixel.
        within: bool [P], True in the image.
        depth_m: float64 [P].
        step: Side of the squares in pixels.
        facet: int [P], index into `plane`.
        plane: float64 [F, 3, 4], linear functions of the pixel: (rest position / depth in mm / m,
            1 / depth) of each facet at its origin, and their change for one pixel to the right and
            one pixel down.
        away: float64 [2, P], pixels right of and below the facet's origin.
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
        """Return the positions before damage [W, 3] of the points with indices `which` [W]."""
        facet, depth_m = self.facet.take(which), self.depth_m.take(which)
        right, down = self.away.take(which, axis=1)
        found = np.empty((len(which), 3))
        for axis in range(3):  # NumPy is slow along short axes
            at, by_right, by_down = self.plane[:, :, axis].T.copy()
            over_depth = at.take(facet) + right * by_right.take(facet) + down * by_down.take(facet)
            np.multiply(over_depth, depth_m, out=found[:, axis])
        return found


def surface_points(seen: Projected, size: tuple[int, int]) -> list[Points]:
    """Return the points at all pixel centres in facets, also outside the image.

    Args:
        seen: The facets in the image. They need Facets.rest_mm.
        size: Width and height of the image.

    Returns:
        One Points, or two if the facets are large: the points in the image, and points outside it
        on a grid that is coarser for larger facets.
    """
    if not len(seen.pixels):
        return []
    polygons, area = seen.polygons, np.prod(np.ptp(seen.pixels, axis=0))
    if area <= _MOST_POINTS:
        return [_points(seen, spans(polygons), 1, size)]
    polygon, row, left, right = spans(polygons, size[1])
    left, right = np.clip(left, 0, size[0]), np.clip(right, 0, size[0])
    fine = _points(seen, (polygon, row, left, right), 1, size)
    step = int(np.ceil(2 * np.sqrt(area / _MOST_POINTS)))
    coarse = _points(seen, spans(polygons / step), step, size)
    off = ~coarse.within
    outside = replace(
        coarse,
        **{name: getattr(coarse, name)[off] for name in ("column", "row", "within", "depth_m")},
        facet=coarse.facet[off],
        away=coarse.away[:, off],
    )
    return [fine, outside]


def _points(seen: Projected, runs: Runs, step: int, size: tuple[int, int]) -> Points:
    """Return the points at the centres of squares of `step` pixels; `runs` consist of squares."""
    polygon, row, left, right = runs
    length = right - left
    ends = length.cumsum()
    column = (left - ends + length).repeat(length)
    column += np.arange(len(column))
    hit = np.zeros(len(seen.facets.corners), bool)
    hit[polygon] = True
    origin, plane = _planes(seen, np.flatnonzero(hit))
    facet = (hit.cumsum() - 1)[polygon].repeat(length)
    column, row = column * step, row.repeat(length) * step
    x, y = column + 0.5 * step, row + 0.5 * step
    within = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
    from_x, from_y = origin.T.copy()
    away = np.stack([x - from_x.take(facet), y - from_y.take(facet)])
    inverse, right_of, down_of = plane[..., 3].T.copy()
    depth = 1 / (
        inverse.take(facet) + away[0] * right_of.take(facet) + away[1] * down_of.take(facet)
    )
    return Points(column, row, within, depth, step, facet, plane, away)


def _planes(seen: Projected, which: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return origins [F, 2] in pixels and Points.plane [F, 3, 4] of the facets `which` [F]."""
    assert seen.facets.rest_mm is not None
    over_depth = np.column_stack([seen.facets.rest_mm, np.ones(len(seen.depth_m))])
    over_depth /= seen.depth_m[:, None]
    points = seen.facets.corners.take(which, axis=0)
    # three corners define a plane: the largest triangle of a fan over all corners
    corners = seen.pixels.take(points, axis=0)
    sides = corners[:, 1:] - corners[:, :1]
    doubled = sides[:, :-1, 0] * sides[:, 1:, 1] - sides[:, :-1, 1] * sides[:, 1:, 0]
    second = np.abs(doubled).argmax(axis=1) + 1 + np.arange(len(which)) * points.shape[1]
    a, b, c = points[:, 0], points.ravel().take(second), points.ravel().take(second + 1)
    origin, value = seen.pixels.take(a, axis=0), over_depth.take(a, axis=0)
    (bx, by), (cx, cy) = ((seen.pixels.take(to, axis=0) - origin).T[..., None] for to in (b, c))
    grows, other = (over_depth.take(to, axis=0) - value for to in (b, c))
    area = bx * cy - by * cx
    right, down = (grows * cy - other * by) / area, (other * bx - grows * cx) / area
    return origin, np.stack([value, right, down], axis=1)
