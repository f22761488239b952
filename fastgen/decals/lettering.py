"""Where the letters of a text stand: the one layout that markings, labels and renderer share."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from fastgen.decals.artwork import Font
from fastgen.errors import AssetError

TILE_CAPS = 1.6
"""A glyph's tile covers a square of this many cap heights, its ink centred across it."""

TILE_BASELINE_CAPS = 0.3
"""The baseline lies this far above the tile's bottom, in cap heights."""

TILE_RANGE_CAPS = 0.3
"""Distance in cap heights over which a tile's values go from 0 to 1."""

LINE_PITCH_CAPS = 1.5
COLUMN_PITCH_CAPS = 1.6
GLYPH_PITCH_CAPS = 1.35


class PlacedGlyph(NamedTuple):
    """A glyph's tile rectangle in mm; origin at the lower left corner of the text's ink box."""

    char: str
    tile: int
    x0: float
    y0: float
    x1: float
    y1: float


@dataclass(frozen=True)
class Lettering:
    """size_mm: width and height of the box around the ink. glyphs: all that leave ink."""

    size_mm: tuple[float, float]
    glyphs: tuple[PlacedGlyph, ...]


@lru_cache(maxsize=64)  # who chooses a text, who draws it and who crops it ask alike
def layout(lines: tuple[str, ...], font: Font, cap_mm: float, vertical: bool = False) -> Lettering:
    """Set `lines` in `font` with capitals `cap_mm` high.

    Horizontal lines run to the right, one below the other, all starting at the left. Vertical
    lines are columns from left to right, their glyphs upright, one below the other, centred.
    Raises AssetError for a character that the font does not have.
    """
    for char in "".join(lines):
        if char not in font.glyphs and char != " ":
            raise AssetError(f"font {font.name}: no glyph for {char!r}; use other characters")
    place = _columns if vertical else _rows
    inks = place(lines, font)
    right = max(x + width for _, x, _, width in inks)
    left = min(x for _, x, _, _ in inks)
    bottom = min(y for _, _, y, _ in inks)
    top = max(y for _, _, y, _ in inks) + 1.0
    glyphs = []
    for char, x, y, width in inks:
        x0 = (x - left + width / 2 - TILE_CAPS / 2) * cap_mm
        y0 = (y - bottom - TILE_BASELINE_CAPS) * cap_mm
        side = TILE_CAPS * cap_mm
        glyphs.append(PlacedGlyph(char, font.glyphs[char].tile, x0, y0, x0 + side, y0 + side))
    size = (round((right - left) * cap_mm, 1), round((top - bottom) * cap_mm, 1))
    return Lettering(size, tuple(glyphs))


_Ink = tuple[str, float, float, float]  # char, left and baseline in cap heights, width


def _rows(lines: Sequence[str], font: Font) -> list[_Ink]:
    inks: list[_Ink] = []
    for row, line in enumerate(lines):
        pen = 0.0
        for char in line:
            if char == " ":
                pen += 0.45
                continue
            glyph = font.glyphs[char]
            width = glyph.ink_right - glyph.ink_left
            inks.append((char, pen + glyph.ink_left, -row * LINE_PITCH_CAPS, width))
            pen += glyph.advance
    return inks


def _columns(lines: Sequence[str], font: Font) -> list[_Ink]:
    inks: list[_Ink] = []
    for column, line in enumerate(lines):
        y = 0.0
        for char in line:
            if char == " ":
                y -= 0.6
                continue
            width = font.glyphs[char].ink_right - font.glyphs[char].ink_left
            inks.append((char, column * COLUMN_PITCH_CAPS - width / 2, y, width))
            y -= GLYPH_PITCH_CAPS
    return inks
