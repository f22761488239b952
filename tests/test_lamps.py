"""Floodlights: their illuminance, their share of dark scenes, and what they light."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen.classes import CONTAINER_ID
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.light.directional_lights import MAX_LIGHTS
from fastgen.light.environment import irradiance_at, load_environment
from fastgen.light.hdri import bundled_hdris
from fastgen.light.lamps import unit_luminance, with_lamps
from fastgen.scene import REC_709, EnvironmentView, Scene
from fastgen.scene.optics import Lamp
from fastgen.srgb import DECODED

SIZE = (160, 120)
DARK = {"environment": {"names": ["port_night"], "lamps": {"probability": 0.6}}}


@pytest.fixture(scope="module")
def night():
    return load_environment(bundled_hdris()["port_night"])


def lux(light, normal, yaw_deg, cd_m2):
    """Return the illuminance on a surface in the world."""
    return float(irradiance_at(light, [normal], yaw_deg)[0] @ REC_709) * np.pi * cd_m2


@pytest.mark.parametrize("yaw_deg", [0.0, 130.0])
def test_a_surface_that_faces_a_lamp_gets_its_illuminance(night, yaw_deg):
    lamp = Lamp(azimuth_deg=40.0, elevation_deg=25.0, illuminance_lx=120.0, color=(1.0, 0.7, 0.4))
    view = EnvironmentView("port_night", yaw_deg, 30.0, (lamp,))
    few = replace(night, lights=night.lights[:2])
    cd_m2 = unit_luminance(few, 30.0)
    assert lux(few, [0, 0, 1], yaw_deg, cd_m2) == pytest.approx(30)
    toward = np.array([np.cos(np.deg2rad(40)), np.sin(np.deg2rad(40)), np.tan(np.deg2rad(25))])
    toward /= np.linalg.norm(toward)
    lit = with_lamps(few, view, cd_m2)
    for normal, share in ((toward, 1.0), ([0, 0, 1], np.sin(np.deg2rad(25))), (-toward, 0.0)):
        added = lux(lit, normal, yaw_deg, cd_m2) - lux(few, normal, yaw_deg, cd_m2)
        assert added == pytest.approx(120 * share, abs=0.01)
    red, green, blue = lit.lights[0].light
    assert (green / red, blue / red) == pytest.approx((0.7, 0.4))


def test_the_weakest_lights_give_way_to_lamps(night):
    assert len(night.lights) == MAX_LIGHTS
    lamps = (Lamp(0.0, 30.0, 500.0), Lamp(90.0, 30.0, 400.0))
    cd_m2 = unit_luminance(night, 30.0)
    lit = with_lamps(night, EnvironmentView("port_night", 0.0, 30.0, lamps), cd_m2)
    assert len(lit.lights) == MAX_LIGHTS
    assert lit.lights[2:] == night.lights[:2]
    assert with_lamps(night, EnvironmentView("port_night", 0.0, 30.0), cd_m2) is night


def test_the_configured_share_of_dark_scenes_has_lamps_and_nothing_else_changes():
    generator = Generator(Config.from_values(DARK), seed=3)
    off = {"environment": {"names": ["port_night"]}}
    plain = Generator(Config.from_values(off), seed=3)
    counts = []
    for index in range(100):
        scene, other = generator.scene(index), plain.scene(index)
        lamps = scene.environment.lamps
        counts.append(len(lamps))
        assert replace(scene, environment=replace(scene.environment, lamps=())) == other
        assert Scene.from_json(scene.to_json()) == scene
        assert all(30 <= lamp.illuminance_lx <= 200 for lamp in lamps)
        assert all(20 <= lamp.elevation_deg <= 70 for lamp in lamps)
    assert {0, 1, 2} == set(counts)
    assert 45 < sum(count > 0 for count in counts) < 75


def test_bright_scenes_have_no_lamps():
    values = {"environment": {"names": ["port_noon"], "lamps": {"probability": 1.0}}}
    generator = Generator(Config.from_values(values), seed=3)
    assert not any(generator.scene(index).environment.lamps for index in range(10))


def test_a_lamp_lights_the_side_that_faces_it(generators):
    """At the same exposure the lit front is brighter. The labels are equal."""
    values = {"environment": {"names": ["port_night"]}, "damage": {"probability": 0}}
    generator = generators(Config.from_values(values), seed=3, size=SIZE)
    scene = generator.scene(0)
    camera = scene.camera("A")
    behind = np.subtract(camera.position_mm, camera.target_mm)
    azimuth = float(np.degrees(np.arctan2(behind[1], behind[0])))
    samples = []
    for lamps in ((), (Lamp(azimuth, 30.0, 60.0),), (Lamp(azimuth + 180, 30.0, 60.0),)):
        lit = replace(scene, environment=replace(scene.environment, lamps=lamps))
        stops = np.log2(generator.exposure(scene, camera) / generator.exposure(lit, camera))
        shot = replace(camera, exposure_ev=camera.exposure_ev + float(stops))
        samples.append(generator.render(scene=lit, camera=shot))
    dark, front, back = (
        DECODED[sample.image][sample.ids == CONTAINER_ID].mean() for sample in samples
    )
    assert front > 1.5 * dark
    assert back < 1.2 * dark
    assert samples[0].objects == samples[1].objects == samples[2].objects


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"count": [1, 3]}, "environment.lamps.count.*1 to 2"),
        ({"colors": ["warm"]}, r"environment.lamps.colors\[0\].*is not a color"),
        ({"illuminance_lx": 0}, "environment.lamps.illuminance_lx.*0.001 to 100000 lx"),
    ],
)
def test_bad_values_are_named(values, words):
    with pytest.raises(ConfigError, match=words):
        Config.from_values({"environment": {"lamps": values}})
