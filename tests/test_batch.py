"""Generator.render_batch against Generator.render, image by image.

Both ways to copy images to the CPU run on the driver of this machine.
"""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.config.config import LabelConfig
from fastgen.errors import ConfigError
from fastgen.render import batch_readback
from fastgen.render.batch_readback import BatchReadback
from fastgen.render.renderer import Renderer
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Sensor

SIZE = (160, 96)
IMAGES = [(0, None), (1, "second"), (0, "last"), (3, "second"), (1, None), (0, "last")]
"""Scene and camera of each image: scenes alternate, and one image occurs twice."""


def damaged(preset):
    """Return a preset whose containers all have damages."""
    config = Config.preset(preset)
    return replace(config, damage=replace(config.damage, probability=1.0))


def assert_equal(ours, expected):
    for name in ("image", "cover", "ids", "damage", "depth", "normals", "background"):
        mine, wanted = getattr(ours, name), getattr(expected, name)
        assert (mine is None) == (wanted is None)
        if wanted is not None:
            assert mine.dtype == wanted.dtype, name
            np.testing.assert_array_equal(mine, wanted, name)
    for name in ("scene", "camera", "objects", "marker_classes"):
        assert getattr(ours, name) == getattr(expected, name), name


def chosen(generator, images=IMAGES):
    """Return indices and cameras of some images, whose cameras are named by their place."""
    places = {"second": 1, "last": -1}
    cameras = [
        generator.scene(index).cameras[places[place]] if place else None for index, place in images
    ]
    # a camera by its name, and another one as it is
    given = [each.name if each and k % 2 else each for k, each in enumerate(cameras)]
    return [index for index, _ in images], given


def copy_images(generator, collects):
    """Let a generator collect the images of a batch as on a GPU, or copy each as on a CPU."""
    with generator.gpu.drawing() as renderer:
        renderer._batch.release()
        renderer._batch = BatchReadback(renderer.ctx, collects)


@pytest.fixture(params=[False, True], ids=["copied", "collected"])
def generator(request, generators):
    """A generator of damaged containers, with either way to copy images."""
    made = generators(damaged("seafront"), seed=8, size=SIZE, quality="draft")
    copy_images(made, request.param)
    return made


@pytest.mark.parametrize(
    ("preset", "quality"),
    [
        *((preset, "draft") for preset in ("seafront", "gate", "yard", "quay", "crane")),
        ("gate", "balanced"),
        ("seafront", "high"),
    ],
)
def test_images_and_labels_equal_those_of_render(preset, quality):
    with Generator(damaged(preset), seed=8, size=SIZE, quality=quality) as generator:
        indices, cameras = chosen(generator)
        copied = generator.render_batch(indices, cameras)
        copy_images(generator, collects=True)
        found = generator.render_batch(indices, cameras)
        # the other way round, so that caches hold something else at each image
        pairs = [*zip(indices, cameras, strict=True)][::-1]
        expected = [generator.render(*each) for each in pairs][::-1]
    assert len(found) == len(IMAGES)
    for ours, wanted in zip(copied + found, 2 * expected, strict=True):
        assert_equal(ours, wanted)
    # otherwise the images would test less than they should
    assert len({each.scene.environment.name for each in found}) > 1
    assert len({each.image.tobytes() for each in found}) == len(set(IMAGES))
    assert any((each.damage > 101).any() for each in found)
    assert any(each.scene.neighbours for each in found) == (preset in ("gate", "yard", "quay"))


def test_images_with_and_without_linear_light_share_a_batch(generator):
    scenes = [generator.scene(index) for index in (0, 1, 2)]
    bare = [replace(scene.cameras[0], sensor=None) for scene in scenes]
    noisy = replace(bare[1], sensor=Sensor(vignetting=0.5))
    cameras = [bare[0], noisy, bare[2]]
    found = generator.render_batch(cameras=cameras, scenes=scenes, normals=True)
    for ours, scene, camera in zip(found, scenes, cameras, strict=True):
        assert_equal(ours, generator.render(scene=scene, camera=camera, normals=True))
    plain = generator.render(scene=scenes[1], camera=bare[1])
    assert (found[1].image != plain.image).any()


@pytest.mark.parametrize(
    ("limit", "value"), [("_MOST_IMAGES", 4), ("_MOST_BYTES", 12 * SIZE[0] * SIZE[1] * 4 + 11)]
)
def test_a_batch_larger_than_the_buffer_is_drawn_in_parts(generator, monkeypatch, limit, value):
    parts, render_batch = [], Renderer.render_batch

    def counted(renderer, images):
        parts.append(len(images))
        return render_batch(renderer, images)

    monkeypatch.setattr(batch_readback, limit, value)
    monkeypatch.setattr(Renderer, "render_batch", counted)
    indices, cameras = chosen(generator)
    found = generator.render_batch(indices, cameras)
    assert parts == [4, 2]
    for ours, *which in zip(found, indices, cameras, strict=True):
        assert_equal(ours, generator.render(*which))


