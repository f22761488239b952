"""Which points of an image rays are cast from, and whose light its pixels have."""

import sys

import numpy as np
import pytest

import fastgen.renderer
from fastgen import Config, Generator
from fastgen.drawing.light_points import point_step
from fastgen.errors import ConfigError

FISHEYE = {"cameras": {"A": {"focal_mm": 24, "lens": {"model": "fisheye", "k1": [-0.02, 0.0]}}}}
DAMAGED = {"damage": {"probability": 1, "count": [3, 5]}}
HOLED = {"damage": {"probability": 1, "count": [3, 5], "kinds": ["perforation"]}}
OVERCAST = {"environment": {"names": ["port_overcast"]}}


def traced_with(monkeypatch, light):
    """Let the renderer trace light by `light`, and keep what points it is asked for."""
    asked = []

    def traced(points, *rest):
        asked.append(points)
        return light(points, *rest)

    monkeypatch.setattr(fastgen.renderer, "traced_light", traced)
    return asked


@pytest.mark.parametrize(
    ("changed", "size"),
    [
        ({}, (320, 320)),
        ({}, (700, 500)),
        ({}, (90, 211)),
        (DAMAGED, (640, 640)),
        (HOLED, (320, 240)),
        (FISHEYE, (400, 300)),
    ],
)
def test_points_are_what_the_middle_pixels_of_cells_see(monkeypatch, changed, size):
    asked = traced_with(monkeypatch, lambda points, *_: np.ones((len(points.row), 4, 3)))
    step = point_step(size)
    with Generator(Config.from_values(changed), 4, size, quality="high") as generator:
        for index in range(3):
            sample = generator.render(index, camera="A")
            points = asked[-1]
            rows = len(range(step // 2, size[1], step))
            first = points.row < rows
            x, y = (step * at + step // 2 for at in (points.column, points.row % rows))
            pixels, depth = sample.view.project(points.place_mm)
            beside = pixels - np.stack([x, y], axis=1) - 0.5
            np.testing.assert_allclose(beside[first], 0, atol=0.02)
            np.testing.assert_allclose(depth[first], sample.depth[y, x][first], rtol=1e-4)
            assert np.abs(beside).max() < 1 + min(step, 2) / 2
            np.testing.assert_allclose(np.linalg.norm(points.normal, axis=1), 1, atol=1e-4)
            toward = np.array(sample.camera.position_mm) - points.place_mm
            toward /= np.linalg.norm(toward, axis=1, keepdims=True)
            np.testing.assert_allclose(points.toward_eye, toward, atol=1e-4)
            assert ((points.roughness > 0) & (points.roughness <= 1)).all()
            # each that sees something, but holes and cables, which are less than a pixel wide
            seen = sample.ids[step // 2 :: step, step // 2 :: step] > 0
            known = np.zeros_like(seen)
            known[points.row[first], points.column[first]] = True
            assert (known & ~seen).mean() < 0.002
            assert (seen & ~known).sum() < 0.01 * seen.sum()


def test_normals_of_points_are_those_of_the_labels(monkeypatch):
    asked = traced_with(monkeypatch, lambda points, *_: np.ones((len(points.row), 4, 3)))
    with Generator(Config.from_values(DAMAGED), 4, (320, 320), quality="high") as generator:
        sample = generator.render(1, camera="Cl", normals=True)
    points = asked[0]
    points = points.chosen(np.flatnonzero(points.row < 320))
    to_camera = points.normal @ sample.view.rotation.T
    cosine = (to_camera * sample.normals[points.row, points.column]).sum(axis=1)
    assert np.quantile(cosine, 0.25) > 0.99  # pixels of several surfaces have a mean
    damaged = sample.damage[points.row, points.column] >= 100
    assert damaged.sum() > 50
    assert np.quantile(cosine[damaged], 0.25) > 0.99


@pytest.mark.parametrize("changed", [OVERCAST, OVERCAST | DAMAGED, OVERCAST | HOLED])
@pytest.mark.parametrize("size", [(320, 320), (640, 640)])
def test_almost_all_that_is_seen_has_the_light_that_was_traced(monkeypatch, changed, size):
    """In the dark all but what has no point near it is black."""
    traced_with(monkeypatch, lambda points, *_: np.zeros((len(points.row), 4, 3)))
    config = Config.from_values(changed)
    with Generator(config, 4, size, quality="high") as generator:
        for camera in ("A", "Cl", "Cr"):
            sample = generator.render(2, camera=camera)
            inside = (sample.ids > 0) & (sample.cover == 255)
            assert (sample.image[inside].max(axis=1) > 3).mean() < 0.05


def test_light_is_the_mean_of_points_on_the_same_surface(monkeypatch):
    """What one lit row of points lights reaches a cell and a half, along surfaces alone."""

    def one_row(points, *_):
        light = np.zeros((len(points.row), 4, 3))
        light[points.row % 320 == 160, :2] = 1
        return light

    traced_with(monkeypatch, one_row)
    with Generator(Config.from_values(OVERCAST), 4, (320, 320), quality="high") as generator:
        sample = generator.render(2, camera="Cl")
    whole = (sample.ids == 1) & (sample.cover == 255)
    lit = np.array([sample.image[row, whole[row]].mean() for row in range(150, 171)])
    assert (lit[[9, 10, 11]] > 20).all()
    assert (lit[:8] < 5).all()
    assert (lit[13:] < 5).all()


def test_high_is_the_same_to_the_byte_from_another_generator():
    images = []
    for _ in range(2):
        with Generator(Config.from_values(DAMAGED), 7, (128, 96), quality="high") as generator:
            images.append([generator.render(i).image for i in (3, 1, 3)])
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0][0], images[0][2])


def test_high_without_embree_is_refused_at_once(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(ConfigError, match=r"quality: high .* embreex.*balanced"):
        Generator(quality="high")
    Generator(quality="balanced").close()
