"""The letters of a text as the shader finds them: those that reach into a part of its length."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.prints.lettering import Lettering

GLYPH_RANGE = 4096
"""Two numbers below it are one that float32 holds exactly."""

_SLACK = 0.01
"""Of a tile's side, for points that a rounding puts into the part beside their own."""


class GlyphRun(NamedTuple):
    """glyphs: float32 [G, 4]: centre x, y in mm from the middle of the text, ascending along its
    longer side; tile; and of that one of G equal parts of that side, which glyphs' tiles reach into
    it, the first * GLYPH_RANGE + the end. What lies beyond an end belongs to the last part there.
    parts_per_mm: parts a mm, below 0 where they follow along y."""

    glyphs: NDArray[np.float32]
    parts_per_mm: float


def glyph_run(lettering: Lettering) -> GlyphRun:
    """The glyphs of a text, fewer than GLYPH_RANGE."""
    count = len(lettering.glyphs)
    size = np.array(lettering.size_mm)
    boxes = np.array([glyph[2:] for glyph in lettering.glyphs]).reshape(count, 2, 2)
    axis = int(size[1] > size[0])
    order = np.argsort(boxes[:, 0, axis], kind="stable")
    low, high = (boxes[order] - size / 2).transpose(1, 2, 0)
    borders = size[axis] * (np.arange(count + 1) / max(count, 1) - 0.5)
    borders[[0, -1]] = -np.inf, np.inf
    slack = _SLACK * (high[axis] - low[axis])
    first = np.searchsorted(high[axis] + slack, borders[:-1])
    end = np.searchsorted(low[axis] - slack, borders[1:], side="right")
    tiles = np.array([glyph.tile for glyph in lettering.glyphs])[order]
    columns = [*(low + high) / 2, tiles, first * GLYPH_RANGE + end]
    parts_per_mm = count / size[axis] * (-1 if axis else 1)
    return GlyphRun(np.stack(columns, axis=1).astype(np.float32), float(parts_per_mm))
