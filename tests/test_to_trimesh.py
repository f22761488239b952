"""Scenes as trimesh objects: the same geometry and textures as in the exported file."""

import json

import numpy as np
import pytest
import trimesh
from trimesh.viewer.notebook import scene_to_html

from fastgen import Config, ConfigError, Generator, export_glb, to_trimesh

TEXEL_MM = 24.0


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """A scene with seals and a hole, as an object and as its GLB file reads."""
    values = {
        "container": {"kinds": {"20": 1}},
        "damage": {"probability": 1, "kinds": ["perforation"]},
        "seals": {"probability": 1},
        "spreader": {"probability": 0},
    }
    path = tmp_path_factory.mktemp("trimesh") / "scene.glb"
    with Generator(Config.from_values(values), seed=2, size=(128, 128), quality="draft") as made:
        scene = made.scene(0)
        export_glb(made, scene, path, texel_mm=TEXEL_MM)
        return to_trimesh(made, scene, TEXEL_MM), trimesh.load(path, process=False)


def test_the_geometry_is_that_of_the_file(both):
    made, loaded = both
    assert len(made.geometry) > 2
    assert set(made.geometry) == set(loaded.geometry)
    for name, part in made.geometry.items():
        assert len(part.faces) == len(loaded.geometry[name].faces)
        np.testing.assert_allclose(part.bounds, loaded.geometry[name].bounds, atol=1e-5)
    np.testing.assert_allclose(made.bounds, loaded.bounds, atol=1e-5)


def test_textures_and_colors_are_those_of_the_file(both):
    made, loaded = both
    textured = 0
    for name, part in made.geometry.items():
        ours, theirs = part.visual.material, loaded.geometry[name].visual.material
        if ours.baseColorTexture is not None:
            np.testing.assert_array_equal(ours.baseColorTexture, theirs.baseColorTexture)
            # points on the sheet have the texels that the file gives them
            np.testing.assert_allclose(part.visual.uv, loaded.geometry[name].visual.uv, atol=1e-5)
            textured += 1
        else:
            np.testing.assert_allclose(
                np.array(ours.baseColorFactor, float),
                np.array(theirs.baseColorFactor, float),
                atol=1,
            )
    assert 0 < textured < len(made.geometry)


def test_trimesh_converts_it_for_its_viewers(both):
    made, _ = both
    simple = made.geometry["container"].visual.material.to_simple()
    assert np.asarray(simple.image).shape[2] in (3, 4)
    page = scene_to_html(made)
    assert "<html" in page
    tree = json.loads(trimesh.exchange.gltf.export_gltf(made)["model.gltf"])
    assert len(tree["images"]) >= 2


def test_a_scene_without_anything_is_refused():
    config = Config.from_values({"container": {"absent": 1}})
    with (
        Generator(config, size=(128, 128), quality="draft") as made,
        pytest.raises(ConfigError, match="has no container"),
    ):
        to_trimesh(made, made.scene(0))
