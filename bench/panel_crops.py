"""Square crops of walls with and without damage, and square crops in general."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DAMAGE_CLASSES, DAMAGE_VALUES
from fastgen.sample import Sample

Pixels = NDArray[np.uint8]
"""RGB picture [H, W, 3]."""

PANEL_PX = 80
"""Side of a panel."""

MARGIN = 0.1
"""Total margin of a marker's crop, as a share of its box."""


def panels_of(sample: Sample, rng: np.random.Generator) -> list[tuple[Pixels, str]]:
    """Return a square around each damage, and as large a square of undamaged container."""
    damaged = np.isin(sample.damage, np.array(DAMAGE_VALUES))
    height, width = damaged.shape
    found = []
    for item in sample.objects:
        if item.class_name not in DAMAGE_CLASSES or item.bbox is None:
            continue
        if item.area < 60 or item.visible_fraction < 0.5:
            continue
        side = max(item.bbox[2] - item.bbox[0], item.bbox[3] - item.bbox[1]) * float(
            rng.uniform(1.2, 3.0)
        )
        side = min(max(side, 40.0), 0.9 * min(height, width))
        middle = np.array([item.bbox[0] + item.bbox[2], item.bbox[1] + item.bbox[3]]) / 2
        corner = middle - side / 2 + rng.uniform(-0.15, 0.15, 2) * side
        corner = corner.clip(0, (width - side, height - side))
        found.append((_square(sample.image, corner, side), item.class_name))
        for _ in range(12):
            x, y = rng.uniform(0, (width - side, height - side))
            area = np.s_[int(y) : int(y + side), int(x) : int(x + side)]
            if (sample.ids[area] > 0).mean() > 0.8 and not damaged[area].any():
                found.append((_square(sample.image, (x, y), side), ""))
                break
    return found


def _square(image: Pixels, corner: Any, side: float) -> Pixels:
    x, y = corner
    return square_crop(image, (x, y, x + side, y + side), PANEL_PX, margin=0.0)


def square_crop(image: Pixels, box: Sequence[float], side: int, margin: float = MARGIN) -> Pixels:
    """Return the square around a box with a margin, scaled to [side, side, 3]."""
    x0, y0, x1, y1 = box
    half = max(x1 - x0, y1 - y0) * (1 + margin) / 2
    left, top = round((x0 + x1) / 2 - half), round((y0 + y1) / 2 - half)
    size = max(round(2 * half), 1)
    height, width = image.shape[:2]
    pad = max(0, -left, -top, left + size - width, top + size - height)
    if pad:
        image = cv2.copyMakeBorder(image, pad, pad, pad, pad, cv2.BORDER_REPLICATE).astype(np.uint8)
    cut = image[top + pad : top + pad + size, left + pad : left + pad + size]
    way = cv2.INTER_AREA if size > side else cv2.INTER_LINEAR
    return cv2.resize(cut, (side, side), interpolation=way).astype(np.uint8)
