"""Text coverage computed by the shader, compared with the area of the letters."""

import cv2
import numpy as np
import pytest

from fastgen.decals.glyphs import glyph_extents, glyph_sums, glyph_tiles
from fastgen.decals.lettering import layout
from fastgen.render.gl import open_context
from fastgen.render.glyph_runs import glyph_run
from fastgen.render.textures import clamped_array
from tests.glsl import blocks, run

CAP_MM = 100.0
STEP_MM = 5.0
MARGIN_MM = 110.0

BODY = (
    '#include "text_coverage.glsl"\n'
    "vec4 f(vec4 x) { return vec4(text_coverage(x.xy, vec4(%r, 0.0, %d.0, %r), x.zw)); }"
)


@pytest.fixture(
    scope="module",
    params=[
        (("CSQU 305438",), False),
        (("CSQU", "305438", "22G1 45R1 I"), False),
        (("CSQU305438", "22G1"), True),
    ],
    ids=["line", "lines", "columns"],
)
def text(request):
    """Layout of a text, its ink on a 1 mm grid [H, W] from the lower left, and its origin."""
    tiles, fonts = glyph_tiles()
    lines, vertical = request.param
    lettering = layout(lines, next(iter(fonts.values())), CAP_MM, vertical)
    glyphs = lettering.glyphs
    side = round(glyphs[0].x1 - glyphs[0].x0)
    left, low = min(g.x0 for g in glyphs), min(g.y0 for g in glyphs)
    width, height = max(g.x1 for g in glyphs) - left, max(g.y1 for g in glyphs) - low
    ink = np.zeros((round(height) + 1, round(width) + 1))
    for glyph in glyphs:
        fine = cv2.resize(tiles[glyph.tile].astype(np.float32), (side, side))[::-1]
        x, y = round(glyph.x0 - left), round(glyph.y0 - low)
        window = ink[y : y + side, x : x + side]
        np.maximum(window, fine >= 127.5, out=window)
    return lettering, ink, (left, low)


def seen_ink(text, widths_mm):
    """Return grid points [N, 2] in mm, STEP_MM apart, and the shader's coverage [N] there.

    widths_mm: Width and height of the box around each point.
    """
    lettering, ink, (left, low) = text
    height, width = ink.shape
    x = np.arange(-MARGIN_MM, width + MARGIN_MM, STEP_MM) + left
    y = np.arange(-MARGIN_MM, height + MARGIN_MM, STEP_MM) + low
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    table = np.zeros((1, 256, 4), np.float32)
    made, parts_per_mm = glyph_run(lettering, glyph_extents())
    table[0, : len(made)] = made
    from_middle = points - np.array(lettering.size_mm) / 2
    tiles, _ = glyph_tiles()
    with open_context() as gl:
        placed = gl.ctx.texture((256, 1), 4, table.tobytes(), dtype="f4")
        placed.filter = (gl.ctx.NEAREST, gl.ctx.NEAREST)
        held = blocks(gl)
        textures = {
            "glyph_tiles": clamped_array(gl.ctx, tiles),
            "glyph_sums": clamped_array(gl.ctx, glyph_sums()),
            "glyph_table": placed,
        }
        values = []
        for rows in np.array_split(from_middle, -(-len(points) // 8192)):
            inputs = np.c_[rows, np.full((len(rows), 2), widths_mm)]
            body = BODY % (CAP_MM, len(made), parts_per_mm)
            values.append(run(gl, body, inputs, textures)[:, 0])
        del held
    return points, np.concatenate(values)


WIDTHS_MM = [(3, 3), (10, 10), (20, 20), (40, 40), (100, 100), (200, 200), (10, 80), (120, 15)]


@pytest.mark.parametrize("widths_mm", WIDTHS_MM)
def test_a_text_keeps_its_ink_at_every_distance(text, widths_mm):
    _, values = seen_ink(text, widths_mm)
    assert values.sum() * STEP_MM**2 == pytest.approx(text[1].sum(), rel=0.02)


@pytest.mark.parametrize("widths_mm", WIDTHS_MM)
def test_text_coverage_is_close_to_the_averaged_ink(text, widths_mm):
    """Compare with the ink averaged over boxes."""
    _, ink, (left, low) = text
    points, values = seen_ink(text, widths_mm)
    pad = int(MARGIN_MM) + 110
    across, up = (int(width) | 1 for width in widths_mm)
    mean = cv2.blur(np.pad(ink, pad), (across, up))
    column, row = np.rint(points - (left, low)).astype(int).T + pad
    error = values - mean[row, column]
    assert np.sqrt((error**2).mean()) < 0.05
