"""Limits: many decals, extreme sizes, image borders, empty views and identical markers."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen.classes import DAMAGE_CLASSES, MARKER_CLASSES, SPREADER_ID
from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.scene import Camera, Container, Damage, Decal, Spreader
from tests import oracle


def bare(generator, index=0, kind=None):
    """Return a scene whose container has no decals, damages or spreader."""
    scene = generator.scene(index)
    container = Container(kind or scene.container.kind, scene.container.profiles)
    return replace(scene, container=container, decals=(), damages=(), spreader=Spreader())


def markers(count, columns, step, names, size=120.0):
    return tuple(
        Decal(
            "marker",
            names[i % len(names)],
            "front",
            (300 + step * (i % columns), 300 + step * (i // columns)),
            (size, size),
            art=names[i % len(names)],
        )
        for i in range(count)
    )


def check(sample):
    """Compare ids with ray casts, and boxes and areas with brute force over pixels."""
    scene = sample.scene
    mesh = build_container(scene.container.kind, scene.container.profiles)
    truth = oracle.object_ids(scene, mesh, oracle.cast(mesh, sample.view, scene))
    assert (sample.ids != truth).sum() <= 2 + 2e-5 * truth.size
    for item in sample.objects:
        held = (sample.ids > 0) & (sample.ids != SPREADER_ID)
        mask = held if item.id == 1 else sample.ids == item.id
        if item.class_name in DAMAGE_CLASSES:
            mask = sample.damage == item.id
        assert item.bbox == oracle.box_of(mask)
        assert item.area == mask.sum()


def test_300_markers_each_have_their_label(generators):
    values = {"probability": 1, "kinds": ["axis"], "count": [3, 3]}
    config = Config.from_values({"damage": values, "container": {"kinds": {"45HC": 1}}})
    generator = generators(config, seed=4, size=(800, 250))
    scene = replace(
        bare(generator),
        decals=markers(300, 60, 200, MARKER_CLASSES),
        damages=generator.scene(0).damages,
    )
    camera = Camera("all", (0, -9000, 1400), (0, 0, 1300), 20.0)
    sample = generator.render(scene=scene, camera=camera)
    labelled = [item for item in sample.objects if item.class_name in MARKER_CLASSES]
    assert len(labelled) == 300
    assert sum(item.class_name == "axis" for item in sample.objects) == 3
    assert len({item.id for item in sample.objects}) == len(sample.objects)
    assert all(item.area for item in labelled)
    check(sample)


def test_identical_markers_side_by_side_stay_apart(generators):
    generator = generators(seed=4, size=(640, 300))
    scene = replace(bare(generator), decals=markers(24, 12, 250, ("C3.2",), size=250.0))
    camera = Camera("row", (-1500, -5000, 900), (-1500, 0, 700), 30.0)
    sample = generator.render(scene=scene, camera=camera)
    check(sample)
    found = [item for item in sample.objects if item.class_name == "C3.2" and item.area]
    assert [item.instance for item in found] == sorted({item.instance for item in found})
    assert len(found) > 10


@pytest.mark.parametrize("size", [(64, 64), (64, 300), (4096, 64), (97, 4096), (1333, 800)])
def test_every_size_is_exact(generators, size):
    generator = generators(seed=8, size=size)
    sample = generator.render(index=1, camera="Cl")
    assert sample.image.shape == (size[1], size[0], 3)
    assert sample.ids.dtype == np.uint16
    check(sample)


def test_the_largest_size_renders(generators):
    generator = generators(seed=8, size=(4096, 4096), quality="draft")
    sample = generator.render(index=1, camera="Cr")
    assert sample.image.shape == (4096, 4096, 3)
    assert (sample.ids > 0).mean() > 0.02


def test_an_image_too_high_for_its_quality_takes_fewer_samples():
    """A hole needs a second view, which doubles the height of the targets."""
    holes = {"probability": 1, "count": [1, 1], "kinds": ["perforation"]}
    config = Config.from_values({"damage": holes, "spreader": {"probability": 0}})
    samples = []
    for quality in ("high", "draft"):
        with Generator(config, 8, (64, 2800), quality=quality) as generator:
            scene = generator.scene(1)
            (hole,) = scene.damages
            eye = tuple(np.array(hole.origin_mm) - 3000 * np.array(hole.inward))
            camera = Camera("close", eye, hole.origin_mm, 400.0)
            samples.append(generator.render(scene=scene, camera=camera))
            check(samples[-1])
    assert (samples[0].damage == 501).sum() > 200
    assert (samples[0].damage != samples[1].damage).mean() < 1e-3


def test_objects_out_of_view_have_no_boxes(generators):
    generator = generators(seed=8, size=(96, 64))
    camera = Camera("away", (0, -8000, 1000), (0, -20000, 1000), 14.5)
    sample = generator.render(index=2, camera=camera)
    assert not sample.ids.any()
    assert np.isinf(sample.depth).all()
    for item in sample.objects:
        assert item.bbox is None
        assert item.area == 0
        assert item.visible_fraction == 0
        assert not item.truncated
        assert item.ignored


@pytest.mark.parametrize("camera", ["A", "Cr"])
def test_a_dent_that_comes_out_on_the_other_side_leaves_no_pixel_undrawn(camera):
    edges = {"kinds": ["axis"], "probability": 1, "count": [4, 4]}
    for seed in (0, 1):
        with Generator(Config.from_values({"damage": edges}), seed, (128, 96)) as generator:
            scene = generator.scene(0)
            deep = tuple(replace(damage, depth_mm=12000.0) for damage in scene.damages)
            sample = generator.render(scene=replace(scene, damages=deep), camera=camera)
        assert np.isin(sample.ids, [0, *(item.id for item in sample.objects)]).all()
        np.testing.assert_array_equal(np.isinf(sample.depth), sample.ids == 0)
        assert (sample.depth > 0).all()


def test_a_container_whose_bulge_leaves_the_image_is_truncated(generators):
    generator = generators(Config.preset(), size=(192, 256))
    scene = bare(generator, kind="20")
    bulge = Damage(
        kind="concave",
        face="front",
        origin_mm=(2000.0, -1204.0, 1300.0),
        along=(1.0, 0.0, 0.0),
        across=(0.0, 0.0, 1.0),
        inward=(0.0, 1.0, 0.0),
        size_mm=(2000.0, 1800.0),
        depth_mm=-250.0,
    )
    camera = Camera("e", (100000.0, 0.0, 1300.0), (0.0, 0.0, 1300.0), 1384.0)
    scene = replace(scene, damages=(bulge,), cameras=(camera,))
    container = generator.render(scene=scene).objects[0]
    assert container.amodal_bbox[0] < -5
    assert container.truncated


def test_a_marker_on_the_border_is_truncated_and_one_within_is_not(generators):
    generator = generators(seed=8, size=(400, 400))
    scene = replace(bare(generator), decals=markers(1, 1, 0, ("C9.1",), size=300.0))
    mesh = build_container(scene.container.kind, scene.container.profiles)
    (x, y, z), *_ = mesh.sheet_to_surface("front", scene.decals[0].center_mm)[0]
    shift = 0.0
    # shift the camera until the marker's left tip is just inside the image, then just outside
    for gap, cut in ((0.3, False), (-1.3, True)):
        for _ in range(4):
            camera = Camera("at", (x + shift, y - 4000, z), (x + shift, y, z), 36.0)
            sample = generator.render(scene=scene, camera=camera)
            item = sample.objects[1]
            shift += (item.amodal_bbox[0] - gap) * 4000 / sample.view.focal_px
        assert item.amodal_bbox[0] == pytest.approx(gap, abs=0.1)
        assert item.truncated == cut
        assert item.visible_fraction == pytest.approx(1.0, abs=0.01)
        assert item.bbox[0] <= 2
