"""Containers in `draft` move like those of much larger images that are averaged as linear light."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Spreader
from fastgen.srgb import encoded
from tests.panned_camera import panned

SIDE = 320
TIMES = 8
"""Size of the images that stand for the truth, relative to SIDE."""
WALL_M = (60, 100, 150)
"""Distances of a wall in m; a wave of its corrugation is 2.8 to 1.1 pixels wide there."""


@pytest.fixture(scope="module")
def draft():
    with Generator(Config.preset(), seed=3, size=(SIDE, SIDE), quality="draft") as generator:
        yield generator


def drawn(generator, scene, camera, side=SIDE):
    """Return exposed radiance [side, side, 3], and where the image shows surfaces."""
    renderer = generator.gpu.renderer()
    frame = renderer.render(PreparedScene(scene), camera, (side, side), radiance=True)
    return frame.radiance, frame.cover > 0


def truth(generator, scene, camera):
    """Return `drawn` at TIMES the size, averaged over pixels."""
    radiance, covered = drawn(generator, scene, camera, TIMES * SIDE)
    parts = (SIDE, TIMES, SIDE, TIMES)
    return radiance.reshape(*parts, 3).mean(axis=(1, 3)), covered.reshape(parts).any(axis=(1, 3))


def far_camera(camera):
    """Return a camera 60 m from the target of another one, with a longer lens."""
    target = np.array(camera.target_mm)
    away = np.array(camera.position_mm) - target
    x, y, z = target + away * (60_000 / np.linalg.norm(away))
    return replace(camera, position_mm=(x, y, max(z, 1500.0)), focal_mm=45.0)


def motion(generator, index, cameras, place=lambda camera: camera):
    """Return the change of images relative to the true change, over some cameras."""
    found, expected = 0.0, 0.0
    scene = replace(generator.scene(index), damages=())
    for name in cameras:
        camera = place(scene.camera(name))
        views = (camera, panned(camera, SIDE))
        images = [encoded(np.clip(drawn(generator, scene, view)[0], 0, 1)) for view in views]
        (first, seen), (second, also) = (truth(generator, scene, view) for view in views)
        near = binary_dilation(seen | also, np.ones((3, 3)))
        true = encoded(np.clip(second, 0, 1)) - encoded(np.clip(first, 0, 1))
        found += np.abs(images[1] - images[0])[near].sum()
        expected += np.abs(true)[near].sum()
    return found / expected


def test_a_distant_container_changes_by_no_more_than_it_moves(draft):
    assert 0.9 < motion(draft, 0, ("A", "B", "Cl", "Cr"), far_camera) < 1.2


@pytest.mark.parametrize("index", [0, 1])
def test_a_near_container_below_thin_cables_changes_by_little_more_than_it_moves(draft, index):
    assert 0.9 < motion(draft, index, ("A", "B")) < 1.2


def test_a_distant_wall_has_no_beat_between_its_corrugation_and_the_pixels(draft):
    scene = replace(draft.scene(1), damages=(), decals=(), seals=(), spreader=Spreader())
    for away_m in WALL_M:
        camera = replace(
            scene.camera("A"),
            position_mm=(25e3, -1e3 * away_m, 1400.0),
            target_mm=(0.0, 0.0, 1400.0),
            focal_mm=85.0,
        )
        (image, seen), (true, _) = (make(draft, scene, camera) for make in (drawn, truth))
        rows, columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
        inside = np.ix_(rows[2:-2], columns[3:-3])
        means = [each[inside].mean(axis=(0, 2)) for each in (image, true)]
        assert np.abs(means[0] - means[1]).mean() < 0.08 * means[1].mean(), away_m
        slow = [np.convolve(each, np.full(5, 0.2), "valid") for each in means]
        assert np.std(slow[0] / slow[1]) < 0.03, away_m
        across = [each[inside].mean(axis=(1, 2)) for each in (image, true)]
        assert np.abs(across[0] - across[1]).mean() < 0.05 * across[1].mean(), away_m


def test_a_roof_seen_along_its_length_has_no_rings(draft):
    """Its waves are foreshortened to less than two pixels, while its walls have six a wave."""
    scene = replace(draft.scene(1), damages=(), decals=(), seals=(), spreader=Spreader())
    camera = replace(
        scene.camera("A"),
        position_mm=(-30e3, -4e3, 10e3),
        target_mm=(0.0, 0.0, 2500.0),
        focal_mm=60.0,
    )
    (image, seen), (true, _) = (make(draft, scene, camera) for make in (drawn, truth))
    rows, columns = np.nonzero(binary_erosion(seen, np.ones((3, 3))))
    top = rows < rows.min() + 12  # the roof is above the end wall
    found, expected = (each[rows[top], columns[top]] for each in (image, true))
    assert len(found) > 300
    assert np.abs(found - expected).mean() < 0.3 * expected.mean()
