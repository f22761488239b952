"""Atlas zones: orientation, extent, and their effect on dirt and rust."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.damaged_mesh import damaged_mesh
from fastgen.geometry.mesh import MATERIALS
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.spreader import build_spreader
from fastgen.render.gl import open_context
from fastgen.scene import Camera, Damage
from fastgen.scene.container_kinds import WallProfiles, Wave
from fastgen.srgb import DECODED
from tests import oracle
from tests.glsl import run
from tests.mesh_probe import ISO_668, triangles_of, winding_normals
from tests.plain import EVEN_PAINT

UP_IN_ATLAS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)], float)
DIRTY = Config.from_values(
    {
        "damage": {"probability": 0},
        "spreader": {"probability": 1},
        "surface": {**EVEN_PAINT, "dirt_strength": 0.9, "dirt_reach_mm": 300},
    }
)


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


@pytest.fixture(scope="module")
def even():
    """Generator, and a scene whose surfaces are plain paint."""
    config = Config.from_values({"damage": {"probability": 0}, "surface": EVEN_PAINT})
    with Generator(config, 3, (64, 64)) as generator:
        yield generator, generator.scene(0)


def meshes(kind):
    return [build_container(kind), build_spreader(kind), build_spreader(kind, (False, False))]


def zone_of(mesh):
    return mesh.zone[mesh.triangles[:, 0]]


@pytest.mark.parametrize("kind", ISO_668)
def test_a_zones_up_is_the_steepest_of_four_directions(kind):
    for mesh in meshes(kind):
        atlas = mesh.atlas_mm[mesh.triangles].astype(float)
        heights = mesh.positions_mm[mesh.triangles, 2].astype(float)
        middle = atlas.mean(axis=1)
        sides = np.concatenate([atlas.transpose(0, 2, 1), np.ones((len(atlas), 1, 3))], axis=1)
        area = np.abs(np.linalg.det(sides))
        climbs = []
        for step in UP_IN_ATLAS:  # height one mm away, by barycentric weights
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
    """The rectangles of the zones are as large as the beam's surface, and each has one normal."""
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


def test_walls_roof_and_door_leaves_are_one_zone_each():
    mesh = build_container("40")
    counts = {
        name: len(np.unique(zone_of(mesh)[triangles_of(mesh, name)]))
        for name in ("front", "back", "no_door", "roof", "underside", "door")
    }
    assert counts == {
        "front": 1, "back": 1, "no_door": 1, "roof": 1, "underside": 1, "door": 2
    }  # fmt: skip


def test_a_wall_of_steep_waves_is_one_zone_too():
    steep = WallProfiles(side=Wave(278.0, 36.0, 130.0, 9.0, 130.0))
    mesh = build_container("45HC", steep)
    for name in ("front", "back"):
        assert len(np.unique(zone_of(mesh)[triangles_of(mesh, name)])) == 1


def test_the_shader_turns_a_zone_so_that_up_is_up(gl):
    points = np.random.default_rng(0).normal(size=(20, 2))
    for turns, up in enumerate(UP_IN_ATLAS):
        body = f"vec4 f(vec4 x) {{ return vec4(upright(x.xy, {5 + 16 * turns + 64}), x.zw); }}"
        rows = np.column_stack([points, np.zeros((20, 2))])
        found = run(gl, f'#include "zone.glsl"\n{body}', rows)[:, :2]
        right = np.array([up[1], -up[0]])
        np.testing.assert_allclose(found, np.column_stack([points @ right, points @ up]), atol=1e-5)


def test_the_shader_finds_the_upper_side_of_a_zone(gl):
    """Other bits of the zone's code must not matter."""
    points = np.random.default_rng(0).uniform(0, (300, 200), (20, 2))
    for turns, up in enumerate(UP_IN_ATLAS):
        for more in (0, 64, 128, 64 + 128 + 256):
            code = 5 + 16 * turns + more
            body = f"vec4 f(vec4 x) {{ return vec4(to_upper_side(x.xy, x.zw, {code})); }}"
            rows = np.column_stack([points, np.tile((300.0, 200.0), (20, 1))])
            found = run(gl, f'#include "zone.glsl"\n{body}', rows)[:, 0]
            highest = max(corner @ up for corner in ((0, 0), (300, 0), (0, 200), (300, 200)))
            np.testing.assert_allclose(found, highest - points @ up, atol=1e-3)


@pytest.mark.parametrize("kind", ISO_668)
def test_level_zones_are_those_that_neither_rise_nor_fall(kind):
    """A roof is level, because its waves rise and fall equally."""
    for mesh in meshes(kind):
        tilt = np.abs(mesh.normals[mesh.triangles[:, 0], 2])
        corners = mesh.positions_mm[mesh.triangles].astype(float)
        area = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        for number, zone in enumerate(mesh.zones):
            mine = zone_of(mesh) == number
            flat = area[mine][tilt[mine] > 0.7].sum() / area[mine].sum()
            assert zone.level == (flat > 0.5), (mesh.charts[zone.chart].name, number, flat)


