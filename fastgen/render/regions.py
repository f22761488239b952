"""Rectangular regions of an image, set operations on them, and regions that objects project to."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.damage_law import inward_mm, outward_mm
from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.scene import Damage
from fastgen.scene.limits import NEAR_M

Region = tuple[int, int, int, int]
"""Left column, top row, width and height in pixels."""

_STEPS = np.linspace(0, 1, 17)
_SIDES = np.array(
    [
        np.stack(np.broadcast_arrays(*at), axis=1)
        for k in (0, 1)
        for at in ((_STEPS, k), (k, _STEPS))
    ]
)
"""Points [4, 17, 2] on the sides of the unit square, which lens distortion curves."""

_LEAST_DEPTH_M = NEAR_M / 8
"""Depth up to which hulls are cut off. Drawn points are at least NEAR_M away from the camera and at
most 80 degrees off its axis, so they are deeper."""


def bands(regions: Sequence[Region | None]) -> list[Region | None]:
    """Return disjoint regions that cover all given regions, with one interval in each row.

    Args:
        regions: Regions that may overlap; None is the whole image.

    Returns:
        Regions from top to bottom. Each row is covered from the leftmost to the rightmost column
        of the given regions that cross it. A single None if a given region is the whole image.
    """
    known = [region for region in regions if region is not None]
    if len(known) < len(regions):
        return [None]
    found: list[Region | None] = []
    for top, bottom in pairwise(sorted({v for _, y, _, h in known for v in (y, y + h)})):
        crossed = [(x, x + w) for x, y, w, h in known if y <= top and bottom <= y + h]
        if not crossed:
            continue
        left, right = min(x for x, _ in crossed), max(x for _, x in crossed)
        last = found[-1] if found else None
        if last and (last[0], last[2]) == (left, right - left) and last[1] + last[3] == top:
            found[-1] = (left, last[1], right - left, bottom - last[1])
        else:
            found.append((left, top, right - left, bottom - top))
    return found


def merged(regions: Sequence[Region | None]) -> list[Region | None]:
    """Return disjoint regions that cover all given regions, with overlapping regions joined.

    Args:
        regions: Regions that may overlap; None is the whole image.

    Returns:
        Regions without overlap; overlapping ones are replaced by their bounding rectangle. A single
        None if a given region is the whole image.
    """
    found: list[Region] = []
    for region in regions:
        if region is None:
            return [None]
        x, y, width, height = region
        left, top, right, bottom = x, y, x + width, y + height
        while touched := [
            (a, b, w, h)
            for a, b, w, h in found
            if a < right and left < a + w and b < bottom and top < b + h
        ]:
            found = [other for other in found if other not in touched]
            left, top = min(left, *(a for a, *_ in touched)), min(top, *(t[1] for t in touched))
            right = max(right, *(a + w for a, _, w, _ in touched))
            bottom = max(bottom, *(b + h for _, b, _, h in touched))
        found.append((left, top, right - left, bottom - top))
    return list(found)


def outside(regions: Sequence[Region], others: Sequence[Region]) -> list[Region]:
    """Return the parts of regions that lie outside all other regions.

    Args:
        regions: Disjoint regions.
        others: Regions to subtract; they may overlap.

    Returns:
        Disjoint regions.
    """
    left = list(regions)
    for x, y, width, height in others:
        found = []
        for a, b, w, h in left:
            # Full-width strips above and below, then the parts to the left and right.
            top, bottom = (min(max(row, b), b + h) for row in (y, y + height))
            first, last = (min(max(column, a), a + w) for column in (x, x + width))
            found += [(a, b, w, top - b), (a, bottom, w, b + h - bottom)]
            found += [(a, top, first - a, bottom - top), (last, top, a + w - last, bottom - top)]
        left = [part for part in found if part[2] > 0 and part[3] > 0]
    return left


def within(regions: Sequence[Region | None], other: Region) -> list[Region]:
    """Return the intersections of regions with another region.

    Args:
        regions: Regions; None is the whole image.
        other: Region to intersect them with.

    Returns:
        All intersections that are not empty.
    """
    x, y, width, height = other
    found = []
    for left, top, across, down in (region or other for region in regions):
        first, last = max(left, x), min(left + across, x + width)
        upper, lower = max(top, y), min(top + down, y + height)
        if first < last and upper < lower:
            found.append((first, upper, last - first, lower - upper))
    return found


def grown(region: Region, margin_px: int, size: tuple[int, int]) -> Region:
    """Return a region widened by a margin on all sides, within an image of (width, height) = size.

    An even margin keeps the alignment to 2x2 pixel blocks.
    """
    x, y, width, height = region
    wider = x - margin_px, y - margin_px, width + 2 * margin_px, height + 2 * margin_px
    (inside,) = within([wider], (0, 0, *size))
    return inside


def bounding_region(regions: Sequence[Region]) -> Region:
    """Return the smallest region that contains all given regions, at least one."""
    left, top = (min(region[k] for region in regions) for k in (0, 1))
    right, bottom = (max(region[k] + region[k + 2] for region in regions) for k in (0, 1))
    return left, top, right - left, bottom - top


def region_of(view: View, corners_mm: np.ndarray) -> Region:
    """Return the region that the part of a convex hull before the camera may cover.

    Args:
        view: Projection of the image.
        corners_mm: Points [N, 3] in the container frame.

    Returns:
        Region aligned to 2x2 pixel blocks, which classify.comp needs. It is empty for a hull behind
        the camera or outside the image.
    """
    x0, y0, x1, y1 = hull_corners(view, corners_mm[None])[0][0].tolist()
    return x0, y0, x1 - x0, y1 - y0


def hull_corners(
    view: View, points_mm: NDArray[np.floating]
) -> tuple[NDArray[np.int64], list[NDArray[np.float64]]]:
    """Return the rectangles that the convex hulls of several groups of points may cover.

    Args:
        view: Projection of the image.
        points_mm: Points [N, P, 3] in the container frame, in mm; a group in each row.

    Returns:
        int [N, 4]: first column and row, and the column and row after the last, all even or at the
        border of the image. A list of N groups of points [K, 2] in the plane at depth 1 of a
        pinhole camera; their hulls are the parts of the given hulls before the camera. K is 0, and
        the rectangle empty, for a group behind the camera.
    """
    seen = view.to_view(points_mm)
    plane = seen[..., :2] / np.maximum(seen[..., 2:], _LEAST_DEPTH_M)
    low, high, hulls = plane.min(axis=1), plane.max(axis=1), list(plane)
    behind = []
    for k in np.flatnonzero(seen[..., 2].min(axis=1) < _LEAST_DEPTH_M):
        hulls[k] = _before_camera(seen[k])
        if len(hulls[k]):
            low[k], high[k] = hulls[k].min(axis=0), hulls[k].max(axis=0)
        else:
            behind.append(k)
    margin = np.ones((len(plane), 1))
    if view.distortion:
        # the image of a rectangle around the hull is bounded by that of the rectangle's border
        reach = view.distortion.reach
        low, high = (np.clip(corner, -reach, reach)[:, None, None] for corner in (low, high))
        border = view.distortion.apply(low + _SIDES * (high - low))
        low, high = border.min(axis=(1, 2)), border.max(axis=(1, 2))
        # an arc deviates from its chord by an eighth of the second difference
        bow = np.abs(np.diff(border, n=2, axis=2)).max(axis=(1, 2, 3)) / 8
        margin += view.focals_px.max() * bow[:, None]
    center = np.array(view.center_px)
    first = 2 * np.floor((view.focals_px * low + center - margin) / 2)
    last = 2 * np.ceil((view.focals_px * high + center + margin) / 2)
    first[behind] = last[behind] = 0
    corners = np.concatenate([np.clip(first, 0, view.size), np.clip(last, 0, view.size)], axis=1)
    return corners.astype(np.int64), hulls


def _before_camera(seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points [K, 2] in the plane at depth 1, whose hull is the part of a hull deep enough.

    Besides the deep points, these are the points where lines from them to the others are just deep
    enough.

    Args:
        seen: Points [P, 3] in the camera frame.
    """
    depth = seen[:, 2]
    far, near = seen[depth >= _LEAST_DEPTH_M], seen[depth < _LEAST_DEPTH_M]
    share = (_LEAST_DEPTH_M - near[None, :, 2:]) / (far[:, None, 2:] - near[None, :, 2:])
    crossed = near[None] + share * (far[:, None] - near[None])
    points = np.concatenate([far, crossed.reshape(-1, 3)])
    plane: NDArray[np.float64] = points[:, :2] / np.maximum(points[:, 2:], _LEAST_DEPTH_M)
    return plane


def box_corners(
    bounds_mm: tuple[np.ndarray, np.ndarray], damages: tuple[Damage, ...] = ()
) -> np.ndarray:
    """Return the corners of a box that contains a damaged object.

    The box grows by the bulges, and by dents deep enough to come out on the opposite side.

    Args:
        bounds_mm: Lowest and highest corner [3] of the undamaged object.
        damages: Damages of the object.

    Returns:
        Corners [8, 3], mm.
    """
    low, high = bounds_mm
    inward = sum(map(inward_mm, damages)) - (high - low).min()
    bulge = max(inward, sum(map(outward_mm, damages)))
    corners: np.ndarray = low - bulge + UNIT_CUBE * (high - low + 2 * bulge)
    return corners
