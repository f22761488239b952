"""Rendered images and labels compared with rays, algebra and renders at other sizes."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen.camera.projection import view_of
from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.render.gpu_mesh import facing_groups
from fastgen.render.settings import QUALITY, Quality
from fastgen.scene import Spreader
from fastgen.srgb import DECODED
from tests import oracle
from tests.backends import needs_osmesa
from tests.tone_inverse import light_of

CAMERAS = ("A", "B", "Cl", "Cr")
SIZE = (320, 240)


SOUND = Config.from_values({"damage": {"probability": 0}})


@pytest.fixture(scope="module")
def generator():
    with Generator(SOUND, seed=5, size=SIZE) as made:
        yield made


def rest_mesh(scene):
    return build_container(scene.container.kind, scene.container.profiles)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("index", [0, 1, 2])
def test_ids_and_depth_equal_ray_casts_through_pixel_centres(generator, camera, index):
    sample = generator.render(index=index, camera=camera)
    mesh = rest_mesh(sample.scene)
    hits = oracle.cast(mesh, sample.view, sample.scene)
    expected = oracle.object_ids(sample.scene, mesh, hits)
    wrong = sample.ids != expected
    assert wrong.mean() < 2e-4
    assert not (wrong & ~oracle.near_edge(expected)).any()
    both = np.isfinite(hits.depth_m) & (sample.ids > 0)
    error = np.abs(sample.depth[both] - hits.depth_m[both]) / hits.depth_m[both]
    # a pixel centre may fall on either side of an inner edge, so a few pixels may differ
    assert np.quantile(error, 0.999) < 1e-5
    assert np.isinf(sample.depth[sample.ids == 0]).all()


def test_damage_is_the_undamaged_value_wherever_the_container_is_visible(generator):
    sample = generator.render(index=3, camera="B")
    container = (sample.ids > 0) & (sample.ids != oracle.SPREADER)
    np.testing.assert_array_equal(sample.damage, np.where(container, 101, 0))


def test_ids_do_not_depend_on_antialiasing():
    frames = []
    for quality in ("draft", "balanced", "fine", "high"):
        with Generator(SOUND, seed=5, size=SIZE, quality=quality) as generator:
            frames.append(generator.render(index=1, camera="Cr"))
    for other in frames[1:]:
        assert (frames[0].ids != other.ids).mean() < 2e-4
        # the pictures differ only at edges, and by one step where the sky is filtered more finely
        difference = np.abs(frames[0].image.astype(int) - other.image.astype(int))
        assert np.median(difference) <= 1
        assert difference.mean() < 6


def test_antialiasing_approaches_a_fine_render_averaged_down(generators):
    """The reference has 4x4 as many pixels, averaged as linear light before the tone curve."""
    fine = (4 * SIZE[0], 4 * SIZE[1])
    generator = generators(SOUND, seed=5, size=fine, quality="draft")
    light = light_of(generator.render(index=1, camera="Cl").image)
    gathered = light.reshape(SIZE[1], 4, SIZE[0], 4, 3).mean(axis=(1, 3))
    reference = tone_map_and_encode(gathered).astype(float)
    errors = []
    for quality in ("draft", "balanced", "fine"):
        with Generator(SOUND, seed=5, size=SIZE, quality=quality) as generator:
            sample = generator.render(index=1, camera="Cl")
        errors.append(np.abs(sample.image - reference)[oracle.near_edge(sample.ids)].mean())
    assert errors[1] < 0.8 * errors[0]
    assert errors[2] < 0.8 * errors[1]


def test_the_layers_of_high_approach_a_fine_render_averaged_down(generators):
    """Away from edges, `high` looks up the layers several times per pixel and `draft` once."""
    rusty = Config.from_values({"surface": {"rust_coverage": 0.2}, "damage": {"probability": 0}})
    fine = (5 * SIZE[0], 5 * SIZE[1])
    generator = generators(rusty, seed=5, size=fine, quality="draft")
    scene = replace(generator.scene(1), spreader=Spreader())
    albedo = light_of(generator.render(scene=scene, camera="A", layer="rust").image)
    reference = albedo.reshape(SIZE[1], 5, SIZE[0], 5, 3).mean(axis=(1, 3))
    errors = []
    for quality in ("draft", "high"):
        with Generator(rusty, seed=5, size=SIZE, quality=quality) as generator:
            sample = generator.render(scene=scene, camera="A", layer="rust")
        inside = cv2.erode((sample.ids > 0).astype(np.uint8), np.ones((3, 3))) > 0
        errors.append(np.abs(light_of(sample.image) - reference)[inside].mean())
    assert errors[1] < 0.7 * errors[0]


def test_a_marker_behind_a_locking_bar_shows_up_to_the_bar():
    """Pixels whose centre the bar or gasket covers also match a fine render averaged down."""
    dark = {"surface": {"colors": {"paint": "#101010"}, "rust_coverage": 0}}
    rig = {"cameras": {"end": {"face": "door", "focal_mm": 45, "distance_mm": 6000}}}
    config = Config.from_values({**dark, **rig, "damage": {"probability": 0}})
    images = []
    for quality, size in (("draft", (864, 864)), ("high", (96, 96))):
        with Generator(config, seed=3, size=size, quality=quality) as generator:
            scene = replace(generator.scene(1), spreader=Spreader())
            marker = next(decal for decal in scene.decals if decal.kind == "marker")
            place = {"face": "door", "center_mm": (1091.0, 1400.0), "size_mm": (900.0, 900.0)}
            fresh = {"wear": 0.0, "fade": 0.0, "torn": (0.0,) * 4}
            white = replace(marker, art="C6.1", class_name="C6.1", **fresh, **place)
            alone = replace(scene, decals=(white,))
            shown = generator.render(scene=alone, layer="decals").image
            images.append(DECODED[shown])
    reference = images[0].reshape(96, 9, 96, 9, 3).mean(axis=(1, 3))
    error = np.sort(np.abs(images[1] - reference)[2:-2, 2:-2].max(axis=2), axis=None)
    # one pixel shows the end of a lever, which is smaller than the distance of samples
    assert error[-2] < 0.25


TIMES = 12
"""Pixels of `fine_ids` along a side of a pixel of SIZE."""


@pytest.fixture(scope="module")
def fine_ids():
    """Ids of a view at TIMES x TIMES the resolution."""
    with Generator(SOUND, 5, (TIMES * SIZE[0], TIMES * SIZE[1]), quality="draft") as generator:
        return generator.render(index=1, camera="B").ids


@pytest.mark.parametrize("samples", [9, 25, 4])
def test_cover_is_the_share_of_a_pixel_that_objects_cover(fine_ids, samples, monkeypatch):
    """Compare with ids at 12x12 the resolution, filtered by a tent for four samples, else a box.

    Pixel centres alone would have a mean error of 0.006.
    """
    seen = (fine_ids > 0).astype(np.float32)
    half = TIMES // 2
    if samples == 4:
        seen = cv2.blur(seen, (TIMES + 1, TIMES + 1))  # two box filters make a tent
    expected = cv2.blur(seen, (TIMES, TIMES), anchor=(half, half))[half::TIMES, half::TIMES]
    monkeypatch.setitem(QUALITY, "balanced", Quality(round(samples**0.5), 1))
    with Generator(SOUND, seed=5, size=SIZE) as generator:
        sample = generator.render(index=1, camera="B")
    error = np.abs(sample.cover / 255 - expected)
    assert 0.1 < (expected > 0).mean() < 0.9
    assert error.mean() < 0.002
    assert error.max() < 0.4


def test_the_same_scene_renders_to_the_same_bytes(generator):
    first = generator.render(index=4, camera="A")
    generator.render(index=5, camera="Cr")
    again = generator.render(index=4, camera="A")
    np.testing.assert_array_equal(first.image, again.image)
    np.testing.assert_array_equal(first.ids, again.ids)


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_renders_do_not_depend_on_earlier_ones(quality):
    """Render the same views in one order and in the opposite order."""
    damaged = Config.from_values({"damage": {"probability": 0.7}})
    views = [(index, camera) for index in range(6) for camera in ("A", "Cl", "Cr")]
    found = []
    for order in (views, views[::-1]):
        with Generator(damaged, 11, (128, 96), quality=quality) as made:
            found.append({view: made.render(*view) for view in order})
    for view in views:
        first, second = (samples[view] for samples in found)
        for name in ("image", "ids", "damage", "depth"):
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


@needs_osmesa
def test_backends_agree_on_every_label():
    frames = []
    for backend in ("egl", "osmesa"):
        with Generator(SOUND, seed=5, size=SIZE, backend=backend) as generator:
            frames.append(generator.render(index=2, camera="B"))
    assert (frames[0].ids != frames[1].ids).mean() < 1e-4
    difference = np.abs(frames[0].image.astype(int) - frames[1].image.astype(int))
    assert np.quantile(difference, 0.999) <= 1


@pytest.mark.parametrize("camera", CAMERAS)
def test_culled_faces_are_never_visible(generator, camera):
    scene = generator.scene(index=6)
    mesh = rest_mesh(scene)
    position = scene.camera(camera).position_mm
    kept = facing_groups(mesh, position)
    hits = oracle.cast(mesh, view_of(scene.camera(camera), SIZE))
    drawn = np.zeros(len(mesh.triangles), bool)
    for name in kept:
        drawn[mesh.groups[name]] = True
    assert drawn[hits.triangle[hits.hit]].all()
    assert not drawn.all()


@pytest.mark.parametrize("size", [(64, 64), (100, 37 + 64), (1333, 800), (4096, 64)])
def test_every_size_is_drawn_completely(generators, size):
    generator = generators(SOUND, seed=5, size=size)
    sample = generator.render(index=0, camera="Cr")
    assert sample.image.shape == (size[1], size[0], 3)
    assert sample.ids.shape == sample.depth.shape == sample.damage.shape == size[::-1]
    assert (sample.ids > 0).any()


def test_the_largest_holed_image_fits_the_driver(generators):
    config = Config.from_values({"damage": {"probability": 1, "kinds": ["perforation"]}})
    generator = generators(config, seed=5, size=(128, 4096))
    sample = generator.render(index=0, camera="Cr")
    assert sample.ids.shape == (4096, 128)


def test_a_camera_inside_the_wall_crosses_the_near_plane_without_harm(generator):
    scene = generator.scene(index=0)
    camera = scene.camera("A")
    close = replace(camera, position_mm=(0, -1400, 1200), target_mm=(2000, -1219, 1200))
    sample = generator.render(scene=scene, camera=close)
    assert np.isfinite(sample.depth[sample.ids > 0]).all()
    assert (sample.ids > 0).mean() > 0.2


def test_removing_markers_changes_no_other_ids(generator):
    """Ids change only in the pixels of the removed markers."""
    scene = generator.scene(index=7)
    sample = generator.render(scene=scene, camera="Cr")
    bare = replace(scene, decals=tuple(d for d in scene.decals if d.kind != "marker"))
    without = generator.render(scene=bare, camera="Cr")
    markers = [o.id for o in sample.objects if o.class_name.startswith("C")]
    np.testing.assert_array_equal((sample.ids > 0), (without.ids > 0))
    covered = np.isin(sample.ids, markers)
    same_text = (sample.ids > 1) & ~covered
    np.testing.assert_array_equal(same_text, (without.ids > 1) & ~covered)


def test_normals_equal_those_of_the_visible_triangles(generators):
    generator = generators(SOUND, seed=5, size=SIZE, quality="draft")
    for camera in ("A", "Cl"):
        scene = replace(generator.scene(1), spreader=Spreader())
        sample = generator.render(scene=scene, camera=camera, normals=True)
        mesh = build_container(scene.container.kind, scene.container.profiles)
        hits = oracle.cast(mesh, sample.view, scene)
        world = mesh.normals[mesh.triangles[hits.triangle, 0]]
        truth = world @ sample.view.rotation.T
        both = hits.hit & (sample.ids > 0)
        error = np.linalg.norm(sample.normals - truth, axis=-1)[both]
        assert np.quantile(error, 0.99) < 0.03
        assert not sample.normals[sample.ids == 0].any()


@pytest.mark.parametrize("quality", ["balanced", "high"])
def test_normals_at_edges_face_the_camera(generators, quality):
    """Sky samples of a pixel must not contribute to its mean normal."""
    generator = generators(SOUND, seed=5, size=SIZE, quality=quality)
    for camera in CAMERAS:
        sample = generator.render(index=1, camera=camera, normals=True)
        edges = (sample.ids > 0) & (sample.cover < 255)
        _, rays = sample.view.rays()
        toward = np.einsum("hwc,hwc->hw", sample.normals, rays @ sample.view.rotation.T)
        assert edges.sum() > 100
        assert (toward[edges] > 0.1).mean() < 0.01
