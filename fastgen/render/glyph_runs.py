"""Letters of a text in an order that lets the shader test only the letters near a point."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.decals.glyphs import (
    CHARACTERS,
    GLYPH_EXTENT_STEPS,
    GLYPH_MOST_INK,
    GLYPH_TILE_SIZE,
    extents_of,
    glyph_extents,
    glyph_sums,
    glyph_tiles,
    ink_of,
)
from fastgen.decals.lettering import TILE_CAPS, TILE_RANGE_CAPS, Lettering
from fastgen.decals.own_fonts import OwnFont
from fastgen.scene.limits import GLYPH_RANGE

DEFINES = {
    "GLYPH_TILE_SIZE": f"{GLYPH_TILE_SIZE:.1f}",
    "GLYPH_MOST_INK": f"{GLYPH_MOST_INK:.1f}",
    "GLYPH_EXTENT_STEPS": f"{GLYPH_EXTENT_STEPS}u",
    "GLYPH_TILE_CAPS": f"{TILE_CAPS}",
    "GLYPH_RANGE_CAPS": f"{TILE_RANGE_CAPS}",
    "GLYPH_RANGE": f"{GLYPH_RANGE}u",
}
"""Constants of shaders/decal.glsl."""

_SLACK = 0.01
"""Tolerance, as a share of a tile's side, for points that rounding moves to the next part."""


class GlyphTable(NamedTuple):
    """Glyphs of fastgen's fonts, then those of a configuration's fonts.

    Attributes:
        tiles: uint8 [G, GLYPH_TILE_SIZE, GLYPH_TILE_SIZE], see glyphs.glyph_tiles.
        sums: uint16 [G, GLYPH_TILE_SIZE, GLYPH_TILE_SIZE], see glyphs.glyph_sums.
        extents: int64 [G, 2], see glyphs.extents_of.
        first: Index of the first tile of each of the configuration's fonts, by name.
    """

    tiles: NDArray[np.uint8]
    sums: NDArray[np.uint16]
    extents: NDArray[np.int64]
    first: Mapping[str, int]


def all_glyphs(fonts: Sequence[OwnFont] = ()) -> GlyphTable:
    """Return the glyphs of fastgen's fonts and of a configuration's fonts."""
    tiles, _ = glyph_tiles()
    if not fonts:
        return GlyphTable(tiles, glyph_sums(), glyph_extents(), {})
    first = {own.font.name: len(tiles) + len(CHARACTERS) * i for i, own in enumerate(fonts)}
    own = np.concatenate([each.tiles for each in fonts])
    ink = ink_of(own)
    return GlyphTable(
        np.concatenate([tiles, own]),
        np.concatenate([glyph_sums(), ink["sums"]]),
        np.concatenate([glyph_extents(), extents_of(ink["coverage"])]),
        first,
    )


class GlyphRun(NamedTuple):
    """Letters of a text, and the letters that reach into each part of the text.

    A text of G letters is divided into G equal parts along its longer side. The first and the last
    part continue beyond the ends of the text.

    Attributes:
        glyphs: float32 [G, 4], sorted along the longer side. Row i holds the centre (x, y) of
            letter i in mm from the centre of the text, (tile * GLYPH_EXTENT_STEPS + half width) *
            GLYPH_EXTENT_STEPS + half height, see GlyphTable, and first * GLYPH_RANGE + end. The
            letters from `first` up to, but not including, `end` reach into part i.
        parts_per_mm: Parts per mm of the longer side; negative if that is the vertical side.
    """

    glyphs: NDArray[np.float32]
    parts_per_mm: float


def glyph_run(lettering: Lettering, extents: NDArray[np.int64], first: int = 0) -> GlyphRun:
    """Return the letters of a text in the order of the shader's glyph table.

    Args:
        lettering: Layout of a text with at least 1 and fewer than GLYPH_RANGE glyphs.
        extents: See GlyphTable.
        first: Index of the first tile of its font.

    Returns:
        Letters and parts of the text.
    """
    count = len(lettering.glyphs)
    rows = np.array([(*glyph[2:], glyph.tile) for glyph in lettering.glyphs])
    width, height = lettering.size_mm
    axis = int(height > width)
    rows = rows[np.argsort(rows[:, axis], kind="stable")]
    center_x = (rows[:, 0] + rows[:, 2] - width) / 2
    center_y = (rows[:, 1] + rows[:, 3] - height) / 2
    side = rows[0, 2] - rows[0, 0]
    # Sizes are rounded to 0.1 mm, so the size of a tiny text may be 0.
    length = max(width, height, side)
    along = center_y if axis else center_x
    borders = length * (np.arange(count + 1) / count - 0.5)
    borders[[0, -1]] = -np.inf, np.inf
    tile = first + rows[:, 4].astype(np.int64)
    ends = extents[tile]
    reach = (ends[:, axis].max() / GLYPH_EXTENT_STEPS + _SLACK) * side
    first = np.searchsorted(along, borders[:-1] - reach)
    end = np.searchsorted(along, borders[1:] + reach, side="right")
    code = (tile * GLYPH_EXTENT_STEPS + ends[:, 0]) * GLYPH_EXTENT_STEPS + ends[:, 1]
    glyphs = np.stack([center_x, center_y, code, first * GLYPH_RANGE + end], axis=1)
    return GlyphRun(glyphs.astype(np.float32), (-count if axis else count) / length)
