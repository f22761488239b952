"""White furnace: in a sky of even radiance, surfaces reflect what their albedo allows, and no more.

Heitz 2014, Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs, section 5.1.
"""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.classes import CONTAINER_ID
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import EnvironmentView, Spreader
from tests.plain import EVEN_PAINT
from tests.test_environment import write_exr

SIZE = (320, 320)
MOST_ALBEDO = 0.95
"""Albedo of the whitest paint, see shaders/material.glsl."""


@pytest.fixture(scope="module")
def even_sky(tmp_path_factory):
    folder = tmp_path_factory.mktemp("furnace")
    write_exr(folder / "even.exr", np.ones((128, 256, 3), np.float32))
    return folder


def reflected(folder, quality, roughness):
    """Return the radiance of each pixel of a white container relative to the sky.

    Returns:
        float32 [N] of all pixels that only it covers, and bool [N]: those on side walls that face
        straight out of the side, away from rails and posts.
    """
    surface = {**EVEN_PAINT, "colors": {"white": "#FFFFFF"}, "roughness": roughness}
    config = Config.from_values({"surface": surface, "damage": {"probability": 0}})
    with Generator(config, 3, SIZE, "auto", folder, quality) as generator:
        scene = replace(generator.scene(0), decals=(), seals=(), spreader=Spreader())
        scene = replace(scene, environment=EnvironmentView("even", 0.0))
        camera = scene.camera("A")
        frame = generator.gpu.renderer().render(
            PreparedScene(scene), camera, SIZE, radiance=True, normals=True
        )
        view = view_of(camera, SIZE)
    seen = (frame.ids == CONTAINER_ID) & (frame.cover == 255)
    sky = frame.radiance[frame.cover == 0].mean()
    eye, rays = view.rays()
    ahead = rays[seen] @ view.rotation[2]
    height = eye[2] + rays[seen][:, 2] * 1000 * frame.depth[seen] / ahead
    outward = -(frame.normals[seen] @ view.rotation)[:, 1]
    flat = (outward > 0.99) & (height > 400) & (height < 2200)
    return frame.radiance[seen].mean(axis=-1) / sky, flat


@pytest.mark.parametrize("roughness", [0.2, 0.5, 0.9])
def test_open_walls_reflect_all_that_their_albedo_allows(even_sky, roughness):
    light, flat = reflected(even_sky, "draft", roughness)
    assert flat.sum() > 1000
    # outer flats see all of the sky; the clear coat reflects some of what the paint would absorb
    open_sky = np.percentile(light[flat], 90)
    assert MOST_ALBEDO <= open_sky < MOST_ALBEDO + 0.02
    assert light.max() < 1.0


def test_concave_parts_lose_as_much_light_as_rays_say(even_sky):
    """Mean over a container, and over its corrugated walls alone."""
    (draft, flat), (traced, also) = (reflected(even_sky, q, 0.5) for q in ("draft", "high"))
    assert draft.mean() == pytest.approx(traced.mean(), abs=0.01)
    assert draft[flat].mean() == pytest.approx(traced[also].mean(), abs=0.01)
