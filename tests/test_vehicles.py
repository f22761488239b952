"""Vehicles below containers, and islands beside their lane."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.light.hdri import bundled_weights
from fastgen.sampling.ground import island_props, trailer_props, wagon_props
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Ground, Neighbour, Pose
from fastgen.scene.boxes import prop_box
from fastgen.scene.check import check_scene
from tests.plain import FEW_DECALS


def test_islands_stand_on_the_ground_beside_the_lane():
    lane_mm, ground_mm = 4200.0, -1200.0
    clear_mm = []
    for seed in range(20):
        parts = [
            prop_box(prop) for prop in island_props(lane_mm, ground_mm, np.random.default_rng(seed))
        ]
        assert len(parts) == 6
        corners = np.stack([part.corners_mm for part in parts])
        assert corners[..., 2].min() == pytest.approx(ground_mm)
        assert corners[..., 2].max() < ground_mm + 1100  # below the lowest deck
        clear_mm.append(np.abs(corners[..., 1]).min())
        for island in corners[:2]:  # an island and two bollards on it
            low, high = island.min(axis=0), island.max(axis=0)
            on_top = [c for c in corners if c[:, 2].min() == pytest.approx(high[2])]
            inside = [
                c for c in on_top if (c[:, :2] >= low[:2]).all() and (c[:, :2] <= high[:2]).all()
            ]
            assert len(inside) == 2
    # half of a container's width and a margin
    assert min(clear_mm) > 2438 / 2 + 200
    assert island_props(2700.0, 0.0, np.random.default_rng(0)) == ()


def test_scenes_with_islands_can_be_drawn():
    values = {"placement": {"islands": 1}, "markings": FEW_DECALS}
    config = Config.from_values(values, Config.preset("gate"))
    for index in range(40):
        scene = check_scene(sample_scene(config, 4, index, bundled_weights()))
        assert len(scene.props) > 13


@pytest.mark.parametrize("kind", ["20", "40", "45HC"])
@pytest.mark.parametrize("build", [trailer_props, wagon_props])
def test_vehicles_stand_on_the_ground_below_the_container(build, kind):
    scene = sample_scene(Config(), 3, 0, bundled_weights())
    for seed in range(5):
        height, props = build(kind, np.random.default_rng(seed))
        assert 12 <= len(props) <= 24
        corners = np.concatenate([prop_box(prop).corners_mm for prop in props])
        assert corners[:, 2].min() == pytest.approx(height, abs=1.0)
        assert corners[:, 2].max() <= 1e-6
        wheels = [prop for prop in props if prop.shape == "cylinder" and prop.size_mm[0] > 900]
        assert len(wheels) in (4, 6, 8)
    ground = Ground("asphalt", height)
    neighbour = Neighbour(Pose((0.0, 4000.0, height)), scene.container, scene.surface)
    check_scene(replace(scene, ground=ground, neighbours=(neighbour,), props=props, cameras=()))
