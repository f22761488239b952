"""Points from which rays are cast, and how their light spreads over the image."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.errors import ConfigError
from fastgen.geometry.container import build_container
from fastgen.render.passes import ray_points
from fastgen.scene import Camera
from fastgen.scene.optics import Lens
from tests.plain import bare
from tests.tone_inverse import light_of

FISHEYE = {"cameras": {"A": {"focal_mm": 24, "lens": {"model": "fisheye", "k1": [-0.02, 0.0]}}}}
DAMAGED = {"damage": {"probability": 1, "count": [3, 5]}}
HOLED = {"damage": {"probability": 1, "count": [3, 5], "kinds": ["perforation"]}}
OVERCAST = {"environment": {"names": ["port_overcast"]}}


def traced_with(monkeypatch, light):
    """Replace the light tracer with `light` and return a list that collects its points."""
    asked = []

    def traced(points, *rest):
        asked.append(points)
        return light(points, *rest)

    monkeypatch.setattr(ray_points, "traced_light", traced)
    return asked


@pytest.fixture
def coarse(monkeypatch):
    """Function that places the points `step` pixels apart, as in much larger images."""

    def apart(size, step):
        monkeypatch.setattr(ray_points, "_POINTS_PER_AXIS", (size[0] * size[1]) ** 0.5 / step)
        assert ray_points.point_step(size) == step

    return apart


def test_points_are_at_most_400_along_an_axis_and_no_sparser_than_needed():
    for side in (64, 320, 400, 401, 640, 800, 801, 1440, 4096):
        step = ray_points.point_step((side, side))
        assert side / step <= 400
        assert step == 1 or side / (step - 1) > 400


@pytest.mark.parametrize(
    ("changed", "size", "step"),
    [
        ({}, (320, 320), 1),
        ({}, (700, 500), 2),
        ({}, (90, 211), 1),
        ({}, (92, 211), 3),
        ({}, (211, 90), 4),
        ({}, (123, 122), 5),
        (DAMAGED, (640, 640), 2),
        (HOLED, (320, 240), 1),
        (FISHEYE, (400, 300), 1),
    ],
)
def test_points_match_the_middle_pixels_of_cells(monkeypatch, coarse, changed, size, step):
    coarse(size, step)
    asked = traced_with(monkeypatch, lambda points, *_: np.ones((len(points.row), 4, 3)))
    with Generator(Config.from_values(changed), 4, size, quality="high") as generator:
        for index in range(2):
            sample = generator.render(index, camera="A")
            points = asked[-1]
            rows = len(range(step // 2, size[1], step))
            first = points.row < rows
            x, y = (step * at + step // 2 for at in (points.column, points.row % rows))
            pixels, depth = sample.view.project(points.place_mm)
            beside = pixels - np.stack([x, y], axis=1) - 0.5
            # with a lens, points are moved onto their surfaces
            atol, rtol = (0.1, 1e-3) if changed is FISHEYE else (0.02, 1e-4)
            np.testing.assert_allclose(beside[first], 0, atol=atol)
            np.testing.assert_allclose(depth[first], sample.depth[y, x][first], rtol=rtol)
            assert np.abs(beside).max() < 1 + min(step, 2) / 2
            np.testing.assert_allclose(np.linalg.norm(points.normal, axis=1), 1, atol=1e-4)
            toward = np.array(sample.camera.position_mm) - points.place_mm
            toward /= np.linalg.norm(toward, axis=1, keepdims=True)
            np.testing.assert_allclose(points.toward_eye, toward, atol=3e-4)
            assert ((points.roughness > 0) & (points.roughness <= 1)).all()
            # a point for each visible object; holes and cables thinner than a pixel may differ
            seen = sample.ids[step // 2 :: step, step // 2 :: step] > 0
            known = np.zeros_like(seen)
            known[points.row[first], points.column[first]] = True
            assert (known & ~seen).mean() < 0.002
            assert (seen & ~known).sum() < 0.01 * seen.sum()


def test_points_seen_through_a_lens_lie_on_their_surfaces(monkeypatch):
    """Triangles are flat in a distorted image, but not in the world: 4 mm off, far along a wall."""
    asked = traced_with(monkeypatch, lambda points, *_: np.ones((len(points.row), 4, 3)))
    lens = Lens("brown_conrady", (-0.23, 0.04, 0.0, 0.0, 0.0))
    camera = Camera("T", (-7600.0, -4800.0, 1000.0), (-1500.0, 0.0, 1100.0), 20.0, lens=lens)
    with Generator(Config.preset(), 4, (400, 400), quality="high") as generator:
        scene = bare(generator.scene(0))
        generator.render(scene=scene, camera=camera)
    points = asked[0]
    wall = points.chosen(np.flatnonzero(points.normal[:, 1] < -0.999))
    face = wall.place_mm[wall.place_mm[:, 1] < -1210, 1]  # posts, rails and castings
    assert len(face) > 500
    planes = np.unique(
        build_container(scene.container.kind, scene.container.profiles).positions_mm[:, 1]
    )
    apart = np.abs(face[:, None] - planes).min(axis=1)
    assert np.quantile(apart, 0.95) < 0.05


def test_point_normals_equal_label_normals(monkeypatch):
    asked = traced_with(monkeypatch, lambda points, *_: np.ones((len(points.row), 4, 3)))
    with Generator(Config.from_values(DAMAGED), 4, (320, 320), quality="high") as generator:
        sample = generator.render(1, camera="Cl", normals=True)
    points = asked[0]
    points = points.chosen(np.flatnonzero(points.row < 320))
    to_camera = points.normal @ sample.view.rotation.T
    cosine = (to_camera * sample.normals[points.row, points.column]).sum(axis=1)
    assert np.quantile(cosine, 0.25) > 0.99  # mixed pixels hold a mean normal
    damaged = sample.damage[points.row, points.column] >= 100
    assert damaged.sum() > 50
    assert np.quantile(cosine[damaged], 0.25) > 0.99


@pytest.mark.parametrize("changed", [OVERCAST, OVERCAST | DAMAGED, OVERCAST | HOLED])
@pytest.mark.parametrize("size", [(320, 320), (420, 420)])  # points 1 and 2 pixels apart
def test_almost_all_visible_pixels_use_traced_light(monkeypatch, changed, size):
    """Traced light is black here, so only pixels without a nearby point are bright."""
    traced_with(monkeypatch, lambda points, *_: np.zeros((len(points.row), 4, 3)))
    config = Config.from_values(changed)
    with Generator(config, 4, size, quality="high") as generator:
        for camera in ("A", "Cl", "Cr"):
            sample = generator.render(2, camera=camera)
            inside = (sample.ids > 0) & (sample.cover == 255)
            assert (sample.image[inside].max(axis=1) > 3).mean() < 0.05


@pytest.mark.parametrize("step", [1, 2, 3, 5])
def test_light_reaches_equally_far_on_both_sides_of_points(monkeypatch, coarse, step):
    """One lit row or column of points lights pixels up to a cell and a half away."""
    size = (320, 323)
    coarse(size, step)
    rows = len(range(step // 2, size[1], step))
    lit_cell = 160 // step

    def one_row(points, *_):
        light = np.zeros((len(points.row), 4, 3))
        at = points.column if axis else points.row % rows
        light[at == lit_cell, :2] = 1
        return light

    traced_with(monkeypatch, one_row)
    with Generator(Config.from_values(OVERCAST), 4, size, quality="high") as generator:
        for axis in (0, 1):
            sample = generator.render(3, camera="Cr")
            whole = (sample.ids == 1) & (sample.cover == 255)
            image = np.where(whole[..., None], light_of(sample.image), np.nan)
            profile = np.nanmean(image, axis=(1 - axis, 2))
            middle = lit_cell * step + step // 2
            reach = 6 if step < 5 else 9
            near = np.arange(middle - reach, middle + reach + 1)
            away = np.abs(near - middle) / step
            assert profile[near[away <= 0.5]].min() > 3 * profile[near[away >= 1.5]].max()
            weight = profile[near] / profile[near].sum()
            assert weight @ near == pytest.approx(middle, abs=0.25 * step)


def test_high_is_byte_identical_across_generators():
    images = []
    for _ in range(2):
        with Generator(Config.from_values(DAMAGED), 7, (128, 96), quality="high") as generator:
            images.append([generator.render(i).image for i in (3, 1, 3)])
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0][0], images[0][2])


def test_points_do_not_depend_on_earlier_images(monkeypatch, coarse):
    """Samples seen through holes lie directly below the image's own samples in the targets."""
    size = (92, 92)  # the image border cuts one pixel off the last cells
    coarse(size, 3)
    asked = traced_with(monkeypatch, lambda points, *_: np.ones((len(points.row), 4, 3)))
    holed = Generator(Config.from_values(HOLED), 3).scene(1)
    hole = next(d for d in holed.damages if abs(d.inward[1]) == 1)
    at, toward = np.array(hole.origin_mm), np.array(hole.inward)
    with Generator(seed=4, size=size, quality="high") as generator:
        views = []
        for down_mm in (200, 230, 260, 290):
            target = at - (0, 0, down_mm)
            position = target - 2500 * toward
            plain = replace(holed.cameras[0], focal_mm=150.0, roll_deg=0.0)
            views.append(replace(plain, position_mm=tuple(position), target_mm=tuple(target)))
        undamaged = replace(holed, damages=())

        def points():
            for view in views:
                generator.render(scene=undamaged, camera=view)
            return np.concatenate([each.place_mm for each in asked[-len(views) :]])

        before = points()
        for view in views:
            generator.render(scene=holed, camera=view)
            np.testing.assert_array_equal(points(), before)


def test_high_without_embree_is_refused_at_once(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(ConfigError, match=r"quality: high .* embreex.*fine"):
        Generator(quality="high")
    Generator(quality="fine").close()
