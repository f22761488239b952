"""Images of the detector's size: whole images with a margin, and random crops for training."""

import math
from typing import Any

import cv2
import numpy as np
import torch
from real_crops import BoxedImage

CANVAS_PX = 384
"""Side of the detector's square images."""

Example = tuple[torch.Tensor, dict[str, Any]]
"""Image uint8 [3, CANVAS_PX, CANVAS_PX], and its boxes in the loader's detection form. Boxes to
ignore have `iscrowd` 1."""

_MARGIN_GREY = 114
_SCALES = (0.5, 1.5)
_STRETCH = 0.08
_GREY_SHARE = 0.1
_LEAST_SIDE_PX = 4.0
_LEAST_SHARE = 0.1
"""A box with a shorter side, or with a smaller share inside the image, becomes one to ignore."""


def fitted(image: BoxedImage) -> Example:
    """Return a whole image, scaled to the canvas, with a grey margin around it."""
    height, width = image.pixels.shape[:2]
    scale = CANVAS_PX / max(width, height)
    size = round(width * scale), round(height * scale)
    return _placed(image, size, ((CANVAS_PX - size[0]) // 2, (CANVAS_PX - size[1]) // 2))


def varied(image: BoxedImage, rng: np.random.Generator) -> Example:
    """Return a random crop of an image, or the whole image with a grey margin.

    The scale is 0.5 to 1.5 times that of `fitted`, with a slight random stretch. Half of the
    results are mirrored, and a tenth have no color.
    """
    height, width = image.pixels.shape[:2]
    scale = CANVAS_PX / max(width, height) * math.exp(rng.uniform(*np.log(_SCALES)))
    stretch = math.exp(_STRETCH * rng.standard_normal())
    size = round(width * scale * stretch), round(height * scale / stretch)
    spare = [CANVAS_PX - side for side in size]
    left, top = (int(rng.integers(min(each, 0), max(each, 0) + 1)) for each in spare)
    pixels, target = _placed(image, size, (left, top))
    if rng.random() < 0.5:
        pixels = pixels.flip(2)
        target["boxes"][:, [0, 2]] = CANVAS_PX - target["boxes"][:, [2, 0]]
    if rng.random() < _GREY_SHARE:
        pixels = pixels.float().mean(0, keepdim=True).byte().expand(3, -1, -1)
    return pixels, target


def _placed(image: BoxedImage, size: tuple[int, int], corner: tuple[int, int]) -> Example:
    """Return an image scaled to `size` with its upper left pixel at `corner` of the canvas."""
    height, width = image.pixels.shape[:2]
    way = cv2.INTER_AREA if size[0] < width else cv2.INTER_LINEAR
    scaled = cv2.resize(image.pixels, size, interpolation=way)
    canvas = np.full((CANVAS_PX, CANVAS_PX, 3), _MARGIN_GREY, np.uint8)
    left, top = corner
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + size[0], CANVAS_PX), min(top + size[1], CANVAS_PX)
    canvas[y0:y1, x0:x1] = scaled[y0 - top : y1 - top, x0 - left : x1 - left]
    factors = np.array([size[0] / width, size[1] / height] * 2)
    whole = image.boxes * factors + np.array([left, top] * 2)
    boxes = whole.clip(0, CANVAS_PX)
    sides = boxes[:, 2:] - boxes[:, :2]
    area, full = sides.prod(axis=1), (whole[:, 2:] - whole[:, :2]).prod(axis=1)
    hard = (sides.min(axis=1, initial=np.inf) < _LEAST_SIDE_PX) | (area < _LEAST_SHARE * full)
    kept = area > 0
    target = {
        "boxes": torch.from_numpy(boxes[kept]).float(),
        "labels": torch.ones(int(kept.sum()), dtype=torch.int64),
        "area": torch.from_numpy(area[kept]).float(),
        "iscrowd": torch.from_numpy((image.ignored | hard)[kept].astype(np.int64)),
    }
    return torch.from_numpy(canvas.transpose(2, 0, 1).copy()), target
