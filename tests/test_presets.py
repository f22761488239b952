"""Shares that presets set: markers, colours, arrangements; and the files in examples/ports."""

import colorsys
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from fastgen.classes import DAMAGE_CLASSES
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.light.environment import load_environment, sky_irradiance
from fastgen.light.hdri import bundled_hdris
from fastgen.scene.check import check_scene
from fastgen.scene.container_kinds import KINDS

COUNT = 160
REAL = ("crane", "gate")
PORTS = ("gate", "yard", "quay")
"""Presets that have a file in examples/ports."""


@pytest.fixture(scope="module")
def scenes():
    """Scenes without neighbours, whose contents take most of the time."""
    fewer = {"placement": {"neighbours": 0}}
    configs = {name: Config.from_values(fewer, Config.preset(name)) for name in ("seafront", *REAL)}
    generators = {name: Generator(config, seed=6) for name, config in configs.items()}
    return {name: [g.scene(index) for index in range(COUNT)] for name, g in generators.items()}


def hue_of(name):
    """Return the family of a paint by the hue of its sRGB code, not by its name."""
    code = bytes.fromhex(Config.preset().surface.colors[name].removeprefix("#"))
    hue, saturation, value = colorsys.rgb_to_hsv(*(part / 255 for part in code))
    if saturation < 0.3:
        return "grey"
    degrees = 360 * hue
    if degrees < 22.5 or degrees > 340:
        # orange is bright red-brown
        return "red" if value < 0.5 else "orange"
    return "blue" if 195 < degrees < 260 else "other"


def near(share, expected, count=COUNT):
    return abs(share - expected) < 4 * math.sqrt(expected * (1 - expected) / count)


@pytest.mark.parametrize("preset", REAL)
def test_rain_falls_in_a_seventh_of_the_scenes_and_under_clouds(scenes, preset):
    rainy = [scene.environment.name for scene in scenes[preset] if scene.weather.rain]
    assert near(len(rainy) / COUNT, 0.15)
    for name in {*rainy}:
        light = load_environment(bundled_hdris()[name])
        up = np.array([[0, 0, 1]], np.float32)
        if len(light.lights) == 1:  # several lights are lamps
            (sun,) = light.lights
            assert sun.direction[2] * np.mean(sun.light) < sky_irradiance(light, up, 0.0).mean()


@pytest.mark.parametrize("preset", REAL)
def test_half_of_a_fleet_is_red_and_a_fifth_is_blue(scenes, preset):
    paints = Counter(hue_of(scene.surface.paint.name) for scene in scenes[preset])
    assert near(paints["red"] / COUNT, 0.5)
    assert near(paints["blue"] / COUNT, 0.2)


def test_all_paints_of_the_paper_are_equally_likely(scenes):
    paints = Counter(scene.surface.paint.name for scene in scenes["seafront"])
    names = Config.preset().surface.colors
    assert paints.keys() == names.keys()
    assert all(near(count / COUNT, 1 / len(names)) for count in paints.values())


@pytest.mark.parametrize(("preset", "share"), [("seafront", 1.0), ("crane", 0.35), ("gate", 0.15)])
def test_the_configured_share_of_containers_carries_markers(scenes, preset, share):
    marked = [any(d.kind == "marker" for d in scene.decals) for scene in scenes[preset]]
    assert sum(marked) == COUNT if share == 1.0 else near(sum(marked) / COUNT, share)


def test_a_gate_has_no_spreader_and_every_preset_has_containers(scenes):
    assert not any(scene.spreader.present for scene in scenes["gate"])
    assert all(scene.container.present for found in scenes.values() for scene in found)


def test_containers_without_markers_have_the_same_other_properties(scenes):
    damage = {
        "kinds": list(DAMAGE_CLASSES),
        "faces": ["front", "back", "door", "no_door"],
        "toward_cameras": 0,
    }
    fewer = {"placement": {"neighbours": 0}, "damage": damage}
    gate = Generator(Config.from_values(fewer, Config.preset("gate")), seed=6)
    for marked, plain in zip(scenes["seafront"][:40], map(gate.scene, range(40)), strict=True):
        assert marked.container == plain.container
        assert marked.damages == plain.damages
        texts = [[d.lines for d in s.decals if d.class_name == "text"] for s in (marked, plain)]
        assert texts[0] == texts[1]


def test_weights_of_colors_decide_their_frequency():
    weights = {"white": 3, "navy": 1, "not a color": 50}
    surface = {"colors": {"white": "#ffffff", "navy": "#000040"}, "color_weights": weights}
    generator = Generator(Config.from_values({"surface": surface}, Config.preset("crane")), seed=6)
    whites = [generator.scene(i).surface.paint.name == "white" for i in range(COUNT)]
    assert near(sum(whites) / COUNT, 0.75)


def test_own_colors_replace_those_of_a_preset_alone():
    colors = {"red": "#ff0000", "plum": "#401040"}
    config = Config.from_values({"surface": {"colors": colors}}, Config.preset("crane"))
    assert config.surface.weights == [1.0, 1.0]
    with pytest.raises(ConfigError, match=r"surface.color_weights: all colors have weight 0"):
        Config.from_values(
            {"surface": {"colors": colors, "color_weights": dict.fromkeys(colors, 0)}}
        )


@pytest.mark.parametrize("preset", PORTS)
def test_the_file_of_a_port_has_the_values_of_its_preset(preset):
    path = Path("examples/ports") / f"{preset}.yaml"
    assert Config.load(path) == Config.preset(preset)


@pytest.mark.parametrize("preset", PORTS)
def test_scenes_of_ports_can_be_drawn(preset):
    generator = Generator(Config.preset(preset), seed=9)
    scenes = [generator.scene(index) for index in range(12)]
    assert all(check_scene(scene) and scene.ground for scene in scenes)
    assert any(scene.neighbours for scene in scenes)


def visible_width(camera):
    """Return the width in mm of an undistorted image at the distance of its target."""
    return (
        camera.sensor_width_mm / camera.focal_mm * math.dist(camera.position_mm, camera.target_mm)
    )


def test_a_gate_sees_parts_of_containers_and_its_sides_the_sky(scenes):
    cut = sky = 0
    for scene in scenes["gate"]:
        for camera in scene.cameras:
            height = camera.position_mm[2] - scene.ground.height_mm
            assert height < (9500 if camera.name == "roof" else 7000)
            run_mm = math.dist(camera.position_mm[:2], camera.target_mm[:2])
            down_deg = math.degrees(math.atan2(camera.position_mm[2] - camera.target_mm[2], run_mm))
            if camera.name in ("left", "right"):
                assert height > 1500
                cut += visible_width(camera) < KINDS[scene.container.kind].length_mm
                # half of the vertical view of a 16:9 image without distortion
                half_deg = math.degrees(
                    math.atan(camera.sensor_width_mm / camera.focal_mm / 2 * 9 / 16)
                )
                sky += down_deg < half_deg
            else:
                assert down_deg > 0
    assert cut > 0.7 * 2 * COUNT
    assert 0.4 * 2 * COUNT < sky < 0.95 * 2 * COUNT


def test_twins_of_a_gate_are_on_trailers():
    values = {"container": {"kinds": {"20": 1}}, "placement": {"neighbours": 0}}
    generator = Generator(Config.from_values(values, Config.preset("gate")), seed=6)
    scenes = [generator.scene(index) for index in range(60)]
    assert near(sum(bool(scene.neighbours) for scene in scenes) / 60, 1 / 3, 60)
    assert all(scene.props for scene in scenes)
