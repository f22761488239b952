"""Zones: which way is down in the atlas, where a side ends, and what dirt and rust make of it."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.container import build_container
from fastgen.scene import Camera
from fastgen.spreader import build_spreader
from tests import oracle
from tests.mesh_probe import ISO_668, triangles_of, winding_normals

UP_IN_ATLAS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)], float)
DIRTY = Config.from_values(
    {
        "damage": {"probability": 0},
        "spreader": {"probability": 1},
        "surface": {"dirt_strength": 0.9, "dirt_reach_mm": 300, "rust_coverage": 0.0},
    }
)


def meshes(kind):
    return [build_container(kind), build_spreader(kind), build_spreader(kind, (False, False))]


def zone_of(mesh):
    return mesh.zone[mesh.triangles[:, 0]]


@pytest.mark.parametrize("kind", ISO_668)
def test_a_step_up_in_a_zone_is_the_steepest_of_four_in_the_world(kind):
    for mesh in meshes(kind):
        atlas = mesh.atlas_mm[mesh.triangles].astype(float)
        heights = mesh.positions_mm[mesh.triangles, 2].astype(float)
        middle = atlas.mean(axis=1)
        sides = np.concatenate([atlas.transpose(0, 2, 1), np.ones((len(atlas), 1, 3))], axis=1)
        area = np.abs(np.linalg.det(sides))
        climbs = []
        for step in UP_IN_ATLAS:  # heights there by barycentric weights, one mm away
            place = np.column_stack([middle + step, np.ones(len(middle))])
            weights = np.linalg.solve(sides, place[..., None])[..., 0]
            climb = (weights * heights).sum(axis=1) - heights.mean(axis=1)
            climbs.append(np.bincount(zone_of(mesh), area * climb))
        climbs /= np.bincount(zone_of(mesh), area)
        turns = np.array([zone.quarter_turns for zone in mesh.zones])
        best = climbs.max(axis=0)
        steep, level = best > 0.81, best < 0.56
        assert (np.choose(turns, climbs) >= best - 0.01)[steep].all()
        assert (turns[level] == 0).all()
        assert set(turns[steep]) == {0, 1, 2, 3}
        assert (steep | level).mean() > 0.95


@pytest.mark.parametrize("kind", ISO_668)
def test_zones_bound_their_triangles_tightly_and_share_no_vertex(kind):
    for mesh in meshes(kind):
        zones = mesh.zone[mesh.triangles]
        assert (zones == zones[:, :1]).all()
        corners = mesh.atlas_mm[mesh.triangles].astype(float)
        for number, zone in enumerate(mesh.zones):
            mine = corners[zone_of(mesh) == number].reshape(-1, 2)
            x, y, width, height = zone.rect_mm
            np.testing.assert_allclose(mine.min(axis=0), (x, y), atol=0.01)
            np.testing.assert_allclose(mine.max(axis=0), (x + width, y + height), atol=0.01)
        assert set(mesh.chart) == set(range(len(mesh.charts)))


@pytest.mark.parametrize("kind", ISO_668)
def test_every_side_of_a_box_beam_is_a_zone(kind):
    """Their rectangles are the sides: together as large as the surface, and each of one normal."""
    mesh = build_spreader(kind)
    normals = winding_normals(mesh)
    a, b, c = mesh.positions_mm[mesh.triangles].astype(float).transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    for name in ("spreader.frame.front", "spreader.frame.cross"):
        beam = triangles_of(mesh, name)
        numbers = np.unique(zone_of(mesh)[beam])
        sides = [np.prod(mesh.zones[number].rect_mm[2:]) for number in numbers]
        assert sum(sides) == pytest.approx(area[beam].sum(), rel=1e-4)
        for number in numbers:
            mine = normals[zone_of(mesh) == number]
            assert (mine @ mine[0]).min() > 1 - 1e-6


def test_walls_and_roof_are_one_zone_and_each_door_leaf_is():
    mesh = build_container("40")
    counts = {
        name: len(np.unique(zone_of(mesh)[triangles_of(mesh, name)]))
        for name in ("front", "back", "no_door", "roof", "underside", "door")
    }
    assert counts == {
        "front": 1, "back": 1, "no_door": 1, "roof": 1, "underside": 1, "door": 2
    }  # fmt: skip


def seen_straight(scene, target, right, out):
    """A camera 2 mm a pixel, straight before `target`; x in the image runs along `right`."""
    place = np.array(target) + 6000.0 * np.array(out, float)
    assert np.allclose(np.cross((0, 0, 1), out), right)
    camera = Camera("straight", tuple(place), tuple(target), 6000.0 / (2.0 * 320) * 36.0)
    return replace(scene, cameras=(camera,), decals=())


@pytest.mark.parametrize("part", ["door header", "end beam", "telescopic beam"])
def test_streaks_of_dirt_run_down(part):
    """They change faster across than down, on parts that the atlas lays out along their length."""
    with Generator(DIRTY, 6, (320, 320), quality="draft") as generator:
        scene = generator.scene(0)
        length, _, height, _ = ISO_668[scene.container.kind]
        base = height + scene.spreader.gap_mm
        target, out, half = {
            "door header": ((length / 2, 0.0, height - 70), (1, 0, 0), 28),
            "end beam": ((length / 2, 0.0, base + 260), (1, 0, 0), 120),
            "telescopic beam": ((length / 2 - 1600, -630.0, base + 325), (0, -1, 0), 110),
        }[part]
        scene = seen_straight(scene, target, np.cross((0, 0, 1), out), out)
        image = generator.render(scene=scene, camera="straight", layer="dirt").image
    rows = round(half / 2)
    strip = image[160 - rows : 160 + rows, 60:260].astype(float).sum(axis=2)
    across = np.abs(np.diff(strip, axis=1)).mean()
    # dirt grows toward the edges, which is no streak
    down = np.abs(np.diff(strip - strip.mean(axis=1, keepdims=True), axis=0)).mean()
    assert across > 0.5
    assert across > 1.3 * down


def test_holes_leave_the_locking_bars():
    """Where rays meet the gear of the sound door, its depth is what an image shows, but for what
    the sheet's torn rim bends."""
    values = {"probability": 1.0, "count": [1, 1], "kinds": ["perforation"], "faces": ["door"]}
    bare = {"probability": 0}
    config = Config.from_values({"damage": values, "spreader": bare})
    with Generator(config, 77, (320, 320)) as generator:
        scene = generator.scene(3)
        (hole,) = scene.damages
        length = ISO_668[scene.container.kind][0]
        hole = replace(
            hole,
            origin_mm=(length / 2 - 58.0, 275.0, 1500.0),
            size_mm=(400.0, 400.0),
            shape=(60.0, *[0.0] * 10),
        )
        camera = Camera("straight", (length / 2 + 3000, 275.0, 1500.0), hole.origin_mm, 60.0)
        scene = replace(scene, damages=(hole,), cameras=(camera,), decals=())
        sample = generator.render(scene=scene, camera="straight")
        mesh = build_container(scene.container.kind, scene.container.profiles)
    hits = oracle.cast(mesh, sample.view)
    names = np.array([chart.name for chart in mesh.charts])[mesh.chart[mesh.triangles[:, 0]]]
    bar = (names == "door.bar.2")[hits.triangle] & hits.hit
    torn = sample.damage == 501
    sure = bar & ~oracle.near_edge(bar.astype(int))
    sure[:140], sure[180:] = False, False
    assert sure.sum() > 100
    bends_m = 1e-3 * (hole.depth_mm + 5)
    np.testing.assert_allclose(sample.depth[sure], hits.depth_m[sure], atol=bends_m)
    beside = torn & ~bar
    assert (beside & (sample.depth > 4.0)).sum() > 1000
