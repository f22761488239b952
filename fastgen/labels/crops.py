"""Text crops: pixels of the legible texts of an image."""

from collections.abc import Iterator, Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.glyphs import font_named
from fastgen.decals.lettering import TILE_BASELINE_CAPS
from fastgen.geometry.damage_law import deform
from fastgen.geometry.shape_library import SHAPES
from fastgen.labels.objects import labelled_decals
from fastgen.sample import Box, LabelledPart, Object, Sample
from fastgen.scene import Decal

_CROP_MARGIN_PX = 3
_LEGIBLE_FRACTION = 0.85
_LEGIBLE_LETTER = 0.5
"""Least visible share of each letter's box, so that every letter of a crop can be read."""

_LETTER_POINTS = 7
"""Sample points along each side of a letter's box."""


def text_crops(sample: Sample, min_text_px: float) -> Iterator[tuple[Object, NDArray[np.uint8]]]:
    """Yield the legible texts of an image.

    Args:
        sample: The labelled image.
        min_text_px: Least height of capitals in pixels, see LabelConfig.

    Yields:
        The text's object and its pixels uint8 [h, w, 3] with a small margin, as a view.
    """
    decals = labelled_decals(sample.scene)
    for item in sample.objects:
        if item.class_name != "text" or not _legible(sample, item, decals, min_text_px):
            continue
        assert item.bbox is not None
        x0, y0, x1, y1 = crop_box(item.bbox, sample.view.size)
        yield item, sample.image[y0:y1, x0:x1]


def crop_box(box: Box, size: tuple[int, int]) -> Box:
    """Return the box of a text's crop: its visible box with a small margin, inside the image.

    Args:
        box: Visible box of the text.
        size: (width, height) of the image.
    """
    x0, y0, x1, y1 = box
    width, height = size
    margin = _CROP_MARGIN_PX
    return (
        max(x0 - margin, 0),
        max(y0 - margin, 0),
        min(x1 + margin, width),
        min(y1 + margin, height),
    )


def part_crop(image: NDArray[np.uint8], part: LabelledPart) -> NDArray[np.uint8]:
    """Return the upright pixels of one part of a text, uint8 [h, w, 3].

    Args:
        image: The image that the part is in, uint8 [H, W, 3].
        part: The part; its quadrilateral becomes a rectangle with a small margin.
    """
    return upright_crop(image, np.array(part.quad).reshape(4, 2))


def upright_crop(image: NDArray[np.uint8], quad: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the pixels of a quadrilateral as a rectangle with a small margin, uint8 [h, w, 3].

    Args:
        image: uint8 [H, W, 3].
        quad: Corners [4, 2] in pixels, clockwise from the upper left.
    """
    upper_left, upper_right, lower_right, lower_left = quad
    right = (upper_right + lower_right - upper_left - lower_left) / 2
    down = (lower_left + lower_right - upper_left - upper_right) / 2
    # pixel i of the crop has its centre at i + 0.5, as in the image; OpenCV counts from centres
    low = _CROP_MARGIN_PX - 0.5
    across, up = (max(round(float(np.linalg.norm(side))), 2) for side in (right, down))
    inner = low + np.array([[0, 0], [across, 0], [across, up], [0, up]])
    matrix = cv2.getPerspectiveTransform((quad - 0.5).astype(np.float32), inner.astype(np.float32))
    size = (across + 2 * _CROP_MARGIN_PX, up + 2 * _CROP_MARGIN_PX)
    warped = cv2.warpPerspective(
        image, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(warped, np.uint8)


def _legible(sample: Sample, item: Object, decals: Mapping[int, Decal], min_text_px: float) -> bool:
    """Test whether a text is large enough along both sides, inside the image, and hardly occluded.

    At most half of each letter may be occluded. Ignored texts, as those hidden by fog, are not
    legible.
    """
    hidden = item.ignored or item.visible_fraction < _LEGIBLE_FRACTION
    if item.bbox is None or item.truncated or hidden:
        return False
    decal = decals[item.id]
    upper_left, _, lower_right, lower_left = np.array(item.quad).reshape(4, 2)
    across = np.linalg.norm(lower_right - lower_left) / decal.size_mm[0]
    up = np.linalg.norm(upper_left - lower_left) / decal.size_mm[1]
    large = min(across, up) * decal.cap_mm >= min_text_px
    return bool(
        large and (not item.occluded or _least_letter(sample, item, decal) >= _LEGIBLE_LETTER)
    )


def _least_letter(sample: Sample, item: Object, decal: Decal) -> float:
    """Return the smallest visible share of any letter; a locking bar can hide an I."""
    font = font_named(decal.font)
    lettering = decal.lettering
    middle = np.array(lettering.size_mm) / 2
    steps = (np.arange(_LETTER_POINTS) + 0.5) / _LETTER_POINTS - 0.5
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    letters = []
    for glyph in lettering.glyphs:
        ink = font.glyphs[glyph.char]
        base = glyph.y0 + TILE_BASELINE_CAPS * decal.cap_mm
        center = np.array([(glyph.x0 + glyph.x1) / 2, base + decal.cap_mm / 2]) - middle
        letters.append(center + grid * decal.cap_mm * (ink.ink_right - ink.ink_left, 1.0))
    sheet = np.concatenate(letters) @ decal.turn.T + np.array(decal.center_mm)
    seen = sample.container_at(item.container)
    mesh = SHAPES.container(seen.container.kind, seen.container.profiles)
    rest, _ = mesh.sheet_to_surface(decal.face, sheet)
    pixels, _ = seen.view.project(deform(seen.damages, rest))
    columns, rows = np.clip(np.floor(pixels).astype(int), 0, np.array(sample.view.size) - 1).T
    shown = sample.ids[rows, columns] == item.id
    return float(shown.reshape(len(letters), -1).mean(axis=1).min())
