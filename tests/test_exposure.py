"""Automatic exposure in photographic units, compared with exposure values and rules of thumb."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fastgen.camera.electronics import noisy, with_chroma_noise
from fastgen.camera.exposure import MIDDLE_GREY, Exposure, limited_exposure
from fastgen.camera.projection import view_of
from fastgen.camera.response import response_curve
from fastgen.camera.sensor import apply_camera_model
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.frame import Frame
from fastgen.generator import Generator
from fastgen.light.hdri import bundled_hdris, hours_of, illuminance_of
from fastgen.scene import Camera, Ground, Scene
from fastgen.scene.optics import ChromaNoise, Meter, Noise, Response, Sensor, Weather
from fastgen.srgb import DECODED

SIZE = (160, 120)
METER = Meter(f_number=2.0, longest_s=0.02, largest_iso=1600, dim_target=0.06)


def grey_under(lx):
    """Return the luminance in cd/m2 of middle grey under an illuminance."""
    return lx * MIDDLE_GREY / np.pi


def test_a_sunny_scene_follows_the_sunny_16_rule():
    """In the sun at f/16, the shutter time is within a stop of one over the ISO."""
    meter = replace(METER, f_number=16.0)
    exposure = limited_exposure(1.0, grey_under(1e5), meter, 0.0)
    assert exposure.gain == 1
    assert abs(np.log2(exposure.shutter_s * 100)) < 1
    assert exposure.factor == pytest.approx(MIDDLE_GREY)


@pytest.mark.parametrize("lx", [1e3, 3e4])
def test_shutter_and_aperture_give_the_exposure_value_of_the_luminance(lx):
    luminance = grey_under(lx)
    exposure = limited_exposure(0.7, luminance / 0.7, METER, 0.0)
    value = np.log2(luminance * 100 / 12.5)
    taken = np.log2(METER.f_number**2 / exposure.shutter_s) - np.log2(exposure.gain)
    assert taken == pytest.approx(value)
    assert exposure.factor * 0.7 == pytest.approx(0.18)


def test_the_target_falls_with_the_light_from_1000_to_10_lx():
    meter = replace(METER, largest_iso=1e6)  # never at its limit
    shown = [
        limited_exposure(1.0, grey_under(lx), meter, 0.0).factor for lx in (1, 10, 100, 1e3, 1e5)
    ]
    np.testing.assert_allclose(shown, [0.06, 0.06, (0.06 * 0.18) ** 0.5, 0.18, 0.18])


def test_the_gain_rises_only_at_the_longest_shutter_and_ends_at_its_limit():
    exposures = [
        limited_exposure(1.0, grey_under(lx), METER, 0.0) for lx in np.geomspace(1e5, 0.1, 60)
    ]
    for exposure in exposures:
        assert exposure.gain == 1 or exposure.shutter_s == METER.longest_s
        assert 1 <= exposure.gain <= 16
    darkest = exposures[-1]
    assert darkest.gain == 16
    # 1/50 s at f/2 and ISO 1600 expose 12.5 * 4 / (0.02 * 1600) cd/m2 to middle grey
    assert darkest.factor == pytest.approx(0.18 * grey_under(0.1) / 1.5625)
    brightness = [exposure.factor for exposure in exposures]
    assert all(a >= b - 1e-12 for a, b in pairwise(brightness))


def test_lowering_an_exposure_takes_away_gain_before_shutter_time():
    exposure = Exposure(2.0, 0.02, 1.5)
    once = exposure.lowered(0.8)
    assert (once.factor, once.shutter_s, once.gain) == pytest.approx((1.6, 0.02, 1.2))
    twice = exposure.lowered(0.5)
    assert (twice.factor, twice.shutter_s, twice.gain) == pytest.approx((1.0, 0.015, 1.0))


def test_gain_divides_the_electrons_of_a_white_pixel():
    light = np.full((400, 400, 3), 0.2, np.float32)
    counted = noisy(light, Noise(8000, 6, 4), gain=8.0) * 1000
    assert counted.mean() == pytest.approx(200, abs=0.5)
    assert counted.var() == pytest.approx(200 + 36, rel=0.02)
    grey = np.full((400, 400, 3), 120, np.uint8)
    plain, amplified = (
        with_chroma_noise(grey, ChromaNoise(0.01, 5.0, 1), gain)[..., 2].std() for gain in (1, 9)
    )
    assert amplified / plain == pytest.approx(3, rel=0.02)


def recorded(light, sensor, exposure):
    """Return the image of linear light [H, W, 3] that a camera 5 m away records."""
    height, width = light.shape[:2]
    frame = Frame(
        image=np.zeros((height, width, 3), np.uint8),
        cover=np.full((height, width), 255, np.uint8),
        ids=np.ones((height, width), np.uint16),
        damage=np.zeros((height, width), np.uint16),
        depth=np.full((height, width), 5.0, np.float32),
        radiance=light,
    )
    camera = Camera("T", (0, 9000, 0), (0, 0, 0), 35.0, sensor=sensor)
    view = view_of(camera, (width, height))
    return apply_camera_model(frame, view, camera, Weather(), (0.5, 0.5, 0.5), exposure)


def test_motion_blur_is_as_long_as_the_shutter_is_open():
    light = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    light[60, 80] = 3.0
    sensor = Sensor(meter=METER, speed=(2.0, 0.0), response=Response(1.0, 1.0, 1.0))
    for shutter_s in (0.02, 0.05):
        spread = DECODED[recorded(light, sensor, Exposure(1.0, shutter_s))[60, :, 0]]
        length = 2.0 * shutter_s * SIZE[0]
        # a uniform line of length l has variance l^2 / 12; pixel size adds less than 1/4
        found = (spread * (np.arange(SIZE[0]) - 80) ** 2).sum() / spread.sum()
        assert found == pytest.approx(length**2 / 12, abs=0.3)


@pytest.mark.parametrize(("bright", "times"), [(1.5, 1.2 / 1.5), (9.0, 0.5), (1.1, 1.0)])
def test_highlights_lower_the_exposure_by_up_to_a_stop(bright, times):
    response = Response(1.2, 1.0, 1.0)
    light = np.full((80, 80, 3), 0.2, np.float32)
    light[:16] = bright
    for share, factor in ((0.1, times), (0.3, 1.0)):
        sensor = Sensor(meter=replace(METER, highlights=share), response=response)
        image = recorded(light, sensor, Exposure(1.0, 0.001))
        expected = 255 * response_curve(np.array(0.2 * factor), response)
        assert image[40, 40, 0] == pytest.approx(float(expected), abs=0.6)


def test_bundled_environments_are_on_one_scale_of_illuminance():
    lux = {name: illuminance_of(name) for name in bundled_hdris()}
    assert all(5 <= lx <= 1.2e5 for lx in lux.values())
    nights = {name for name in lux if hours_of(name)[0] >= 18 and "night" in name}
    days = {name for name in lux if hours_of(name) == (8, 17) and name.startswith("port")}
    assert len(nights) >= 3
    assert len(days) >= 4
    assert max(lux[name] for name in nights) <= 50
    assert min(lux[name] for name in days) >= 1e4
    assert illuminance_of("not_bundled") == 1e4


def test_a_limited_meter_changes_only_dim_scenes(generators):
    """By day the exposure is that of a camera without limits, at 5 lx it is at most 0.06 / 0.18."""
    generator = generators(Config.preset(), seed=4, size=SIZE)
    scene = generator.scene(0)
    for lx, most in ((5e4, 1.0), (5.0, 0.06 / 0.18)):
        lit = replace(scene, environment=replace(scene.environment, illuminance_lx=lx))
        for camera in lit.cameras:
            free = generator.exposure(lit, camera)
            limited = generator.exposure(lit, replace(camera, sensor=Sensor(meter=METER)))
            assert limited / free <= most + 1e-9
            assert lx < 1e4 or limited == pytest.approx(free)


def test_a_meter_sees_the_ground_below_the_horizon(generators):
    """A view wholly below the horizon weighs the ground by 35 %; a view of the sky ignores it."""
    generator = generators(Config.preset(), seed=4, size=SIZE)
    scene = generator.scene(0)
    scene = replace(scene, environment=replace(scene.environment, illuminance_lx=5e4))
    down = Camera("down", (0, -9000, 12000), (0, -2000, 0), 35.0, sensor=Sensor(meter=METER))
    up = replace(down, name="up", target_mm=(0, -2000, 26000))
    for camera, weight in ((down, 0.35), (up, 0.0), (replace(down, sensor=None), 0.0)):
        dark, bright = (
            generator.exposure(
                replace(scene, ground=Ground("concrete", -2000.0, albedo=(albedo,) * 3)), camera
            )
            for albedo in (0.05, 0.4)
        )
        assert np.log2(dark / bright) == pytest.approx(3 * weight, abs=1e-6)


def test_scenes_hold_the_meter_and_the_illuminance_that_were_drawn():
    values = {
        "environment": {"names": ["port_night", "sky"], "illuminance_lx": {"sky": 7e4}},
        "sensor": {"meter": {"probability": 1.0}, "motion": {"probability": 1.0}},
    }
    generator = Generator(Config.from_values(values), seed=3)
    scenes = [generator.scene(index) for index in range(30)]
    assert {(s.environment.name, s.environment.illuminance_lx) for s in scenes} == {
        ("port_night", illuminance_of("port_night")),
        ("sky", 7e4),
    }
    for scene in scenes:
        assert Scene.from_json(scene.to_json()) == scene
        for camera in scene.cameras:
            assert 0.01 <= camera.sensor.meter.longest_s <= 0.04
            assert 800 <= camera.sensor.meter.largest_iso <= 3200
            assert camera.sensor.motion == (0, 0)
            assert 0.02 <= np.hypot(*camera.sensor.speed) <= 0.3001


def test_speed_needs_the_shutter_time_of_a_meter():
    with pytest.raises(ConfigError, match="speed: needs the shutter time"):
        Sensor(speed=(0.1, 0.0))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"sensor": {"meter": {"longest_s": 2}}}, "sensor.meter.longest_s.*1e-05 to 0.5 s"),
        ({"sensor": {"meter": {"largest_iso": 50}}}, "sensor.meter.largest_iso.*100 to 1e"),
        ({"environment": {"illuminance_lx": {"sky": 0}}}, "environment.illuminance_lx.sky"),
    ],
)
def test_bad_values_are_named(values, words):
    with pytest.raises(ConfigError, match=words):
        Config.from_values(values)
