"""The letters of a text as the shader finds them: those that reach into a part of its length."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.decals.artwork import GLYPH_TILE_SIZE
from fastgen.decals.lettering import TILE_CAPS, TILE_RANGE_CAPS, Lettering
from fastgen.scene.limits import GLYPH_RANGE

DEFINES = {
    "GLYPH_TILE_SIZE": f"{GLYPH_TILE_SIZE:.1f}",
    "GLYPH_TILE_CAPS": f"{TILE_CAPS}",
    "GLYPH_RANGE_CAPS": f"{TILE_RANGE_CAPS}",
    "GLYPH_RANGE": f"{GLYPH_RANGE}u",
}
"""For shaders/decal.glsl."""

_SLACK = 0.01
"""Of a tile's side, for points that a rounding puts into the part beside their own."""


class GlyphRun(NamedTuple):
    """The G letters of a text along its longer side, which has as many equal parts; the first and
    the last part go on beyond its ends.

    glyphs: float32 [G, 4]. Row i: centre x, y in mm from the middle of the text; tile; and first *
    GLYPH_RANGE + end of the rows whose tiles reach into part i. parts_per_mm: parts a mm, below 0
    where they follow along y.
    """

    glyphs: NDArray[np.float32]
    parts_per_mm: float


def glyph_run(lettering: Lettering) -> GlyphRun:
    """The glyphs of a text, at least one and fewer than GLYPH_RANGE."""
    count = len(lettering.glyphs)
    rows = np.array([(*glyph[2:], glyph.tile) for glyph in lettering.glyphs])
    width, height = lettering.size_mm
    axis = int(height > width)
    rows = rows[np.argsort(rows[:, axis], kind="stable")]
    center_x = (rows[:, 0] + rows[:, 2] - width) / 2
    center_y = (rows[:, 1] + rows[:, 3] - height) / 2
    side = rows[0, 2] - rows[0, 0]
    # sizes are rounded, so that those of tiny letters may be nothing
    length = max(width, height, side)
    along = center_y if axis else center_x
    borders = length * (np.arange(count + 1) / count - 0.5)
    borders[[0, -1]] = -np.inf, np.inf
    reach = (0.5 + _SLACK) * side
    first = np.searchsorted(along, borders[:-1] - reach)
    end = np.searchsorted(along, borders[1:] + reach, side="right")
    glyphs = np.stack([center_x, center_y, rows[:, 4], first * GLYPH_RANGE + end], axis=1)
    return GlyphRun(glyphs.astype(np.float32), (-count if axis else count) / length)
