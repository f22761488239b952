"""Fog, rain and wet surfaces, compared with physics and with rays."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen.camera.exposure import Exposure
from fastgen.camera.projection import view_of
from fastgen.camera.sensor import apply_camera_model
from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.camera.weather import _streaks, add_fog, add_rain
from fastgen.config.config import Config
from fastgen.frame import Frame
from fastgen.generator import Generator
from fastgen.light.exposure import airlight
from fastgen.scene import Camera, EnvironmentView, Ground, Spreader
from fastgen.scene.optics import Lens, Rain, Weather
from tests.test_environment import write_exr
from tests.tone_inverse import light_of

SIZE = (160, 120)
EVEN_SKY = EnvironmentView("port_overcast", 0.0)


def test_fog_leaves_a_fiftieth_of_a_contrast_at_its_visibility():
    air = np.array([0.5, 0.5, 0.6], np.float32)
    light = np.array([[[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]] * 2, np.float32)
    away = np.array([[40.0, 40.0], [0.0, 0.0]], np.float32)
    whole = np.full((2, 2), 255, np.uint8)
    seen = add_fog(light, away, whole, 40e3, air)
    np.testing.assert_allclose(seen[0, 0] - seen[0, 1], 0.02, rtol=1e-3)
    np.testing.assert_allclose(seen[1], light[1])
    behind = add_fog(light, np.full((2, 2), np.inf, np.float32), 0 * whole, 40e3, air)
    np.testing.assert_allclose(behind, np.broadcast_to(air, behind.shape), atol=1e-6)


def test_fog_at_an_edge_veils_object_and_background_separately():
    # an object 20 m away partly covers an edge pixel; a thin one covers no pixel centre
    air, sky, thing = (
        np.array([0.4, 0.5, 0.6]),
        np.array([2.0, 1.8, 1.5]),
        np.array([0.1, 0.2, 0.05]),
    )
    share = np.repeat([[0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.6, 1.0, 1.0]], 6, axis=0)
    away = np.where(share == 1, 20.0, np.inf)
    clear = share[..., None] * thing + (1 - share[..., None]) * sky
    near, far = np.exp(-3.912 * 20 / 40), np.exp(-3.912 * 300 / 40)
    veiled = [light * t + air * (1 - t) for light, t in ((thing, near), (sky, far))]
    expected = share[..., None] * veiled[0] + (1 - share[..., None]) * veiled[1]
    cover = np.rint(255 * share).astype(np.uint8)
    values = [array.astype(np.float32) for array in (clear, away, air)]
    seen = add_fog(values[0], values[1], cover, 40e3, values[2])
    np.testing.assert_allclose(seen, expected, atol=1e-5)


def test_detail_behind_an_edge_does_not_shine_through_fog():
    """An edge and a cable stay between their own veiled light and that of the air."""
    rng = np.random.default_rng(8)
    air, thing = np.array([0.4, 0.5, 0.6]), np.array([0.1, 0.2, 0.05])
    sky = rng.exponential(2.0, (40, 40, 3))
    share = np.zeros((40, 40))
    share[:, 20:] = 1
    share[:, 19] = rng.random(40)
    share[:, 5] = 0.4
    cover = np.rint(255 * share).astype(np.uint8)
    share = cover[..., None] / 255
    clear = share * thing + (1 - share) * sky
    away = np.where(cover == 255, 20.0, np.inf)
    values = [array.astype(np.float32) for array in (clear, away, air)]
    seen = add_fog(values[0], values[1], cover, 40e3, values[2])
    near = np.exp(-3.912 * 20 / 40)
    veiled = share * (thing * near + air * (1 - near)) + (1 - share) * air
    assert (seen <= veiled + 1e-5).all()
    assert (seen >= air * (1 - near * share) - 1e-5).all()


def test_rain_is_hidden_by_nearer_surfaces_and_repeats():
    view = view_of(Camera("T", (0, -9000, 0), (0, 0, 0), 30.0), SIZE)
    light = np.full((120, 160, 3), 0.1, np.float32)
    depth = np.full((120, 160), np.inf, np.float32)
    depth[:, :80] = 0.1  # nearer than any drop
    rain = Rain(80, 0.002, 0.3, 11)
    sky = np.ones(3, np.float32)
    seen = add_rain(light, depth, view, rain, sky)
    np.testing.assert_array_equal(seen, add_rain(light, depth, view, rain, sky))
    np.testing.assert_array_equal(seen[:, :80], light[:, :80])
    assert (seen[:, 80:] > 0.1001).any()
    assert seen.max() <= 1.0
    heavy = add_rain(light, depth, view, replace(rain, rate_mm_h=250), sky)
    assert heavy.sum() > seen.sum()


def test_drops_have_94_percent_of_the_light_around_them():
    """Garg and Nayar 2007; drops vanish in front of a background of the same brightness."""
    view = view_of(Camera("T", (0, -9000, 0), (0, 0, 0), 30.0), SIZE)
    depth = np.full((120, 160), np.inf, np.float32)
    sky = np.array([2.0, 1.0, 0.5], np.float32)
    for share, sign in ((0.94, 0), (1.0, -1), (0.8, 1)):
        light = np.broadcast_to(share * sky, (120, 160, 3)).astype(np.float32)
        change = (add_rain(light, depth, view, Rain(150, 0.01, 0.3, 11), sky) - light) / sky
        assert (sign * change >= -1e-6).all()
        if sign:
            assert (sign * change).max() > 0.001
        else:
            assert np.abs(change).max() < 1e-6


@pytest.mark.parametrize(("wide", "long"), [(0.3, 2.0), (0.3, 20.0), (1.05, 20.0), (2.1, 5.4)])
def test_a_drops_total_coverage_depends_only_on_its_width(wide, long):
    """A drop covers its width squared over the exposure, wherever its streak begins and ends."""
    ways = np.array([[0.0, long], [long * 0.6, long * 0.8]])
    middle = np.array([[20.3, 40.6], [60.8, 41.1]])
    depth = np.full((80, 100), np.inf, np.float32)
    cover = _streaks(middle, ways, np.full(2, wide), np.ones(2), depth)
    assert cover.max() < 1
    assert cover.sum() == pytest.approx(2 * wide**2, rel=1e-5)


@pytest.mark.parametrize(
    ("position", "roll", "ratio"),
    [
        ((0, -9000, 0), 0.0, 8),
        ((0, -9000, 0), 90.0, 8),
        ((0, -9000, 0), -35.0, 8),
        ((0, -500, 9000), 0.0, 2),  # streaks are short near their vanishing point
    ],
)
def test_streaks_of_rain_run_where_falling_points_are_projected(position, roll, ratio):
    size = (320, 240)
    view = view_of(Camera("T", position, (0, 0, 0), 30.0, roll_deg=roll), size)
    dark = np.zeros((240, 320, 3), np.float32)
    depth = np.full((240, 320), np.inf, np.float32)
    rain = Rain(150, 0.01, 0.0, 3)
    seen = add_rain(dark, depth, view, rain, np.ones(3, np.float32))[..., 0]
    dy, dx = np.gradient(cv2.GaussianBlur(seen, (0, 0), 1.5))
    # image direction of a falling point three metres along each pixel's ray
    rows, columns = np.mgrid[0:240, 0:320] + 0.5
    offset = (np.stack([columns, rows], axis=-1) - view.center_px) / view.focal_px
    rays = np.concatenate([offset, np.ones((240, 320, 1))], axis=-1) @ view.rotation
    place = 1e3 * np.array(view.position_m) + 3000 * rays
    ends = [view.project((place + [0, 0, drop]).reshape(-1, 3))[0] for drop in (20, -20)]
    way = (ends[1] - ends[0]).reshape(240, 320, 2)
    way /= np.linalg.norm(way, axis=2, keepdims=True)
    along = (dx * way[..., 0] + dy * way[..., 1]) ** 2
    across = (dx * way[..., 1] - dy * way[..., 0]) ** 2
    assert across.sum() > ratio * along.sum()


def test_water_darkens_porous_surfaces(generators):
    config = Config.from_values({"surface": {"rust_coverage": 0.4}})
    generator = generators(config, seed=6, size=SIZE)
    scene = generator.scene(1)
    images = [
        generator.render(scene=replace(scene, weather=Weather(wetness=wetness)), layer=layer)
        for layer in ("rust", "reflection")
        for wetness in (0.0, 1.0)
    ]
    (dry, wet), (rough, smooth) = (
        [sample.image[sample.ids > 0].astype(int) for sample in images[i : i + 2]] for i in (0, 2)
    )
    assert (wet <= dry + 1).all()
    assert wet.mean() < 0.97 * dry.mean()
    assert smooth.mean() < 0.8 * rough.mean()


def test_each_camera_sees_drops_of_its_own_for_the_time_of_its_shutter():
    height, width = 240, 320
    dark = np.zeros((height, width, 3), np.float32)
    empty = np.zeros((height, width), np.uint16)
    away = np.full((height, width), np.inf, np.float32)
    cover = np.zeros((height, width), np.uint8)
    frame = Frame(dark.astype(np.uint8), cover, empty, empty, away, radiance=dark)
    weather = Weather(rain=Rain(20, 0.001, 0.0, 7))

    def drops(name, shutter_s=0.0):
        camera = Camera(name, (0, -6000, 1200), (0, 0, 1200), 24.0)
        view = view_of(camera, (width, height))
        exposure = Exposure(1.0, shutter_s)
        image = apply_camera_model(frame, view, camera, weather, (1.0, 1.0, 1.0), exposure)
        return image.max(axis=2) > 0

    one, other = drops("left"), drops("right")
    np.testing.assert_array_equal(one, drops("left"))
    # independent drops coincide as often as chance has it
    assert 0 < one.mean() < 0.3
    assert (one & other).mean() < 2 * one.mean() * other.mean()
    # with 2 ms instead of 1, streaks are longer but not twice, because a drop has a width too
    assert 1.2 < drops("left", 0.002).sum() / one.sum() < 2


@pytest.mark.parametrize("lens", [None, Lens("fisheye", (-0.02, 0.0, 0.0, 0.0))])
def test_fog_depends_on_the_distance_along_each_ray(generators, lens):
    camera = Camera("T", (0, -6000, 1200), (0, 0, 1200), 24.0, lens=lens)
    generator = generators(seed=6, size=SIZE)
    scene = replace(generator.scene(2), weather=Weather(visibility_mm=40e3), environment=EVEN_SKY)
    sample = generator.render(scene=scene, camera=camera)
    clear = generator.render(scene=replace(scene, weather=Weather()), camera=camera)
    with generator.gpu.drawing() as renderer:
        light, yaw_deg = renderer.ambient(scene), scene.environment.yaw_deg
        air = np.array(airlight(light, yaw_deg, generator.exposure(scene, camera)))
    _, rays = sample.view.rays()
    forward = sample.view.rotation[2]
    away = np.minimum(sample.depth / (rays @ forward), 300)
    left = np.exp(-3.912 * away / 40)[..., None]
    expected = tone_map_and_encode(
        (light_of(clear.image) * left + air * (1 - left)).astype(np.float32)
    )
    unmixed = np.isin(clear.cover, (0, 255))
    assert unmixed.mean() > 0.9
    assert np.abs(expected.astype(int) - sample.image)[unmixed].max() <= 1


def test_fog_continues_over_the_ground_of_the_surroundings(generators):
    camera = Camera("T", (0, -6000, 2500), (0, -12000, 2200), 20.0)
    generator = generators(seed=6, size=SIZE)
    ground = Ground("asphalt", 0.0, (0.1, 0.1, 0.1), reach_mm=15000.0)
    dry = replace(
        generator.scene(2),
        ground=ground,
        spreader=Spreader(),
        weather=Weather(),
        environment=EVEN_SKY,
    )
    foggy = replace(dry, weather=Weather(visibility_mm=150e3))
    clear, sample = (generator.render(scene=scene, camera=camera) for scene in (dry, foggy))
    with generator.gpu.drawing() as renderer:
        light, yaw_deg = renderer.ambient(dry), dry.environment.yaw_deg
        air = np.array(airlight(light, yaw_deg, generator.exposure(dry, camera)))
    _, rays = sample.view.rays()
    away = np.where(rays[..., 2] < 0, 2.5 / np.maximum(-rays[..., 2], 1e-6), 300).clip(max=300)
    left = np.exp(-3.912 * away / 150)[..., None]
    expected = tone_map_and_encode(
        (light_of(clear.image) * left + air * (1 - left)).astype(np.float32)
    )
    beyond = (clear.cover == 0) & np.isinf(clear.depth)
    below = beyond & (away > 20) & (away < 120)
    assert below.sum() > 100
    assert np.abs(expected.astype(int) - sample.image)[below].max() <= 2


def test_in_front_of_an_even_sky_fog_is_as_bright_as_the_sky(tmp_path):
    """Fog scatters as much light to the camera as it removes, for a sky of any colour."""
    write_exr(tmp_path / "even.exr", np.full((128, 256, 3), [0.11, 0.08, 0.05], np.float32))
    camera = Camera("T", (0, -9000, 1200), (0, 0, 3600), 14.0, exposure_ev=-1.0)
    with Generator(seed=6, size=SIZE, hdri_dir=tmp_path) as generator:
        scene = generator.scene(2)
        clear, fog = (
            generator.render(scene=replace(scene, weather=weather), camera=camera)
            for weather in (Weather(), Weather(visibility_mm=40e3))
        )
    sky = clear.cover == 0
    assert sky.mean() > 0.2
    assert clear.image[sky].max() < 250
    assert np.abs(clear.image[sky].astype(int) - fog.image[sky]).max() <= 2
    assert np.abs(clear.image[~sky].astype(int) - fog.image[~sky]).max() > 20
