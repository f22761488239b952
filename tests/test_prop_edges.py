"""Coverage of pixels at the edges of props in front of the panorama, against rays."""

from dataclasses import replace

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Camera, EnvironmentView, Ground, Pose, Prop
from fastgen.scene.optics import Weather
from tests.plain import bare

SIZE = (160, 120)


def test_edge_pixels_of_a_prop_before_the_sky_are_covered_by_the_share_of_samples_that_hit_it():
    prop = Prop("box", Pose((0.0, 0.0, 6000.0), 25.0), (900.0, 700.0, 1500.0), (0.1, 0.1, 0.1))
    camera = Camera("up", (9000.0, -4000.0, 1500.0), (0.0, 0.0, 6000.0), 40.0, roll_deg=11.0)
    with Generator(Config.preset("gate"), seed=3, size=SIZE) as made:
        first = made.scene(0)
        scene = replace(
            bare(first),
            props=(prop,),
            damages=(),
            weather=Weather(),
            container=replace(first.container, present=False),
            environment=EnvironmentView("port_overcast", 0.0),
            ground=Ground("asphalt", 0.0, reach_mm=15000.0),
        )
        frame = made.gpu.renderer().render(PreparedScene(scene), camera, SIZE)
    box = trimesh.creation.box(prop.size_mm)
    turn = np.deg2rad(prop.pose.yaw_deg)
    box.apply_transform(trimesh.transformations.rotation_matrix(turn, (0, 0, 1)))
    box.apply_translation(prop.pose.position_mm)
    eye, rays = view_of(camera, (2 * SIZE[0], 2 * SIZE[1])).rays()  # the middles of four samples
    hit = RayMeshIntersector(box).intersects_any(
        np.tile(eye, (rays[..., 0].size, 1)), rays.reshape(-1, 3)
    )
    share = hit.reshape(SIZE[1], 2, SIZE[0], 2).mean(axis=(1, 3))
    assert (np.abs(frame.cover - 255 * share) > 1).sum() <= 2
    beyond = np.isinf(frame.depth) & (share > 0)
    assert beyond.sum() > 20
    assert (frame.cover[beyond] > 0).mean() > 0.95
