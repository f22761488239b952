"""Rectangular regions of an image, set operations on them, and regions that objects project to."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fastgen.camera.projection import View
from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.scene import Damage
from fastgen.scene.limits import NEAR_M

Region = tuple[int, int, int, int]
"""Left column, top row, width and height in pixels."""

_BOW_STEPS = 17
"""Points on a straight edge whose image is curved by lens distortion."""


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


def region_of(view: View, corners_mm: np.ndarray) -> Region | None:
    """Return the region that the convex hull of some points may cover.

    Args:
        view: Projection of the image.
        corners_mm: Points [N, 3] in the container frame.

    Returns:
        Region aligned to 2x2 pixel blocks, which classify.comp needs; None if a point lies nearer
        than the near plane.
    """
    if view.distortion:  # A curved edge may extend beyond both of its corners.
        a, b = corners_mm[:, None, None], corners_mm[:, None]
        corners_mm = a + np.linspace(0, 1, _BOW_STEPS)[:, None] * (b - a)
    pixels, depth = view.project(corners_mm)
    if depth.min() <= NEAR_M:
        return None
    margin = 1.0
    if view.distortion:  # An arc deviates from its chord by an eighth of the second difference.
        margin += np.abs(np.diff(pixels, n=2, axis=-2)).max() / 8
    pixels = pixels.reshape(-1, 2)
    x0, y0 = np.clip(2 * np.floor((pixels.min(axis=0) - margin) / 2), 0, view.size)
    x1, y1 = np.clip(2 * np.ceil((pixels.max(axis=0) + margin) / 2), 0, view.size)
    return int(x0), int(y0), int(x1 - x0), int(y1 - y0)


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
    inward = sum(max(damage.depth_mm, 0.0) for damage in damages) - (high - low).min()
    bulge = max(inward, sum(max(-damage.depth_mm, 0.0) for damage in damages))
    corners: np.ndarray = low - bulge + UNIT_CUBE * (high - low + 2 * bulge)
    return corners
