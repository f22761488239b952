"""Rectangles of an image: where something may be seen."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fastgen.camera.projection import View
from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.scene import Damage
from fastgen.scene.limits import NEAR_M

Region = tuple[int, int, int, int]
"""x, y, width and height in pixels."""

_BOW_STEPS = 17
"""Points along a line that a lens may bend, where bounds of it are asked for."""


def bands(regions: Sequence[Region | None]) -> list[Region | None]:
    """Disjoint regions, the upper first, that hold all of `regions`; None is the whole image.

    Each row is held from the leftmost to the rightmost column of the regions that it crosses.
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
    """Disjoint regions that hold all of `regions`, those that overlap within the least rectangle
    about them; None is the whole image."""
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
    """Disjoint regions that hold all of `regions`, disjoint ones, but what lies in `others`."""
    left = list(regions)
    for x, y, width, height in others:
        found = []
        for a, b, w, h in left:
            # above and below whole, beside it what is left of the rows between
            top, bottom = (min(max(row, b), b + h) for row in (y, y + height))
            first, last = (min(max(column, a), a + w) for column in (x, x + width))
            found += [(a, b, w, top - b), (a, bottom, w, b + h - bottom)]
            found += [(a, top, first - a, bottom - top), (last, top, a + w - last, bottom - top)]
        left = [part for part in found if part[2] > 0 and part[3] > 0]
    return left


def within(regions: Sequence[Region | None], other: Region) -> list[Region]:
    """What of each of `regions`, None for the whole image, lies in `other`."""
    x, y, width, height = other
    found = []
    for left, top, across, down in (region or other for region in regions):
        first, last = max(left, x), min(left + across, x + width)
        upper, lower = max(top, y), min(top + down, y + height)
        if first < last and upper < lower:
            found.append((first, upper, last - first, lower - upper))
    return found


def region_of(view: View, corners_mm: np.ndarray) -> Region | None:
    """The pixels that the hull of corners [N, 3] may touch; None if it reaches behind us."""
    if view.distortion:  # what lies between two corners may bow out farther than both
        a, b = corners_mm[:, None, None], corners_mm[:, None]
        corners_mm = a + np.linspace(0, 1, _BOW_STEPS)[:, None] * (b - a)
    pixels, depth = view.project(corners_mm)
    if depth.min() <= NEAR_M:
        return None
    margin = 1.0
    if view.distortion:  # an arc leaves its chord by an eighth of the second difference
        margin += np.abs(np.diff(pixels, n=2, axis=-2)).max() / 8
    pixels = pixels.reshape(-1, 2)
    # of whole blocks of two by two pixels, see classify.comp
    x0, y0 = np.clip(2 * np.floor((pixels.min(axis=0) - margin) / 2), 0, view.size)
    x1, y1 = np.clip(2 * np.ceil((pixels.max(axis=0) + margin) / 2), 0, view.size)
    return int(x0), int(y0), int(x1 - x0), int(y1 - y0)


def box_corners(
    bounds_mm: tuple[np.ndarray, np.ndarray], damages: tuple[Damage, ...] = ()
) -> np.ndarray:
    """Corners [8, 3] of the box between two opposite corners [3], bulges of damage included, and
    dents so deep that they come out on the other side."""
    low, high = bounds_mm
    inward = sum(max(damage.depth_mm, 0.0) for damage in damages) - (high - low).min()
    bulge = max(inward, sum(max(-damage.depth_mm, 0.0) for damage in damages))
    return low - bulge + UNIT_CUBE * (high - low + 2 * bulge)
