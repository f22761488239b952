"""Cells of the atlas that decals are near to, against points of the cells one by one."""

import numpy as np

from fastgen.drawing.decal_tables import MARGIN_MM
from fastgen.drawing.decals_near import decals_near
from fastgen.drawing.programs import DECAL_KINDS, NEAR_CELL_MM

SIZE_MM = (1500.0, 1200.0)


def row(kind, center, half, turn_deg):
    """A row of the table of decals."""
    cos, sin = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    values = np.zeros((5, 4), np.float32)
    values[0] = cos, sin, -sin, cos
    values[1] = *center, *half
    values[3, 0] = DECAL_KINDS[kind]
    return values


def beyond_mm(kind, center, half, turn_deg, points):
    """How far points [..., 2] lie outside an outline, along the normals of its sides."""
    angle = np.deg2rad(turn_deg)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    x, y = np.moveaxis(np.abs((points - center) @ turn.T), -1, 0)
    if kind == "marker":
        return (x + y - half[0]) / np.sqrt(2)
    return np.maximum(x - half[0], y - half[1])


def test_cells_hold_all_points_near_decals_and_few_others():
    rng = np.random.default_rng(4)
    columns, rows = (int(np.ceil(side / NEAR_CELL_MM)) for side in SIZE_MM)
    steps = (np.arange(8) + 0.5) / 8 * NEAR_CELL_MM
    across = np.arange(columns)[:, None] * NEAR_CELL_MM + steps
    down = np.arange(rows)[:, None] * NEAR_CELL_MM + steps
    points = np.stack(np.meshgrid(across.ravel(), down.ravel()), axis=-1)
    for turn_deg in (0.0, 90.0, 180.0, 3.0, -77.0, 45.0):
        for kind in ("marker", "text", "sticker"):
            # also beyond the atlas' borders
            center, half = rng.uniform((-50, -50), SIZE_MM), rng.uniform(20, 300, 2)
            if kind == "marker":
                half[1] = half[0]
            decal = (kind, center, half, turn_deg)
            found = decals_near(row(*decal)[None], SIZE_MM)
            assert found.shape == (rows, columns + -columns % 4)
            found = found[:, :columns]
            beyond = beyond_mm(*decal, points).reshape(rows, 8, columns, 8)
            nearest = beyond.min(axis=(1, 3))
            assert found[nearest <= MARGIN_MM].all()
            # a cell's middle is no more than half its diagonal from any point of it
            assert not found[nearest > MARGIN_MM + 1.5 * NEAR_CELL_MM].any()


def test_no_decal_is_near_where_there_is_none_and_several_add_up():
    assert not decals_near(np.zeros((0, 5, 4), np.float32), SIZE_MM).any()
    a = row("text", (300, 300), (100, 40), 0.0)
    b = row("marker", (900, 700), (150, 150), 0.0)
    both = decals_near(np.stack([a, b]), SIZE_MM)
    alone = decals_near(a[None], SIZE_MM) | decals_near(b[None], SIZE_MM)
    np.testing.assert_array_equal(both, alone)
