"""Bit masks of the props that each tile of an image may show, or that may shade its ground."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.render.constants import TILE_PX
from fastgen.render.regions import Region, merged
from fastgen.scene.boxes import OrientedBox

_LONGEST_SHADOW_MM = 60000.0

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def tile_masks(shown: Ints, shaded: Ints, size: tuple[int, int]) -> NDArray[np.uint32]:
    """Return the bit masks of the tiles of an image.

    Args:
        shown: Rectangles [N, 4] that the props may cover, as hull_corners returns them; N up to 64.
        shaded: Rectangles [N, 4] in which they may shade the ground.
        size: (width, height) of the image in pixels.

    Returns:
        uint32 [rows, columns, 4]: two masks of 64 bits, low word first. Bit k of the first is set
        in tiles that may show prop k, bit k of the second where prop k may shade the ground.
    """
    across, down = (np.arange(-(-side // TILE_PX)) * TILE_PX for side in size)
    words = []
    for rectangles in (shown, shaded):
        x0, y0, x1, y1 = rectangles.T[..., None]
        in_column = (x0 < across + TILE_PX) & (across < x1)
        in_row = (y0 < down + TILE_PX) & (down < y1)
        bits = np.zeros((64, len(down), len(across)), bool)
        bits[: len(rectangles)] = in_row[:, :, None] & in_column[:, None]
        packed = np.packbits(bits, axis=0, bitorder="little")
        words.append(np.moveaxis(packed, 0, -1).copy().view("<u4"))
    return np.concatenate(words, axis=-1).astype(np.uint32)


def joined(rectangles: Ints) -> list[Region]:
    """Return disjoint regions around rectangles [N, 4]; empty rectangles are left out."""
    regions = [
        (x0, y0, x1 - x0, y1 - y0) for x0, y0, x1, y1 in rectangles.tolist() if x0 < x1 and y0 < y1
    ]
    return [region for region in merged(regions) if region is not None]


def reaches(
    boxes: Sequence[OrientedBox], ground_mm: float, toward: Array, margin_mm: float
) -> Array:
    """Return points [N, 16, 3]; each row's hull contains a box, its margin and its shadow, in mm.

    Args:
        boxes: Boxes above the ground.
        ground_mm: Height of the ground.
        toward: Unit vector [3] to the light.
        margin_mm: Horizontal margin around each box.
    """
    corners = np.stack([box.corners_mm for box in boxes])
    low, high = corners.min(axis=1), corners.max(axis=1)
    low[:, :2], high[:, :2] = low[:, :2] - margin_mm, high[:, :2] + margin_mm
    low[:, 2] = np.minimum(low[:, 2], ground_mm)
    above = np.maximum(corners[..., 2:] - ground_mm, 0)
    thrown = -toward[:2] * above / max(toward[2], 1e-3)
    far = np.linalg.norm(thrown, axis=-1, keepdims=True)
    thrown *= np.minimum(1, _LONGEST_SHADOW_MM / np.maximum(far, 1)) * 1.02
    shadows = np.concatenate(
        [corners[..., :2] + thrown, np.full_like(corners[..., :1], ground_mm)], axis=-1
    )
    return np.concatenate(
        [_cuboids(low, high), _cuboids(shadows.min(axis=1), shadows.max(axis=1))], axis=1
    )


def _cuboids(low: Array, high: Array) -> Array:
    """Return the corners [N, 8, 3] of upright boxes from their lowest and highest points [N, 3]."""
    corners: Array = low[:, None] + UNIT_CUBE * (high - low)[:, None]
    return corners