def baked_sides(generator, scene, layer_mm, value=np.array):
    """Return the mean of `value(albedo)` at rim and middle of a main beam's long sides, [4, 2].

    layer_mm: width of the rim, and half the width of the middle band.
    """
    scene = replace(scene, spreader=replace(scene.spreader, present=True, albedo=(0.5, 0.5, 0.5)))
    atlas = generator.bake_spreader(scene, 8.0)
    mesh = build_spreader(scene.container.kind, scene.spreader.flippers_down)
    linear = value(DECODED[atlas.base_color[::-1]].mean(axis=2))
    chart = mesh.chart_index("spreader.frame.front")
    found = []
    for zone in (zone for zone in mesh.zones if zone.chart == chart):
        x, y, width, height = np.array(zone.rect_mm) / atlas.texel_mm
        side = linear[int(y) + 2 : int(y + height) - 1, int(x) + 2 : int(x + width) - 1]
        side = side if width > height else side.T
        if side.shape[1] > 8 * side.shape[0]:  # skip the end caps
            rim = round(layer_mm / atlas.texel_mm)
            ends = side[:, side.shape[0] : -side.shape[0]]
            middle = ends[len(ends) // 2 - rim : len(ends) // 2 + rim]
            found.append((np.concatenate([ends[:rim], ends[-rim:]]).mean(), middle.mean()))
    assert len(found) == 4
    return np.array(found)


def test_dirt_keeps_to_the_edges_of_each_side_of_a_beam(even):
    """A large reach is limited to part of the way to the middle of a narrow side."""
    generator, scene = even
    dirt = replace(scene.surface.dirt, strength=1.0, albedo=(0.0, 0.0, 0.0), reach_mm=3000.0)
    scene = replace(scene, surface=replace(scene.surface, dirt=dirt))
    rim, middle = baked_sides(generator, scene, 24.0).T
    assert (rim < 0.2).all()
    assert (middle > 0.3).all()
    narrow = replace(scene.surface.dirt, reach_mm=30.0)
    less = replace(scene, surface=replace(scene.surface, dirt=narrow))
    assert (baked_sides(generator, less, 24.0)[:, 1] > 0.49).all()


def test_rust_starts_at_the_edges_of_each_side_of_a_beam(even):
    generator, scene = even
    rust = replace(scene.surface.rust, coverage=0.15, albedo=(0.0, 0.0, 0.0))
    scene = replace(scene, surface=replace(scene.surface, rust=rust))
    rim, middle = baked_sides(generator, scene, 24.0, lambda albedo: albedo < 0.1).T
    assert (rim > 1.3 * middle).all()


def test_ageing_darkens_the_ends_of_a_beam_and_not_its_middle(even):
    """Ageing reaches from the corners by at most half the width of a side: little on a beam."""
    generator, scene = even
    ageing = replace(scene.surface.ageing, strength=1.0, reach_mm=5000.0)
    scene = replace(scene, surface=replace(scene.surface, ageing=ageing))
    assert (baked_sides(generator, scene, 24.0) > 0.49).all()


def seen_straight(scene, target, out):
    """Return the scene with a camera at 2 mm per pixel, straight in front of `target`."""
    place = np.array(target) + 6000.0 * np.array(out, float)
    camera = Camera("straight", tuple(place), tuple(target), 6000.0 / (2.0 * 320) * 36.0)
    return replace(scene, cameras=(camera,), decals=())


@pytest.mark.parametrize("part", ["door header", "end beam", "telescopic beam"])
def test_streaks_of_dirt_run_down(generators, part):
    """Streaks change faster across than down, even on parts laid out lengthwise in the atlas."""
    generator = generators(DIRTY, 6, (320, 320), quality="draft")
    scene = generator.scene(0)
    length, _, height, _ = ISO_668[scene.container.kind]
    base = height + scene.spreader.gap_mm
    target, out, half = {
        "door header": ((length / 2, 340.0, height - 70), (1, 0, 0), 28),
        "end beam": ((length / 2, 0.0, base + 260), (1, 0, 0), 120),
        "telescopic beam": ((length / 2 - 1600, -630.0, base + 325), (0, -1, 0), 110),
    }[part]
    scene = seen_straight(scene, target, out)
    image = generator.render(scene=scene, camera="straight", layer="dirt").image
    rows = round(half / 2)
    strip = image[160 - rows : 160 + rows, 80:240].astype(float).sum(axis=2)
    across = np.abs(np.diff(strip, axis=1)).mean()
    # without the row means, as dirt also grows toward the edges
    down = np.abs(np.diff(strip - strip.mean(axis=1, keepdims=True), axis=0)).mean()
    assert across > 0.5
    assert across > 1.3 * down


def test_holes_do_not_cut_the_locking_bars(generators):
    """The bar's depth equals ray casts on the undamaged door, within the bend of the torn rim."""
    values = {"probability": 1.0, "count": [1, 1], "kinds": ["perforation"], "faces": ["door"]}
    values["perforation"] = {"torn": 0}
    bare = {"probability": 0}
    config = Config.from_values({"damage": values, "spreader": bare})
    generator = generators(config, 77, (320, 320))
    scene = generator.scene(3)
    (hole,) = scene.damages
    length = ISO_668[scene.container.kind][0]
    hole = replace(
        hole,
        origin_mm=(length / 2 - 58.0, 130.0, 1500.0),
        size_mm=(400.0, 400.0),
        shape=(60.0, *[0.0] * 10),
    )
    camera = Camera("straight", (length / 2 + 3000, 130.0, 1500.0), hole.origin_mm, 60.0)
    scene = replace(scene, damages=(hole,), cameras=(camera,), decals=())
    sample = generator.render(scene=scene, camera="straight")
    undamaged = replace(scene, damages=())
    rusty, paint = (
        generator.render(scene=one, camera="straight", layer="rust").image.astype(float)
        for one in (scene, undamaged)
    )
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
    # the bar has no scars like those of the rim
    assert np.abs(rusty - paint)[sure].mean() < 4
    assert np.abs(rusty - paint)[torn & ~bar].mean() > 15


def test_a_bar_is_seen_from_behind_through_holes_in_both_ends(generators):
    """The back of the bar is visible against the sky behind the hole in its leaf."""
    bare = {"damage": {"probability": 0}, "spreader": {"probability": 0}}
    generator = generators(Config.from_values(bare), 77, (320, 320))
    scene = generator.scene(3)
    length = ISO_668[scene.container.kind][0]
    near, far = (
        Damage(
            "perforation", face, (x, 130.0, 1500.0), (0.0, -sign, 0.0), (0.0, 0.0, 1.0),
            (sign, 0.0, 0.0), (400.0, 400.0), 30.0, (60.0, *[0.0] * 10),
        )
        for face, x, sign in (
            ("no_door", 40 - length / 2, 1.0), ("door", length / 2 - 58, -1.0)
        )
    )  # fmt: skip
    eye = (-length / 2 - 1500, 130.0, 1500.0)
    camera = Camera("straight", eye, far.origin_mm, 600.0)
    scene = replace(scene, damages=(near, far), cameras=(camera,), decals=())
    depth = generator.render(scene=scene, camera="straight").depth
    row = depth[120, 100:220]
    bar = np.flatnonzero(np.isfinite(row))
    assert len(bar) > 5
    assert (np.diff(bar) == 1).all()
    assert np.isinf(row[[0, -1]]).all()
    np.testing.assert_allclose(row[bar], length / 1000 + 1.44, atol=0.06)


def test_an_exported_hole_cuts_the_leaf_but_not_the_bar_in_front_of_it():
    mesh = build_container("20")
    radius = 200.0
    hole = Damage(
        "perforation", "door", (6058 / 2 - 58.0, 545.0, 1500.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0),
        (-1.0, 0.0, 0.0), (2 * radius, 2 * radius), 30.0, (60.0, *[0.0] * 10),
    )  # fmt: skip
    cut = damaged_mesh(mesh, (hole,))
    lost = {}
    for name in ("door", "door.bar.3", "door.brackets.3", "door.bar.2"):
        x, y, width, height = mesh.charts[mesh.chart_index(name)].rect_mm
        areas = []
        for atlas in (mesh.atlas_mm[mesh.triangles], cut.atlas_mm[cut.triangles]):
            a, b, c = atlas.astype(float).transpose(1, 0, 2)
            middle = (a + b + c) / 3
            mine = ((middle > (x, y)) & (middle < (x + width, y + height))).all(axis=1)
            u, v = (b - a)[mine].T, (c - a)[mine].T
            areas.append((u[0] * v[1] - u[1] * v[0]).sum() / 2)
        lost[name] = areas[0] - areas[1]
    # slopes of the swages are longer on the sheet than in a front view
    assert np.pi * radius**2 < lost.pop("door") < 1.25 * np.pi * radius**2
    np.testing.assert_allclose(list(lost.values()), 0.0, atol=1.0)


def test_small_pieces_age_alike_wherever_they_lie_in_the_atlas(even):
    generator, scene = even
    surface = replace(scene.surface, ageing=replace(scene.surface.ageing, strength=1.0))
    scene = replace(scene, surface=surface, decals=())
    atlas = generator.bake(scene, 4.0)
    mesh = PreparedScene(scene).container
    small = np.array([zone.small for zone in mesh.zones])
    materials = np.array([mesh.charts[zone.chart].material_index for zone in mesh.zones])
    middle = mesh.atlas_mm[mesh.triangles].astype(float).mean(axis=1)
    u, v = (atlas.uv(middle) * atlas.base_color.shape[1::-1]).astype(int).T
    colors = DECODED[atlas.base_color[v, u]].mean(axis=1)
    paint = MATERIALS.index("paint_frame")
    of_frame = (materials == paint)[zone_of(mesh)]
    left = colors / (0.93 * np.mean(scene.surface.paint.albedo))
    pieces, others = (left[of_frame & (small[zone_of(mesh)] == of_small)] for of_small in (1, 0))
    assert len(pieces) > 100
    assert pieces.min() > 0.5  # noise limits the ageing
    assert pieces.max() < 0.8
    assert others.max() > 0.95
