"""Text layout, shared by sampling, labels and renderer: the position of each letter."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from fastgen.decals.artwork import Font
from fastgen.errors import AssetError

TILE_CAPS = 1.6
"""Side of the square that a glyph's tile covers, in cap heights; ink is centred horizontally."""

TILE_BASELINE_CAPS = 0.3
"""Height of the baseline above the tile's bottom, in cap heights."""

TILE_RANGE_CAPS = 0.3
"""Distance across the outline over which tile values go from 0 to 255, in cap heights."""

LINE_PITCH_CAPS = 1.5
"""Distance between the baselines of horizontal lines, in cap heights."""

COLUMN_PITCH_CAPS = 1.6
"""Distance between the centres of vertical columns, in cap heights."""

GLYPH_PITCH_CAPS = 1.35
"""Distance between the baselines of the glyphs of a column, in cap heights."""


class PlacedGlyph(NamedTuple):
    """Tile rectangle of one glyph, in mm from the lower left corner of the text's ink box.

    Attributes:
        char: The character.
        tile: Index into the tiles of `glyph_tiles`.
        x0: Left edge.
        y0: Bottom edge.
        x1: Right edge.
        y1: Top edge.
    """

    char: str
    tile: int
    x0: float
    y0: float
    x1: float
    y1: float


@dataclass(frozen=True)
class Lettering:
    """Layout of one text.

    Attributes:
        size_mm: Width of the ink, and height from the lowest baseline to the capitals' tops.
        glyphs: Glyphs of all characters except spaces.
    """

    size_mm: tuple[float, float]
    glyphs: tuple[PlacedGlyph, ...]


@lru_cache(maxsize=64)  # Sampling, renderer and labels lay out the same texts.
def layout(lines: tuple[str, ...], font: Font, cap_mm: float, vertical: bool = False) -> Lettering:
    """Lay out a text.

    Args:
        lines: The text, one string per line.
        font: Font of all letters.
        cap_mm: Height of the capitals.
        vertical: False for left-aligned lines, the first at the top. True for columns from left to
            right: upright glyphs one below the other, centred in their column.

    Returns:
        Size of the text and position of each glyph.

    Raises:
        AssetError: The font has no glyph for a character.
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


_Ink = tuple[str, float, float, float]
"""Character, left end of the ink, baseline and ink width, in cap heights."""


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
