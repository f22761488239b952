"""Triangle runs chosen for an image region, compared with projecting every triangle."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen.camera.projection import view_of
from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.render.clusters import Clusters
from fastgen.scene import Lens

SIZE = (320, 240)
REGIONS = [(150, 100, 20, 30), (0, 0, 40, 40), (300, 200, 20, 40), (10, 120, 300, 2)]


@pytest.fixture(scope="module")
def scene():
    return Generator(Config.preset(), seed=2, size=SIZE).scene(3)


def within(mesh, view, region, moved_mm):
    """Return which triangles may project onto `region` if corners move up to `moved_mm`."""
    shifts = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * moved_mm
    corners = mesh.positions_mm[mesh.triangles].astype(float)[:, :, None] + shifts
    eye = (corners.reshape(len(corners), -1, 3) / 1000 - view.position_m) @ view.rotation.T
    pixels = eye[..., :2] / eye[..., 2:] * view.focal_px + np.array(SIZE) / 2
    x, y, w, h = region
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    return (high > (x, y)).all(axis=1) & (low < (x + w, y + h)).all(axis=1)


@pytest.mark.parametrize("region", REGIONS)
@pytest.mark.parametrize("camera", ["A", "B", "Cl", "Cr"])
@pytest.mark.parametrize("moved_mm", [0.0, 150.0])
def test_runs_contain_every_triangle_that_a_region_shows(scene, camera, region, moved_mm):
    mesh = build_container(scene.container.kind, scene.container.profiles)
    view = view_of(scene.camera(camera), SIZE)
    chosen = np.zeros(len(mesh.triangles), bool)
    runs = Clusters(mesh).seen_in(view, region, moved_mm)
    for run in runs:
        assert not chosen[run].any()
        chosen[run] = True
    shown = within(mesh, view, region, moved_mm)
    assert not (shown & ~chosen).any()
    assert len(runs) <= Clusters.most_runs(mesh)
    if max(region[2:]) < 100:
        assert chosen.mean() < 0.7


def test_the_whole_image_and_distorted_views_use_all_triangles(scene):
    mesh = build_container(scene.container.kind, scene.container.profiles)
    whole = [slice(0, len(mesh.triangles))]
    camera = scene.camera("A")
    assert Clusters(mesh).seen_in(view_of(camera, SIZE), None, 0.0) == whole
    bent = replace(camera, lens=Lens("brown_conrady", (-0.01, 0.0, 0.0, 0.0, 0.0)))
    assert Clusters(mesh).seen_in(view_of(bent, SIZE), REGIONS[0], 0.0) == whole


def test_triangles_that_cross_the_near_plane_are_kept(scene):
    """A bounding box that reaches behind the camera has no valid projection."""
    mesh = build_container(scene.container.kind, scene.container.profiles)
    camera = scene.camera("A")
    inside = view_of(replace(camera, position_mm=(0.0, 0.0, 1200.0)), SIZE)
    chosen = np.zeros(len(mesh.triangles), bool)
    for run in Clusters(mesh).seen_in(inside, REGIONS[0], 0.0):
        chosen[run] = True
    eye = (mesh.positions_mm[mesh.triangles] / 1000 - inside.position_m) @ inside.rotation.T
    crosses = (eye[..., 2].min(axis=1) < 0.1) & (eye[..., 2].max(axis=1) > 0.1)
    assert crosses.any()
    assert chosen[crosses].all()


def test_triangles_are_split_by_whether_a_box_may_reach_them():
    mesh = build_container("20")
    clusters = Clusters(mesh)
    rng = np.random.default_rng(8)
    corners = mesh.positions_mm[mesh.triangles]
    low, high = mesh.bounds_mm
    asked = [slice(10, 1000), slice(5000, 5001), slice(9000, len(mesh.triangles))]
    wanted = np.zeros(len(mesh.triangles), bool)
    for part in asked:
        wanted[part] = True
    for _ in range(40):
        middle = rng.uniform(low, high, (2, 3))
        boxes = [m + rng.uniform(-300, 300, (8, 3)) for m in middle]
        far, near = clusters.parted(asked, boxes, 40.0)
        times = np.zeros(len(mesh.triangles), int)
        for part in (*far, *near):
            times[part] += 1
        np.testing.assert_array_equal(times, wanted)
        meets = np.zeros(len(mesh.triangles), bool)
        for box in boxes:
            above = (corners.max(axis=1) >= box.min(axis=0) - 40).all(axis=1)
            meets |= above & (corners.min(axis=1) <= box.max(axis=0) + 40).all(axis=1)
        is_far = np.zeros(len(mesh.triangles), bool)
        for part in far:
            is_far[part] = True
        assert not (is_far & meets).any()
        assert is_far.sum() > 0.5 * wanted.sum()  # most of a container is far from the boxes
