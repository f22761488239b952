"""Light on the ground between the castings of a standing container, against rays."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Camera, EnvironmentView, Ground, Pose, Spreader
from fastgen.scene.boxes import container_box
from tests import oracle
from tests.plain import EVEN_PAINT
from tests.stability.test_furnace import even_sky  # noqa: F401

SIZE = (160, 120)
RAYS = 4000
BLACK = {**EVEN_PAINT, "colors": {"black": "#000000"}}


def test_ground_below_the_rails_has_the_light_that_the_gap_lets_in(even_sky):  # noqa: F811
    with Generator(Config.from_values({"surface": BLACK}), 3, SIZE, hdri_dir=even_sky) as made:
        first = made.scene(0)
        box = container_box(first.container.kind, Pose())
        _, side, bottom = box.center_mm - box.half_mm
        scene = replace(
            first,
            decals=(),
            damages=(),
            seals=(),
            spreader=Spreader(),
            ground=Ground("asphalt", float(bottom), wear=0.0, lines=0.0, reach_mm=30000.0),
            environment=EnvironmentView("even", 0.0),
        )
        camera = Camera("close", (500.0, side - 700, bottom + 700), (500.0, side, bottom), 500.0)
        away = replace(scene, container=replace(scene.container, present=False))
        renderer = made.gpu.renderer()
        seen, bare = (
            renderer.render(PreparedScene(each), camera, SIZE, radiance=True)
            for each in (scene, away)
        )
        mesh = PreparedScene(scene).container
    eye, rays = view_of(camera, SIZE).rays()
    at = eye + rays * ((bottom - eye[2]) / rays[..., 2])[..., None]
    middle = np.s_[:, SIZE[0] // 2]
    lit = np.where(seen.ids > 0, np.nan, seen.radiance.mean(axis=2) / bare.radiance.mean(axis=2))
    inward_mm, lit = at[middle][:, 1] - side, lit[middle]
    below = (inward_mm > 1) & np.isfinite(lit)
    assert below.sum() > 10
    _, body = oracle.body_of(mesh, ())
    rng = np.random.default_rng(1)
    u, v = rng.random((2, RAYS))
    round_, out = 2 * np.pi * v, np.sqrt(u)
    up = np.column_stack([out * np.cos(round_), out * np.sin(round_), np.sqrt(1 - u)])
    for place, share in zip(at[middle][below], lit[below], strict=True):
        start = np.repeat([1e-3 * place + (0.0, 0.0, 1e-5)], RAYS, axis=0)
        assert share == pytest.approx(1 - body.intersects_any(start, up).mean(), abs=0.03)
