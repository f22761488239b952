"""A text crop laid out as one line: columns turned over, slant taken out, rows side by side."""

from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

Grey = NDArray[Any]
"""A grey image [h, w], uint8 or float32."""

HEIGHT, WIDTH = 24, 400
"""Pixels of a strip."""

_UPRIGHT = 1.6  # a crop this many times as high as wide holds columns
_SLANTS = np.linspace(-0.3, 0.3, 31)
_ROW_SHARE = 0.1  # of its height that a row also shows of its neighbours, each side


def strip(crop: torch.Tensor) -> torch.Tensor:
    """A crop uint8 [3, h, w] as a grey strip, uint8 [1, HEIGHT, WIDTH].

    Columns are transposed, so that their letters run to the right, lying on their sides. How many
    rows there are follows from the proportions of the text without its slant.
    """
    grey = cv2.cvtColor(np.ascontiguousarray(crop.permute(1, 2, 0).numpy()), cv2.COLOR_RGB2GRAY)
    upright = grey.shape[0] > _UPRIGHT * grey.shape[1]
    level = straightened(np.ascontiguousarray(grey.T) if upright else grey)
    return torch.from_numpy(_in_one_line(level, row_count(level.shape, upright)))[None]


def straightened(grey: Grey) -> Grey:
    """Shear [h, w] vertically so that its rows are level, and cut off what that leaves empty.

    Level rows are where strokes gather in the fewest image rows.
    """
    height, width = grey.shape
    best, slant = -1.0, 0.0
    strokes = np.abs(cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=3))
    for candidate in _SLANTS:
        if abs(candidate) * width > 0.6 * height:
            continue
        profile = _sheared(strokes, float(candidate)).mean(axis=1)
        if (gathered := float(profile.var())) > best:
            best, slant = gathered, float(candidate)
    spare = int(abs(slant) * width / 2)
    level = _sheared(grey, slant)
    return level[spare : height - spare] if height - 2 * spare >= 4 else level


def row_count(shape: tuple[int, int], upright: bool) -> int:
    """Rows of a level text (height, width): a column is one or two, a block two or three."""
    proportion = shape[1] / shape[0]
    if upright:
        return 1 if proportion > 9 else 2
    return 2 if proportion > 2.2 else 3


def _sheared(image: Grey, slant: float) -> Grey:
    height, width = image.shape
    matrix = np.array([[1, 0, 0], [slant, 1, -slant * width / 2]], np.float32)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(
        image, matrix, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE
    )


def _in_one_line(level: Grey, rows: int) -> Grey:
    height, width = level.shape
    pitch, parts = height / rows, []
    for row in range(rows):
        low = max(round((row - _ROW_SHARE) * pitch), 0)
        high = min(round((row + 1 + _ROW_SHARE) * pitch), height)
        part = level[low:high]
        wide = max(round(width * HEIGHT / part.shape[0]), 1)
        parts.append(cv2.resize(part, (wide, HEIGHT), interpolation=cv2.INTER_LINEAR))
    line = np.concatenate(parts, axis=1)
    if line.shape[1] >= WIDTH:
        return cv2.resize(line, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.pad(line, ((0, 0), (0, WIDTH - line.shape[1])), mode="median")
