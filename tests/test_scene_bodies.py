"""What rays of the quality `high` hit, against what is drawn."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.environment import Ambient, load_environment
from fastgen.light.ground_light import ground_light
from fastgen.light.hdri import bundled_hdris
from fastgen.light.surrounding_light import directional_light
from fastgen.render.scene_bodies import scene_bodies
from fastgen.scene import Camera, EnvironmentView, Ground, Pose, Prop, Spreader
from fastgen.scene.boxes import OrientedBox
from fastgen.scene.optics import Weather
from tests.oracle import near_edge

SIZE = (160, 120)
GROUND = Ground("asphalt", -1200.0, (0.3, 0.25, 0.2), wear=0.0, reach_mm=30000.0)
PROPS = (
    Prop("box", Pose((0.0, -300.0, -700.0), 20.0), (3000.0, 800.0, 400.0), (0.5, 0.4, 0.1)),
    Prop("cylinder", Pose((2600.0, -1500.0, -700.0), -15.0), (1000.0, 900.0, 1000.0), (0.3,) * 3),
)
CAMERAS = (
    Camera("above", (0, -5000, 3500), (800, -700, -800), 30.0),
    Camera("level", (7000, -4000, -500), (1000, -900, -700), 35.0),
)


@pytest.mark.parametrize("name", ["venice", "sky"])
def test_rays_see_props_in_the_light_in_which_they_are_drawn(name):
    environment = EnvironmentView(name, 140.0)
    ambient = Ambient.of(load_environment(bundled_hdris()[name]))
    light = ground_light([], [], ambient, environment.yaw_deg, GROUND.height_mm)
    with Generator(Config.preset("gate"), seed=3, size=SIZE, quality="draft") as generator:
        scene = generator.scene(0)
        scene = replace(
            scene,
            container=replace(scene.container, present=False),
            environment=environment,
            ground=GROUND,
            props=PROPS,
            cameras=CAMERAS,
            weather=Weather(),
            **dict.fromkeys(("neighbours", "decals", "damages", "seals"), ()),
            spreader=Spreader(),
        )
        bodies = scene_bodies([], scene, False, ambient, light)
        black = replace(GROUND, albedo=(0.0, 0.0, 0.0))
        alone = scene_bodies([], replace(scene, ground=black), False, ambient, light)
        for camera in CAMERAS:
            with generator.gpu.drawing() as renderer:
                frame = renderer.render(PreparedScene(scene), camera, SIZE, "all", radiance=True)
            drawn = frame.radiance / generator.exposure(scene, camera)
            eye, rays = view_of(camera, SIZE).rays()
            toward = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(-1, 3)
            toward = toward.astype(np.float32)
            start = np.broadcast_to(eye, toward.shape).astype(np.float32)
            expected, of_props = np.zeros((2, *drawn.shape), np.float32)
            for image, hit in ((expected, bodies), (of_props, alone)):
                which, radiance = hit.hits(start, toward)
                image.reshape(-1, 3)[which] = radiance
            # a black ground reflects nothing, so only props do
            prop = of_props.max(axis=-1) > 0
            clear = ~near_edge(prop) & prop
            assert clear.mean() > 0.03
            error = np.abs(drawn - expected)[clear] / expected[clear].mean()
            assert np.median(error) < 0.03
            assert np.percentile(error, 90) < 0.15


def test_a_box_hides_the_sun_from_the_ground_behind_it():
    box = OrientedBox(np.array([0.0, 0.0, 0.0]), np.array([1000.0, 3000.0, 1000.0]), np.eye(3))
    toward, light = np.array([3.0, 0.0, 4.0]) / 5, np.array([2.0, 1.0, 0.5])
    # the shadow is 1.5 m long on the side away from the sun
    x = np.array([-4000.0, -2600.0, -2400.0, -1100.0, 1100.0, 4000.0])
    places = np.column_stack([x, np.zeros(6), np.full(6, -1000.0)])
    level = np.broadcast_to((0.0, 0.0, 1.0), places.shape)

    def found_from(direction):
        sun = SimpleNamespace(direction=direction, light=light)
        return directional_light(places, level, [box], SimpleNamespace(lights=[sun]), 0.0)

    found = found_from(toward)
    shown = np.array([True, True, False, False, True, True])
    np.testing.assert_allclose(found, shown[:, None] * 0.8 * light, atol=1e-9)
    assert not found_from(-toward).any()
