"""Recordings for Rerun, read back by its own reader and compared with the renders."""

import sys

import numpy as np
import pytest
from rerun.chunk import RrdReader

from fastgen import Config, ConfigError, Generator, export_rerun, to_trimesh
from fastgen.cli.main import main
from tests.exported import TO_Z_UP
from tests.test_notebook import pixels

VALUES = {"container": {"kinds": {"20": 1}}, "spreader": {"probability": 0}}
TEXEL_MM = 24.0


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A generator, a scene, and the columns of its recording by entity and component."""
    path = tmp_path_factory.mktemp("recording") / "scene.rrd"
    config = Config.from_values(VALUES)
    with Generator(config, seed=2, size=(160, 120), quality="draft") as generator:
        scene = generator.scene(0)
        cameras = [scene.camera("A"), scene.camera("Cr")]
        export_rerun(generator, scene, path, cameras, TEXEL_MM)
        found = {}
        for chunk in RrdReader(path).stream().to_chunks():
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                key = (chunk.entity_path.strip("/"), name.rpartition(":")[2])
                found[key] = batch.column(name).to_pylist()[0]
        yield generator, scene, found


def test_cameras_project_as_the_renderer_does(made):
    generator, scene, found = made
    for name in ("A", "Cr"):
        view = generator.render(scene=scene, camera=name).view
        place = f"world/cameras/{name}"
        intrinsics = np.reshape(found[place, "image_from_camera"], (3, 3)).T  # by columns
        rotation = np.reshape(found[place, "mat3x3"], (3, 3)).T
        point = np.array([0.5, 0.3, 1.2])
        seen = intrinsics @ (rotation.T @ (point - np.ravel(found[place, "translation"])))
        np.testing.assert_allclose(seen[:2] / seen[2], view.project(1000 * point)[0], atol=1e-2)
        assert np.ravel(found[place, "resolution"]).tolist() == [160, 120]
    assert not [entity for entity, _ in found if entity.startswith("world/cameras/B")]


def test_images_depth_and_boxes_are_those_of_the_render(made):
    generator, scene, found = made
    sample = generator.render(scene=scene, camera="Cr")
    place = "world/cameras/Cr"
    (blob,) = found[f"{place}/image", "blob"]
    np.testing.assert_array_equal(pixels(bytes(blob)), sample.image)
    (buffer,) = found[f"{place}/depth", "buffer"]
    depth = np.frombuffer(bytes(buffer), np.float32).reshape(sample.depth.shape)
    assert (depth == 0).any()
    np.testing.assert_array_equal(np.where(depth == 0, np.inf, depth), sample.depth)
    seen = [item for item in sample.objects if item.bbox is not None]
    assert len(seen) > 2
    halves = np.array(found[f"{place}/boxes", "half_sizes"])
    centers = np.array(found[f"{place}/boxes", "centers"])
    boxes = np.concatenate([centers - halves, centers + halves], axis=1)
    np.testing.assert_array_equal(boxes, [item.bbox for item in seen])
    labels = found[f"{place}/boxes", "labels"]
    assert [label.split()[0] for label in labels] == [item.class_name for item in seen]


def test_meshes_stand_where_the_depth_image_says(made):
    generator, scene, found = made
    vertices = np.array(found["world/scene/container", "vertex_positions"])
    expected = to_trimesh(generator, scene, TEXEL_MM).geometry["container"]
    np.testing.assert_allclose(vertices, expected.vertices @ TO_Z_UP.T, atol=1e-4)
    view = generator.render(scene=scene, camera="A").view
    depth = ((vertices - view.position_m) @ view.rotation.T)[:, 2]
    seen = generator.render(scene=scene, camera="A")
    on_container = seen.depth[seen.damage > 0]
    assert depth.min() - 0.05 <= on_container.min()
    assert on_container.max() <= depth.max() + 0.05
    texcoords = np.array(found["world/scene/container", "vertex_texcoords"])
    np.testing.assert_allclose(texcoords[:, 1], 1 - expected.visual.uv[:, 1], atol=1e-6)


def test_the_command_writes_a_recording(tmp_path):
    arguments = ["export", "--index", "0", "--camera", "Cr", "--size", "96x96", "--texel-mm", "32"]
    path = tmp_path / "scene.rrd"
    assert main([*arguments, "-o", str(path)]) == 0
    entities = {chunk.entity_path for chunk in RrdReader(path).stream().to_chunks()}
    assert "/world/cameras/Cr/boxes" in entities
    assert not any("/cameras/A" in each for each in entities)


def test_bad_files_get_one_line(tmp_path, capsys, monkeypatch):
    for name, words in (("a.obj", "ends in .glb or .rrd"), ("no/a.rrd", "make it first")):
        assert main(["export", "--index", "0", "-o", str(tmp_path / name)]) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1
    monkeypatch.setitem(sys.modules, "rerun", None)
    with Generator(size=(96, 96)) as generator, pytest.raises(ConfigError, match=r"\[rerun\]"):
        export_rerun(generator, generator.scene(0), tmp_path / "a.rrd")
    assert not list(tmp_path.iterdir())
