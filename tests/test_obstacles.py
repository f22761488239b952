"""Obstacles in panoramas hide the ground of the scene behind its containers."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image

from fastgen import Config, Generator
from fastgen.light.container_map import OBSTACLES_SIZE, load_container_map
from fastgen.light.hdri import bundled_hdris
from fastgen.light.octahedral import BORDER, sample_octahedral
from fastgen.resources import asset_path
from fastgen.scene import Camera, EnvironmentView, Ground, Lens, Spreader
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.optics import Weather

SIZE = (480, 320)
REACH_MM = 30000.0
PORTS = ("port_gate", "port_noon", "port_rail")
CAMERAS = (
    Camera("gate", (0.0, -3000.0, 2600.0), (9000.0, -24000.0, -400.0), 18.0, roll_deg=5.0),
    Camera("quay", (0.0, 4000.0, 2400.0), (-5000.0, 25000.0, -200.0), 18.0),
    Camera(
        "rail",
        (8000.0, 0.0, 2400.0),
        (25000.0, 3000.0, 0.0),
        16.0,
        lens=Lens("brown_conrady", (-0.2, 0.05, 0.0, 0.0, 0.0)),
    ),
)


def values_of(name):
    """Return the values of a bundled map, read without the package."""
    return np.asarray(Image.open(asset_path("hdri", f"{name}.containers.png")))


def obstacle_at(name, directions, yaw_deg):
    """Return whether the map's texel in each direction [..., 3] has anything above the ground."""
    values = values_of(name)
    height, width = values.shape
    azimuth = np.arctan2(directions[..., 1], directions[..., 0]) - np.deg2rad(yaw_deg)
    column = ((0.5 - azimuth / (2 * np.pi)) * width).astype(int) % width
    polar = np.arccos(directions[..., 2] / np.linalg.norm(directions, axis=-1))
    return values[np.minimum((polar / np.pi * height).astype(int), height - 1), column] > 0


@pytest.fixture(scope="module")
def scene():
    made = Generator(Config.preset("gate"), seed=3).scene(0)
    plain = replace(made, neighbours=(), spreader=Spreader(), weather=Weather(), props=())
    return replace(plain, ground=Ground("asphalt", -1200.0, wear=0.0, reach_mm=REACH_MM))


def seen(scene, name, camera, quality):
    """Return a sample, the same without ground, and facts of its pixels.

    The facts are bool [H, W], whether the pixel shows no object and its ray meets the plane;
    float [H, W], how far from the origin in reaches of the ground; and bool [H, W], whether the map
    has an obstacle there.
    """
    yaw_deg = 40.0
    placed = replace(scene, environment=EnvironmentView(name, yaw_deg))
    with Generator(Config.preset("gate"), size=SIZE, quality=quality) as generator:
        sample = generator.render(scene=placed, camera=camera)
        alone = generator.render(scene=replace(placed, ground=None), camera=camera)
    eye, rays = sample.view.rays()
    free = (sample.ids == 0) & (sample.damage == 0) & (rays[..., 2] < -1e-6)
    steps = (scene.ground.height_mm - eye[2]) / np.minimum(rays[..., 2], -1e-6)
    away = np.linalg.norm((eye + steps[..., None] * rays)[..., :2], axis=-1) / REACH_MM
    return sample, alone, free, away, obstacle_at(name, rays, yaw_deg)


@pytest.mark.parametrize("quality", ["draft", "balanced"])
@pytest.mark.parametrize(("name", "camera"), list(zip(PORTS, CAMERAS, strict=True)))
def test_ground_is_hidden_where_the_map_has_an_obstacle(scene, quality, name, camera):
    sample, alone, free, away, stands = seen(scene, name, camera, quality)
    # the map of the renderer has an eighth of the resolution
    kernel = np.ones((13, 13), np.uint8)
    inner = cv2.erode(stands.astype(np.uint8), kernel) > 0
    outer = cv2.dilate(stands.astype(np.uint8), kernel) > 0
    far = free & (away > 0.5) & (away < 0.98)
    assert np.isinf(sample.depth[far & inner]).all()
    assert np.isfinite(sample.depth[far & ~outer]).all()
    apart = np.abs(sample.image.astype(int) - alone.image).max(axis=-1)
    assert (apart[far & inner] > 4).mean() < 0.01
    assert (far & inner).sum() > 200
    assert (far & ~outer).sum() > 200


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_containers_stand_on_the_ground_whatever_the_map_has_there(scene, quality):
    camera = Camera("down", (0.0, -8000.0, 2500.0), (0.0, -2500.0, -1200.0), 18.0)
    sample, _, free, away, stands = seen(scene, "port_aisle", camera, quality)
    near = free & (
        away < (np.hypot(*KINDS[scene.container.kind].size_mm[:2]) / 2 + 1000) / REACH_MM
    )
    assert (near & stands).sum() > 200
    assert np.isfinite(sample.depth[near]).all()


def test_the_octahedral_map_has_the_mean_of_the_texels_around():
    containers = load_container_map(bundled_hdris()["port_gate"])
    assert containers is not None
    assert containers.obstacles.shape == (OBSTACLES_SIZE, OBSTACLES_SIZE)
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(20000, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    found = sample_octahedral(containers.obstacles[..., None].astype(np.float32), directions)[:, 0]
    wanted = obstacle_at("port_gate", directions, 0.0)
    width = 4 / (OBSTACLES_SIZE - 2 * BORDER)
    around = [
        obstacle_at("port_gate", directions + width * rng.normal(size=3), 0.0) for _ in range(24)
    ]
    clear = (np.array(around) == wanted).all(axis=0)
    assert 0.5 < clear.mean() < 1
    assert wanted[clear].sum() > 500
    np.testing.assert_array_equal(found[clear] > 127, wanted[clear])


def test_maps_of_ports_mark_cranes_and_no_ground():
    """Straight down there is ground, and cranes and masts rise above the horizon."""
    for name in PORTS:
        values = values_of(name)
        height = values.shape[0]
        assert not values[int(0.8 * height) :].any()
        assert (values[: height // 2] == 65535).mean() > 0.005
