"""Atlas cells marked as near a decal, compared with tests of single points in each cell."""

import numpy as np

from fastgen.render.constants import NEAR_CELL_MM
from fastgen.render.decal_tables import MARGIN_MM
from fastgen.render.decals_near import decals_near
from fastgen.render.gl import open_context
from fastgen.render.textures import data_texture
from fastgen.render.zone_codes import SPREADER_ZONE
from fastgen.scene.limits import DECAL_KINDS
from tests.glsl import blocks, run

SIZE_MM = (1500.0, 1200.0)


def row(kind, center, half, turn_deg):
    """Return one row of the decal table, float32 [5, 4]."""
    cos, sin = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    values = np.zeros((5, 4), np.float32)
    values[0] = cos, sin, -sin, cos
    values[1] = *center, *half
    values[3, 0] = DECAL_KINDS[kind]
    return values


def beyond_mm(kind, center, half, turn_deg, points):
    """Return how far points [..., 2] lie outside an outline, along the normals of its sides."""
    angle = np.deg2rad(turn_deg)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    x, y = np.moveaxis(np.abs((points - center) @ turn.T), -1, 0)
    if kind == "marker":
        return (x + y - half[0]) / np.sqrt(2)
    return np.maximum(x - half[0], y - half[1])


def cells(numbers):
    """Unpack the cells [rows, columns] from the numbers that the shader reads."""
    return np.stack([numbers >> 8 * i & 255 for i in range(4)], axis=-1).reshape(len(numbers), -1)


def test_cells_cover_all_points_near_decals_and_few_others():
    rng = np.random.default_rng(4)
    columns, rows = (int(np.ceil(side / NEAR_CELL_MM)) for side in SIZE_MM)
    steps = (np.arange(8) + 0.5) / 8 * NEAR_CELL_MM
    across = np.arange(columns)[:, None] * NEAR_CELL_MM + steps
    down = np.arange(rows)[:, None] * NEAR_CELL_MM + steps
    points = np.stack(np.meshgrid(across.ravel(), down.ravel()), axis=-1)
    for turn_deg in (0.0, 90.0, 180.0, 3.0, -77.0, 45.0):
        for kind in ("marker", "text", "sticker"):
            # centres may lie outside the atlas
            center, half = rng.uniform((-50, -50), SIZE_MM), rng.uniform(20, 300, 2)
            if kind == "marker":
                half[1] = half[0]
            decal = (kind, center, half, turn_deg)
            found = cells(decals_near(row(*decal)[None], SIZE_MM))[:, :columns]
            assert found.shape == (rows, columns)
            beyond = beyond_mm(*decal, points).reshape(rows, 8, columns, 8)
            nearest = beyond.min(axis=(1, 3))
            assert found[nearest <= MARGIN_MM].all()
            # the centre of a cell is at most half a diagonal from any of its points
            assert not found[nearest > MARGIN_MM + 1.5 * NEAR_CELL_MM].any()


def test_no_decals_mark_no_cells_and_several_decals_add_up():
    assert not decals_near(np.zeros((0, 5, 4), np.float32), SIZE_MM).any()
    a = row("text", (300, 300), (100, 40), 0.0)
    b = row("marker", (900, 700), (150, 150), 0.0)
    both = decals_near(np.stack([a, b]), SIZE_MM)
    alone = decals_near(a[None], SIZE_MM) | decals_near(b[None], SIZE_MM)
    np.testing.assert_array_equal(both, alone)


def test_the_shader_reads_each_cell():
    decals = [row("text", (300, 310), (90, 40), 3.0), row("marker", (1480, 1190), (100, 100), 0.0)]
    size_mm = (1501.0, 1203.0)
    near = decals_near(np.stack(decals), size_mm)
    columns, rows = (int(np.ceil(side / NEAR_CELL_MM)) for side in size_mm)
    expected = cells(near)[:rows, :columns]
    assert expected[:, -1].any()
    assert not expected.all()
    rng = np.random.default_rng(7)
    column, line = np.meshgrid(np.arange(columns), np.arange(rows))
    points = (
        np.stack([column, line], axis=-1).reshape(-1, 2) + rng.uniform(0.1, 0.9, 2)
    ) * NEAR_CELL_MM
    body = (
        '#include "decals_near.glsl"\n'
        "vec4 f(vec4 x) { return vec4(near_decals(uint(x.z), x.xy), 0.0, 0.0, 0.0); }"
    )
    with open_context() as gl:
        held = blocks(gl)
        textures = {"decal_proximity": data_texture(gl.ctx, near[..., None])}
        for zone, shown in ((0, expected), (SPREADER_ZONE, 0 * expected)):
            inputs = np.c_[points, np.full(len(points), zone), np.zeros(len(points))]
            found = run(gl, body, inputs, textures)[:, 0].reshape(rows, columns)
            np.testing.assert_array_equal(found, shown)
        del held
