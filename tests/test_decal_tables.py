"""Decal tables compared with a loop over all decals and cells."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.decals.artwork import art_layers
from fastgen.geometry.container import build_container
from fastgen.render.constants import DECAL_CELL_MM
from fastgen.render.decal_tables import CELL_SLOTS, MARGIN_MM, SceneError, pack_decals
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Decal
from fastgen.scene.object_ids import object_ids


def packed(scene):
    mesh = build_container(scene.container.kind, scene.container.profiles)
    return mesh, pack_decals(scene.decals, object_ids(scene), mesh, art_layers())


def with_decals(*decals):
    scene = sample_scene(Config.preset(), 3, 0, {"port_quay_noon": 1.0})
    return replace(scene, decals=decals, damages=())


def listed(grid, row, column):
    """Return the indices of the decals that a cell lists, bottom first."""
    words = grid[row, column]
    halves = [half for word in words.tolist() for half in (word & 0xFFFF, word >> 16)]
    return [half - 1 for half in halves if half]


@pytest.mark.parametrize("index", [0, 1, 2])
def test_each_cell_lists_the_decals_that_reach_it_in_painting_order(index):
    scene = sample_scene(Config.preset(), 5, index, {"port_quay_noon": 1.0})
    mesh, tables = packed(scene)
    assert len(scene.decals) > 10
    expected = {}
    for number, decal in enumerate(scene.decals):
        x, y, width, height = mesh.charts[mesh.chart_index(decal.face)].rect_mm
        corners = np.array(decal.size_mm) / 2 * [[-1, -1], [1, -1], [-1, 1], [1, 1]] @ decal.turn.T
        middle = np.array([x, y]) + decal.center_mm
        low = np.maximum(middle + corners.min(axis=0) - MARGIN_MM, (x, y)) // DECAL_CELL_MM
        high = np.minimum(middle + corners.max(axis=0) + MARGIN_MM, (x + width, y + height))
        for row in range(int(low[1]), int(high[1] // DECAL_CELL_MM) + 1):
            for column in range(int(low[0]), int(high[0] // DECAL_CELL_MM) + 1):
                expected.setdefault((row, column), []).append(number)
    rows, columns = tables.grid.shape[:2]
    for row in range(rows):
        for column in range(columns):
            assert listed(tables.grid, row, column) == expected.get((row, column), [])


def marker(x, y):
    return Decal("marker", "C1.1", "front", (x, y), (300.0, 300.0), art="C1.1")


def test_a_scene_without_decals_has_empty_tables():
    _, tables = packed(with_decals())
    assert not tables.grid.any()
    assert tables.table.shape[0] == 1


def test_the_first_decal_without_room_is_named():
    crowd = [marker(1000.0, 1000.0)] * CELL_SLOTS
    packed(with_decals(*crowd))
    with pytest.raises(SceneError, match=rf"decals\[{CELL_SLOTS + 1}\].*more than {CELL_SLOTS}"):
        packed(with_decals(*crowd, marker(3000.0, 1000.0), *crowd))
    with pytest.raises(SceneError, match=r"decals\[1\].*lies off its sheet"):
        packed(with_decals(crowd[0], marker(-900.0, 0.0), *crowd, *crowd))