def test_an_image_larger_than_the_buffer_is_drawn_alone(generator, monkeypatch):
    monkeypatch.setattr(batch_readback, "_MOST_BYTES", 1)
    found = generator.render_batch([0, 1])
    for index, ours in enumerate(found):
        assert_equal(ours, generator.render(index))


def test_batches_of_one_and_of_none(generator):
    (found,) = generator.render_batch([2], "Cr")
    assert_equal(found, generator.render(2, "Cr"))
    assert generator.render_batch([]) == []


def test_a_smaller_batch_after_a_larger_one(generator):
    generator.render_batch([0, 1, 2, 3])
    found = generator.render_batch(np.array([5, 4]), "B")
    for index, ours in zip((5, 4), found, strict=True):
        assert_equal(ours, generator.render(index, "B"))


def test_a_scene_is_sampled_once_whatever_the_order(generator, monkeypatch):
    sampled = []

    def counted(config, seed, index, environments):
        sampled.append(index)
        return sample_scene(config, seed, index, environments)

    monkeypatch.setattr("fastgen.generator.sample_scene", counted)
    found = generator.render_batch([21, 22, 23, 21, 22, 23], ["A", "A", "A", "B", "B", "B"])
    assert sampled == [21, 22, 23]
    assert [each.scene.index for each in found] == [21, 22, 23, 21, 22, 23]
    assert [each.camera.name for each in found] == ["A", "A", "A", "B", "B", "B"]


def test_label_rules_and_single_layers_are_those_of_render(generator):
    rules = LabelConfig(min_visible_px=10**6)
    (found,) = generator.render_batch([1], labels=rules)
    assert found.objects
    assert all(item.ignored for item in found.objects)
    assert_equal(found, generator.render(1, labels=rules))
    for ours, index in zip(generator.render_batch([0, 1], layer="rust"), (0, 1), strict=True):
        assert_equal(ours, generator.render(index, layer="rust"))


def test_a_sample_keeps_no_other_images_in_memory(generator):
    for sample in generator.render_batch([0, 1, 2]):
        for array in (sample.image, sample.cover, sample.ids, sample.damage, sample.depth):
            assert array.base is None or array.base.nbytes == array.nbytes


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "render_batch: give either indices or scenes"),
        ({"indices": [0], "scenes": []}, "render_batch: give either indices or scenes"),
        ({"indices": 3}, "indices: 3 is not a list"),
        ({"indices": "12"}, "indices: '12' is not a list"),
        ({"indices": np.array(3)}, "indices: .*3.* is not a list"),
        ({"indices": [0, -1]}, r"indices\[1\]: -1 is not a whole number"),
        ({"indices": [0, 1], "cameras": ["A"]}, "cameras: 1 for 2 images; give one for each"),
        ({"indices": [0, 1], "cameras": 5}, "cameras: 5 is not a list"),
        ({"indices": [4, 0, 4], "cameras": ["A", "A", "Z"]}, "image 2 of the batch: camera: 'Z'"),
        ({"indices": [0, 1], "cameras": "Z"}, "image 0 of the batch: camera: 'Z'"),
        ({"scenes": ["x"]}, "image 0 of the batch: scene: str is not a Scene"),
        ({"indices": [0], "layer": "rusty"}, "layer: 'rusty' is unknown"),
        ({"indices": [0], "labels": 3}, "labels: "),
    ],
)
def test_bad_arguments_are_named_before_anything_is_drawn(generator, monkeypatch, arguments, words):
    with monkeypatch.context() as patched:
        patched.setattr(Renderer, "render_batch", None)  # a call would raise a TypeError
        with pytest.raises(ConfigError, match=words):
            generator.render_batch(**arguments)
    assert_equal(generator.render_batch([6, 7])[1], generator.render(7))


def test_a_batch_that_fails_between_two_images_leaves_the_generator_usable(generator):
    scene = generator.scene(1)
    dark = replace(scene, environment=replace(scene.environment, name="no_such_hdri"))
    with pytest.raises(ConfigError, match="no_such_hdri"):
        generator.render_batch(scenes=[generator.scene(0), dark, generator.scene(2)])
    for index, ours in enumerate(generator.render_batch([0, 1])):
        assert_equal(ours, generator.render(index))
