"""Sensor and weather effects compared with optics, statistics and physical laws."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen.camera.blur import blur_radius_px, defocused, motion_blurred
from fastgen.camera.electronics import compress_jpeg, noisy, stamped, vignette
from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Camera, EnvironmentView, Scene
from fastgen.scene.optics import Defocus, Noise, Rain, Sensor, Stamp, Weather
from tests.test_environment import write_exr

SIZE = (160, 120)


def tone(c):
    """Tone-map and encode one colour by Khronos PBR Neutral and sRGB, as they are specified."""
    x = min(c)
    offset = x - 6.25 * x * x if x < 0.08 else 0.04
    c = [v - offset for v in c]
    peak = max(c)
    if peak >= 0.76:
        squeezed = 1 - 0.24**2 / (peak + 0.24 - 0.76)
        c = [v * squeezed / peak for v in c]
        g = 1 - 1 / (0.15 * (peak - squeezed) + 1)
        c = [v * (1 - g) + squeezed * g for v in c]
    return [255 * (12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055) for v in c]


def test_tone_mapping_follows_its_specification():
    light = np.random.default_rng(1).random((40, 30, 3)).astype(np.float32) ** 3 * 6
    expected = [[tone(pixel) for pixel in row] for row in light.tolist()]
    np.testing.assert_allclose(tone_map_and_encode(light), expected, atol=0.52)


def test_extreme_light_is_tone_mapped_to_black_or_white():
    light = np.array([[[np.inf] * 3, [1e30] * 3, [6e4, 6e4, 0.0], [-1.0] * 3]], np.float32)
    image = tone_map_and_encode(light)
    assert (image[0, :3] >= 254).all()
    assert (image[0, 3] == 0).all()


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_the_renderer_and_numpy_tone_map_alike(generators, quality):
    """Images differ by less than half a code from the exact tone curve of the linear frame."""
    generator = generators(seed=11, size=SIZE, quality=quality)
    prepared = PreparedScene(generator.scene(0))
    camera = prepared.scene.camera("B")
    with generator.gpu.drawing() as renderer:
        shown = renderer.render(prepared, camera, SIZE)
        linear = renderer.render(prepared, camera, SIZE, radiance=True)
    for name in ("ids", "damage", "depth", "cover"):
        np.testing.assert_array_equal(getattr(linear, name), getattr(shown, name))
    assert linear.radiance.max() > 1
    exact = [[tone(pixel) for pixel in row] for row in linear.radiance.tolist()]
    # rounding to a code, and the shader's polynomial for the sRGB curve
    np.testing.assert_allclose(shown.image, exact, atol=0.5 + 0.06)
    apart = np.abs(tone_map_and_encode(linear.radiance).astype(int) - shown.image)
    assert apart.max() <= 1
    assert apart.mean() < 0.05


def test_defocus_keeps_the_radiance_of_a_rendered_lamp(tmp_path):
    """A blurred lamp is brighter if the HDRI has more radiance, although both clip to white."""
    images = {}
    for radiance in (2.0, 50.0):
        sky = np.full((128, 256, 3), 0.02, np.float32)
        sky[60:64, 60:64] = radiance  # in front of a camera that looks along +y
        write_exr(tmp_path / f"{radiance:g}.exr", sky)
    defocus = Sensor(defocus=Defocus(300, 1.4))
    camera = Camera("T", (0, 9000, 1200), (0, 20000, 1200), 35.0, sensor=defocus, exposure_ev=0.0)
    with Generator(seed=6, size=SIZE, hdri_dir=tmp_path) as generator:
        for radiance in (2.0, 50.0):
            environment = EnvironmentView(f"{radiance:g}", 0.0)
            scene = replace(generator.scene(2), environment=environment)
            # the same exposure for both
            stops = np.log2(generator.exposure(scene, camera))
            shot = replace(camera, exposure_ev=float(-stops))
            images[radiance] = generator.render(scene=scene, camera=shot).image.astype(int)
            sharp = generator.render(scene=scene, camera=replace(shot, sensor=None)).image
            assert sharp.max() > 240
    lit = images[2.0] > images[2.0].min() + 10
    assert lit.any()
    assert images[50.0][lit].mean() > images[2.0][lit].mean() + 20


def test_vignetting_follows_the_fourth_power_of_a_cosine():
    share = vignette((301, 201), 0.6)[..., 0]
    corner_tan2 = (1 - 0.6) ** -0.5 - 1
    x, y = 260.5 - 150.5, 40.5 - 100.5
    angle = np.arctan(np.sqrt(corner_tan2 * (x * x + y * y) / (150.5**2 + 100.5**2)))
    assert share[40, 260] == pytest.approx(np.cos(angle) ** 4, rel=1e-4)
    assert share[100, 150] == pytest.approx(1, abs=1e-4)
    assert share[0, 0] == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("level", [0.02, 0.2, 1.0])
def test_noise_has_the_variance_of_counted_electrons(level):
    noise = Noise(full_well_e=3000, read_noise_e=9, seed=4)
    counted = noisy(np.full((400, 400, 3), level, np.float32), noise) * 3000
    assert counted.mean() == pytest.approx(3000 * level, abs=0.5)
    assert counted.var() == pytest.approx(3000 * level + 81, rel=0.02)


def test_noise_depends_only_on_its_seed():
    light = np.full((30, 30, 3), 0.3, np.float32)
    first = noisy(light, Noise(1000, 5, 7))
    np.testing.assert_array_equal(first, noisy(light, Noise(1000, 5, 7)))
    assert (first != noisy(light, Noise(1000, 5, 8))).mean() > 0.99


def test_blur_is_as_wide_as_traced_marginal_rays():
    camera = Camera("T", (0, 0, 0), (0, 1, 0), focal_mm=50.0)
    defocus = Defocus(focus_mm=3000, f_number=2.0)
    sensor_at = 1 / (1 / 50 - 1 / 3000)
    for depth_mm in (1500.0, 3000.0, 9000.0):
        image_at = 1 / (1 / 50 - 1 / depth_mm)
        # a ray through the aperture's rim, 12.5 mm off the axis, converges at image_at
        on_sensor_mm = abs(12.5 * (1 - sensor_at / image_at))
        radius = blur_radius_px(defocus, camera, 640, np.array([[depth_mm / 1e3]], np.float32))
        assert radius[0, 0] == pytest.approx(on_sensor_mm / 36 * 640, rel=1e-4, abs=1e-3)
    assert np.isfinite(blur_radius_px(defocus, camera, 640, np.array([[np.inf]], np.float32)))


def test_a_point_out_of_focus_becomes_a_disc_of_equal_energy():
    light = np.zeros((41, 41, 3), np.float32)
    light[20, 20] = 1
    spread = defocused(light, np.full((41, 41), 6.0, np.float32))[..., 0]
    assert spread.sum() == pytest.approx(1, rel=1e-4)
    assert spread[20, 20] == pytest.approx(1 / (np.pi * 36), rel=0.03)
    away = np.hypot(*(np.mgrid[:41, :41] - 20))
    assert spread[away > 7].max() < 1e-6
    np.testing.assert_allclose(spread[away < 5], spread[20, 20], rtol=1e-3)


def test_motion_spreads_a_point_evenly_around_its_position():
    light = np.zeros((61, 61, 3), np.float32)
    light[30, 30] = 1
    spread = motion_blurred(light, (20.0, 8.0))[..., 0]
    row, column = np.mgrid[:61, :61] - 30
    assert spread.sum() == pytest.approx(1, rel=1e-4)
    assert (spread * column).sum() == pytest.approx(0, abs=1e-3)
    assert (spread * row).sum() == pytest.approx(0, abs=1e-3)
    # a uniform line of length l has variance l^2 / 12; pixel size adds less than 1/4
    assert (spread * column**2).sum() == pytest.approx(20**2 / 12, abs=0.3)
    assert (spread * row**2).sum() == pytest.approx(8**2 / 12, abs=0.3)
    assert motion_blurred(light, (0.0, 0.0)) is light


def test_stamps_stay_in_their_corner():
    image = np.full((240, 320, 3), 90, np.uint8)
    for corner in ("top left", "bottom right"):
        changed = (stamped(image, Stamp("2024-02-29 12:00", corner, 0.04)) != image).any(axis=2)
        rows, columns = np.nonzero(changed)
        assert 100 < changed.sum() < 0.1 * changed.size
        assert rows.max() < 40 if "top" in corner else rows.min() > 200
        assert columns.min() < 20 if "left" in corner else columns.max() > 300


def test_jpeg_loses_more_at_lower_quality():
    image = np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)
    coarse, fine = (
        np.abs(compress_jpeg(image, quality).astype(int) - image).mean() for quality in (20, 90)
    )
    assert coarse > fine > 0


def test_by_default_cameras_are_perfect_and_the_sky_is_clear():
    scene = Generator(seed=2).scene(5)
    assert scene.weather == Weather()
    assert all(camera.sensor is None and camera.lens is None for camera in scene.cameras)


def test_the_preset_of_real_cameras_shares_all_other_draws_and_survives_json():
    same = {"markings": {"marked_containers": 1.0}}
    same["surface"] = Config.preset().to_plain()["surface"]
    same["spreader"] = {"probability": Config.preset().spreader.probability}
    same["seals"] = {"probability": 0.0}
    same["environment"] = {"lamps": {"probability": 0.0}}
    same["damage"] = Config.preset().to_plain()["damage"]
    crane = Generator(Config.from_values(same, Config.preset("crane")), seed=4)
    plain = Generator(seed=4)
    kinds = set()
    for index in range(12):
        scene, other = crane.scene(index), plain.scene(index)
        assert Scene.from_json(scene.to_json()) == scene
        assert replace(scene, cameras=other.cameras, weather=Weather()) == other
        for a, b in zip(scene.cameras, other.cameras, strict=True):
            assert (a.position_mm, a.target_mm, a.roll_deg) == (
                b.position_mm,
                b.target_mm,
                b.roll_deg,
            )
            assert a.sensor is not None
            kinds |= {name for name in ("noise", "stamp", "defocus") if getattr(a.sensor, name)}
    assert kinds == {"noise", "stamp", "defocus"}


def test_the_shortest_allowed_shutter_is_sampled_and_rendered(generators):
    weather = {"rain_probability": 1.0, "shutter_s": [1e-5, 1.2e-5]}
    generator = generators(Config.from_values({"weather": weather}), size=SIZE)
    drawn = {generator.scene(index).weather.rain.shutter_s for index in range(5)}
    assert len(drawn) == 5
    assert min(drawn) >= 1e-5
    assert max(drawn) <= 1.2e-5
    # a drop that hardly moves has a streak of almost no length, which must not be divided by
    assert np.ptp(generator.render(index=0).image) > 0


def test_the_sensor_changes_no_label_and_its_images_repeat():
    sensor = Sensor(
        defocus=Defocus(1500, 1.4),
        motion=(0.01, 0.004),
        vignetting=0.3,
        exposure_error_ev=-0.5,
        gains=(1.1, 1.0, 0.9),
        noise=Noise(4000, 4, 3),
        stamp=Stamp("2024-02-29 12:00", "top left", 0.05),
        jpeg_quality=60,
    )
    weather = Weather(visibility_mm=80e3, rain=Rain(30, 0.002, 0.1, 5))
    with Generator(seed=6, size=SIZE) as generator, Generator(seed=6, size=SIZE) as again:
        scene = generator.scene(2)
        camera = scene.camera("B")
        clean = generator.render(scene=scene, camera=camera)
        stormy = replace(scene, weather=weather)
        real = generator.render(scene=stormy, camera=replace(camera, sensor=sensor))
        repeated = again.render(scene=stormy, camera=replace(camera, sensor=sensor))
    assert real.objects == clean.objects
    for name in ("ids", "damage", "depth"):
        np.testing.assert_array_equal(getattr(real, name), getattr(clean, name))
    assert (real.image != clean.image).mean() > 0.9
    np.testing.assert_array_equal(real.image, repeated.image)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            {"sensor": {"stamp": {"corners": ["top middle"]}}},
            r"sensor.stamp.corners\[0\]: 'top middle'",
        ),
        ({"sensor": {"jpeg_quality": [90, 40]}}, "sensor.jpeg_quality: the lowest value 90"),
        ({"sensor": {"vignetting": 1.0}}, "sensor.vignetting: 1.0 is out of range"),
        ({"weather": {"fog_probability": 2}}, "weather.fog_probability: 2 is out of range"),
        ({"sensor": {"noice": {}}}, r"sensor.noice: unknown key \(did you mean noise"),
    ],
)
def test_bad_values_are_named(values, words):
    with pytest.raises(ConfigError, match=words):
        Config.from_values(values)
