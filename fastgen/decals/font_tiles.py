"""Signed-distance tiles of the characters of a font, drawn with Pillow (FreeType).

A tile covers a square of TILE_CAPS cap heights. The ink is centred horizontally, and the baseline
is TILE_BASELINE_CAPS above the bottom. The value 127.5 is on the outline; 0 and 255 are half of
TILE_RANGE_CAPS away from it.
"""

from pathlib import Path
from typing import BinaryIO, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from fastgen.decals.glyphs import BOX, CHARACTERS, GLYPH_TILE_SIZE
from fastgen.decals.lettering import (
    BOX_MARGIN_CAPS,
    BOX_STROKE_CAPS,
    TILE_BASELINE_CAPS,
    TILE_CAPS,
    TILE_RANGE_CAPS,
)

_OVERSAMPLING = 12
_SIDE = GLYPH_TILE_SIZE * _OVERSAMPLING
_CAP_PX = _SIDE / TILE_CAPS
_PROBE_PX = 1000
_NOT_A_CHARACTER = chr(0x10FFFF)
_DIGITS = "0123456789"

Ink = NDArray[np.bool_]


class FontTile(NamedTuple):
    """Tile and metrics of a character; lengths are in cap heights from the pen position.

    Attributes:
        distances: uint8 [GLYPH_TILE_SIZE, GLYPH_TILE_SIZE], row 0 at the top.
        ink_left: Left end of the ink.
        ink_right: Right end of the ink.
        advance: Distance to the next pen position.
    """

    distances: NDArray[np.uint8]
    ink_left: float
    ink_right: float
    advance: float


class Typeface:
    """A font at the size at which its capitals are as high in pixels as tiles need.

    Args:
        font: The font at _PROBE_PX pixels per em.

    Raises:
        ValueError: It has no letter H.
    """

    def __init__(self, font: ImageFont.FreeTypeFont) -> None:
        height = -font.getbbox("H", anchor="ls")[1]
        if height <= 0:
            raise ValueError("H")
        self._font = font.font_variant(size=round(_PROBE_PX * _CAP_PX / height))

    def ink(self, char: str) -> tuple[Ink, float, float]:
        """Return the ink of a character in the square of its tile, and its ends in pixels."""
        left, _, right, _ = self._font.getbbox(char, anchor="ls")
        image = Image.new("L", (_SIDE, _SIDE))
        pen = _SIDE / 2 - (left + right) / 2
        ImageDraw.Draw(image).text(
            (pen, _SIDE - TILE_BASELINE_CAPS * _CAP_PX),
            char,
            fill=255,
            font=self._font,
            anchor="ls",
        )
        return np.asarray(image) > 127, left, right

    def has(self, char: str) -> bool:
        """Return whether the font has a character that shows any ink."""
        drawn, missing = (self._font.getmask(each) for each in (char, _NOT_A_CHARACTER))
        same = drawn.size == missing.size and bytes(drawn) == bytes(missing)
        return drawn.getbbox() is not None and not same

    def fits(self, char: str) -> bool:
        """Return whether all ink of a character is inside its tile."""
        ink, _, _ = self.ink(char)
        return not (ink[[0, -1]].any() or ink[:, [0, -1]].any())

    def tile(self, char: str) -> FontTile:
        """Return the tile of a character."""
        ink, left, right = self.ink(char)
        advance = self._font.getlength(char)
        return FontTile(_distances(ink), left / _CAP_PX, right / _CAP_PX, advance / _CAP_PX)


def typeface(file: Path | BinaryIO) -> Typeface:
    """Open a font.

    Args:
        file: Path or binary file of a TrueType, OpenType or WOFF font.

    Raises:
        OSError: It is not a font.
        ValueError: It has no letter H.
    """
    return Typeface(ImageFont.truetype(file, _PROBE_PX))


def font_tiles(face: Typeface) -> dict[str, FontTile]:
    """Return the tiles of CHARACTERS and of BOX."""
    tiles = {char: face.tile(char) for char in CHARACTERS if char != BOX}
    widest = max(tiles[digit].ink_right - tiles[digit].ink_left for digit in _DIGITS)
    return {**tiles, BOX: _box(widest)}


def _box(digit_caps: float) -> FontTile:
    """Return the frame around a digit whose ink is this wide."""
    place = (np.arange(_SIDE) + 0.5) / _SIDE
    across = np.abs(place - 0.5) * TILE_CAPS
    up = np.abs((1 - place) * TILE_CAPS - TILE_BASELINE_CAPS - 0.5)
    half_width, half_height = digit_caps / 2 + BOX_MARGIN_CAPS, 0.5 + BOX_MARGIN_CAPS
    outside = (across[None] > half_width) | (up[:, None] > half_height)
    inner = (across[None] < half_width - BOX_STROKE_CAPS) & (
        up[:, None] < half_height - BOX_STROKE_CAPS
    )
    return FontTile(_distances(~outside & ~inner), -half_width, half_width, 2 * half_width)


def _distances(ink: Ink) -> NDArray[np.uint8]:
    """Return the tile of ink bool [_SIDE, _SIDE]."""
    inside, outside = (
        cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for part in (ink, ~ink)
    )
    value = 0.5 + (inside - outside) / _CAP_PX / TILE_RANGE_CAPS
    side, more = GLYPH_TILE_SIZE, _OVERSAMPLING
    tile = value.astype(np.float64).reshape(side, more, side, more).mean(axis=(1, 3))
    return np.asarray(np.rint(np.clip(tile, 0, 1) * 255), np.uint8)
