"""Shares that presets set: containers with markers, and colours of the fleet."""

import colorsys
import math
from collections import Counter

import pytest

from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.errors import ConfigError
from fastgen.generator import Generator

COUNT = 300
REAL = ("crane", "gate")
"""Presets of real cameras."""


@pytest.fixture(scope="module")
def scenes():
    generators = {name: Generator(Config.preset(name), seed=6) for name in PRESETS}
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


def near(share, expected):
    return abs(share - expected) < 4 * math.sqrt(expected * (1 - expected) / COUNT)


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
    for marked, plain in zip(scenes["seafront"][:40], scenes["gate"][:40], strict=True):
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
