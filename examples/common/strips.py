"""Conversion of a text crop to one line: slant removed, rows and letters of columns side by
side."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from fastgen.decals.lettering import GLYPH_PITCH_CAPS

Grey = NDArray[Any]
"""A grey image [h, w], uint8 or float32."""

HEIGHT, WIDTH = 24, 400
"""Size of a strip in pixels."""

LETTER_WIDTH = 32
"""Width of a single letter in pixels; it is as high as a strip."""

_UPRIGHT = 1.6  # ratio of height to width above which a crop contains columns
_SLANTS = np.linspace(-0.3, 0.3, 31)
_SHARE = 0.1  # margin on each side of a row or letter, as a share of its height
_MARGIN_PX = 3  # margin of a crop around its ink
_NUMBER, _ALL = 11, 15  # letters of an identifier, without and with its size and type
_GAP_CAPS = 0.6  # extra length of a space in a column, in cap heights
_GRAIN = 6.0  # largest standard deviation of added noise, in steps of 255
_TILTS = np.linspace(-0.3, 0.3, 25)  # perspective of a column that tilts away from the camera


def strip(crop: torch.Tensor) -> torch.Tensor:
    """Convert a crop uint8 [3, h, w] to a grey strip, uint8 [1, HEIGHT, WIDTH].

    Rows are placed side by side, and columns are cut into letters. The number of rows or columns
    follows from the proportions of the text after removing its slant.
    """
    return torch.from_numpy(_in_one_line(_parts(_grey(crop))))[None]


def letters(crop: torch.Tensor) -> list[torch.Tensor]:
    """Return the letters of a crop with columns, uint8 [1, HEIGHT, LETTER_WIDTH] each; none for
    rows."""
    grey = _grey(crop)
    if not _upright(grey):
        return []
    return [torch.from_numpy(_in_one_line([part], LETTER_WIDTH))[None] for part in _parts(grey)]


def varied(strips: torch.Tensor) -> torch.Tensor:
    """Randomly stretch, shift and slant strips float32 [B, 1, H, W], and add noise."""

    def drawn(low: float, high: float) -> torch.Tensor:
        return torch.empty(len(strips), device=strips.device).uniform_(low, high)

    # coordinates run from -1 to 1; stretching leaves the left end, where the text starts, in place
    wide, high = drawn(0.9, 1.12), drawn(0.85, 1.2)
    across = [wide, drawn(-0.012, 0.012), wide - 1 + drawn(-0.04, 0.03)]
    down = [drawn(-0.25, 0.25), high, drawn(-0.15, 0.15)]
    maps = torch.stack([torch.stack(across, dim=1), torch.stack(down, dim=1)], dim=1)
    grid = functional.affine_grid(maps, list(strips.shape), align_corners=False)
    moved = functional.grid_sample(strips, grid, padding_mode="border", align_corners=False)
    return moved + torch.randn_like(moved) * drawn(0, _GRAIN)[:, None, None, None]


def straightened(grey: Grey) -> Grey:
    """Shear an image [h, w] vertically so that its rows are level, and cut off the empty edges.

    Rows are level when strokes concentrate in the fewest image rows.
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
    """Return the number of rows of a level text of shape (height, width).

    Columns, turned on their side, are one or two; a block has two or three rows.
    """
    proportion = shape[1] / shape[0]
    if upright:
        return 1 if proportion > 9 else 2
    return 2 if proportion > 2.2 else 3


def letter_places(column: Grey, columns: int) -> list[tuple[float, float]]:
    """Return the start and end of each letter of a column, in rows of the image.

    The image [h, w] is the first of `columns` columns. Letters are equally spaced, but perspective
    makes one end of a column larger. Of several perspective ratios, this takes the one with the
    fewest strokes between letters.
    """
    count, gap = (_NUMBER, 0.0) if columns > 1 else (_ALL, _GAP_CAPS)
    middles = np.arange(count) * GLYPH_PITCH_CAPS + gap * (np.arange(count) >= _NUMBER) + 0.5
    ends = middles[:, None] + GLYPH_PITCH_CAPS * np.array([-0.5, 0.5])
    share = ends / (middles[-1] + 0.5)
    strokes = np.abs(cv2.Sobel(column, cv2.CV_32F, 1, 0, ksize=3)).mean(axis=1)
    ink = len(column) - 2 * _MARGIN_PX
    best, found = np.inf, ends
    for tilt in _TILTS:
        # perspective of a straight line with fixed ends
        places = _MARGIN_PX + ink * share / (1 + tilt * (1 - share))
        between = float(np.interp(places, np.arange(len(strokes)) + 0.5, strokes).mean())
        if between < best:
            best, found = between, places
    return [(float(low), float(high)) for low, high in found]


def _grey(crop: torch.Tensor) -> Grey:
    return cv2.cvtColor(np.ascontiguousarray(crop.permute(1, 2, 0).numpy()), cv2.COLOR_RGB2GRAY)


def _upright(grey: Grey) -> bool:
    upright: bool = grey.shape[0] > _UPRIGHT * grey.shape[1]
    return upright


def _parts(grey: Grey) -> list[Grey]:
    """Return the rows of a text, or the letters of columns, in reading order."""
    upright = _upright(grey)
    level = straightened(_turned(grey) if upright else grey)
    if upright:  # the letters of both columns are level with each other, too
        level = _turned(straightened(_turned(level)))
    count = row_count(level.shape, upright)
    pitch = level.shape[0] / count
    bands = [_cut(level, row * pitch, (row + 1) * pitch) for row in range(count)]
    if not upright:
        return bands
    columns = [_turned(band) for band in bands]
    places = letter_places(columns[0], count)
    which = [places, places[: _ALL - _NUMBER]][:count]
    return [_cut(c, *ends) for c, each in zip(columns, which, strict=True) for ends in each]


def _sheared(image: Grey, slant: float) -> Grey:
    height, width = image.shape
    matrix = np.array([[1, 0, 0], [slant, 1, -slant * width / 2]], np.float32)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(
        image, matrix, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE
    )


def _turned(image: Grey) -> Grey:
    return np.ascontiguousarray(image.T)


def _cut(image: Grey, low: float, high: float) -> Grey:
    """Return the rows from low to high of an image [h, w], with a margin."""
    share = _SHARE * (high - low)
    return image[max(round(low - share), 0) : min(round(high + share), len(image))]


def _in_one_line(parts: Sequence[Grey], width: int = WIDTH) -> Grey:
    """Join images [h, w] side by side at HEIGHT, and pad with the median of each row."""
    scaled = []
    for part in parts:
        wide = max(round(part.shape[1] * HEIGHT / part.shape[0]), 1)
        scaled.append(cv2.resize(part, (wide, HEIGHT), interpolation=cv2.INTER_LINEAR))
    line = np.concatenate(scaled, axis=1)
    if line.shape[1] >= width:
        return cv2.resize(line, (width, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.pad(line, ((0, 0), (0, width - line.shape[1])), mode="median")
