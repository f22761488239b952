"""The background of a slowly turning camera changes like the background of much larger images."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.srgb import encoded

SIZE = (320, 320)
TIMES = 4
"""Size of the images that stand for the truth, relative to SIZE."""
CASES = [("night", "A"), ("port_night", "B"), ("port_night", "Cl"), ("venice", "A")]


def shown(radiance):
    """Return exposed radiance [H, W, 3] as sRGB 0..1 that clips at white."""
    return encoded(np.clip(radiance, 0, 1))


def views(generator):
    """Return (scene, camera) pairs of each case: two views that are a quarter of a pixel apart."""
    scene = replace(generator.scene(0), damages=(), decals=())
    for name, camera_name in CASES:
        camera = scene.camera(camera_name)
        quarter_deg = np.rad2deg(0.25 * 36 / (camera.focal_mm * SIZE[0]))
        yaws = (30, 30 + quarter_deg)
        turned = [replace(scene.environment, name=name, yaw_deg=yaw, lamps=()) for yaw in yaws]
        yield [replace(scene, environment=light) for light in turned], camera


@pytest.fixture(scope="module")
def true_changes():
    """Change of the background in each case, and where it is seen."""
    found = []
    large = tuple(TIMES * side for side in SIZE)
    with Generator(Config.preset(), seed=1, size=SIZE, quality="draft") as generator:
        renderer = generator.gpu.renderer()
        for scenes, camera in views(generator):
            images = []
            for scene in scenes:
                frame = renderer.render(PreparedScene(scene), camera, large, radiance=True)
                parts = frame.radiance.reshape(SIZE[1], TIMES, SIZE[0], TIMES, 3)
                images.append(shown(parts.mean(axis=(1, 3))))
            covered = frame.cover.reshape(SIZE[1], TIMES, SIZE[0], TIMES).any(axis=(1, 3))
            # the pixel filter is wider than a pixel
            found.append((images[1] - images[0], ~binary_dilation(covered, np.ones((3, 3)))))
    return found


@pytest.mark.parametrize(("quality", "limit"), [("draft", 0.2), ("balanced", 0.1)])
def test_background_flickers_less_than_it_moves(quality, limit, true_changes):
    """The change between two views, minus the true change, is small relative to it."""
    apart = []
    with Generator(Config.preset(), seed=1, size=SIZE, quality=quality) as generator:
        renderer = generator.gpu.renderer()
        for (scenes, camera), (moved, sky) in zip(views(generator), true_changes, strict=True):
            first, second = (
                shown(renderer.render(PreparedScene(scene), camera, SIZE, radiance=True).radiance)
                for scene in scenes
            )
            flicker = second - first - moved
            apart.append(np.abs(flicker[sky]).mean() / np.abs(moved[sky]).mean())
    assert np.mean(apart) < limit, apart
