"""Text coverage computed by the shader, compared with the area of the letters."""

import cv2
import numpy as np
import pytest

from fastgen.decals.artwork import glyph_levels, glyph_tiles
from fastgen.decals.lettering import layout
from fastgen.render.gl import open_context
from fastgen.render.glyph_runs import glyph_run
from fastgen.render.textures import levelled_texture
from tests.glsl import blocks, run

CAP_MM = 100.0
STEP_MM = 5.0
MARGIN_MM = 60.0

BODY = (
    "struct Material { vec3 albedo; };\n"
    '#include "tone_curve.glsl"\n#include "noise.glsl"\n'
    '#include "decal_cell.glsl"\n#include "decal.glsl"\n'
    "vec4 f(vec4 x) { return vec4(text_coverage(x.xy, vec4(%r, 0.0, %d.0, %r), x.z)); }"
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


def seen_ink(text, footprint_mm):
    """Return grid points [N, 2] in mm, STEP_MM apart, and the shader's coverage [N] there."""
    lettering, ink, (left, low) = text
    height, width = ink.shape
    x = np.arange(-MARGIN_MM, width + MARGIN_MM, STEP_MM) + left
    y = np.arange(-MARGIN_MM, height + MARGIN_MM, STEP_MM) + low
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    table = np.zeros((1, 256, 4), np.float32)
    made, parts_per_mm = glyph_run(lettering)
    table[0, : len(made)] = made
    from_middle = points - np.array(lettering.size_mm) / 2
    with open_context() as gl:
        array = levelled_texture(gl, glyph_levels())
        placed = gl.ctx.texture((256, 1), 4, table.tobytes(), dtype="f4")
        placed.filter = (gl.ctx.NEAREST, gl.ctx.NEAREST)
        held = blocks(gl)
        textures = {"glyph_tiles": array, "glyph_table": placed}
        values = []
        for rows in np.array_split(from_middle, -(-len(points) // 8192)):
            inputs = np.c_[rows, np.full(len(rows), footprint_mm), np.zeros(len(rows))]
            body = BODY % (CAP_MM, len(made), parts_per_mm)
            values.append(run(gl, body, inputs, textures)[:, 0])
        del held
    return points, np.concatenate(values)


@pytest.mark.parametrize("footprint_mm", [3.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0])
def test_a_text_keeps_its_ink_at_every_distance(text, footprint_mm):
    _, values = seen_ink(text, footprint_mm)
    assert values.sum() * STEP_MM**2 == pytest.approx(text[1].sum(), rel=0.06)


@pytest.mark.parametrize("footprint_mm", [10.0, 20.0])
def test_text_coverage_is_close_to_the_averaged_ink(text, footprint_mm):
    """Compare with the ink averaged over squares as wide as the footprint."""
    _, ink, (left, low) = text
    points, values = seen_ink(text, footprint_mm)
    pad = int(MARGIN_MM) + 40
    side = int(footprint_mm) | 1
    mean = cv2.blur(np.pad(ink, pad), (side, side))
    column, row = np.rint(points - (left, low)).astype(int).T + pad
    error = values - mean[row, column]
    assert np.sqrt((error**2).mean()) < 0.06
