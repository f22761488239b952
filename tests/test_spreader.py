"""The spreader: shape, occlusion and place in the scene, checked with rays and algebra."""

import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fastgen.camera.projection import view_of
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.spreader import build_spreader, tier_bounds_mm
from fastgen.scene import Decal, Scene, Spreader
from tests import oracle
from tests.mesh_probe import ISO_668, first_hits, winding_normals
from tests.plain import FEW_DECALS

ALWAYS = Config.from_values({"spreader": {"probability": 1}, "damage": {"probability": 0}})
SIZE = (320, 240)
POSES = [(True, True), (False, False), (True, False)]


@pytest.fixture(scope="module")
def generator():
    with Generator(ALWAYS, seed=31, size=SIZE) as made:
        yield made


def surface_points(mesh):
    """Return points [N, 3] spread over all triangles."""
    steps = [(i / 8, j / 8, (8 - i - j) / 8) for i in range(9) for j in range(9 - i)]
    return np.einsum("sc,tcd->tsd", steps, mesh.positions_mm[mesh.triangles]).reshape(-1, 3)


@pytest.mark.parametrize("kind", ISO_668)
@pytest.mark.parametrize("down", POSES)
def test_solids_are_closed_and_face_outward(kind, down):
    mesh = build_spreader(kind, down)
    places, welded = np.unique(mesh.positions_mm.round(2), axis=0, return_inverse=True)
    corners = welded[mesh.triangles]
    directed = np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])
    size = len(places)
    count = coo_matrix((np.ones(len(directed)), directed.T), (size, size)).tocsr()
    assert (count != count.T).nnz == 0
    _, solid = connected_components(count)
    a, b, c = places[corners].astype(np.float64).transpose(1, 0, 2)
    volume = np.bincount(solid[corners[:, 0]], np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)
    assert volume[np.unique(solid)].min() > 1e4
    stored = mesh.normals[mesh.triangles[:, 0]]
    assert np.einsum("ij,ij->i", stored, winding_normals(mesh)).min() > 1 - 1e-4
    assert len(mesh.triangles) < 4000


@pytest.mark.parametrize("kind", ISO_668)
@pytest.mark.parametrize("down", POSES)
@pytest.mark.parametrize("gap", [0.0, 20.0])
def test_only_lowered_flippers_reach_below_the_castings_upper_plane(kind, down, gap):
    length, width, height, _ = ISO_668[kind]
    x, y, z = surface_points(build_spreader(kind, down, gap)).T
    beside = (np.abs(x) >= length / 2 + 25) | (np.abs(y) >= width / 2 + 25)
    lowered = z < height - 1e-2
    assert beside[lowered].all()
    assert lowered.any() == any(down)
    assert (lowered & (y < 0)).any() == down[0]
    assert (lowered & (y > 0)).any() == down[1]


@pytest.mark.parametrize("kind", ISO_668)
@pytest.mark.parametrize("gap", [5.0, 30.0])
def test_the_spreader_extends_over_all_four_castings(kind, gap):
    length, width, height, _ = ISO_668[kind]
    mesh = build_spreader(kind, (False, False), gap)
    corners = [
        (end * (length / 2 - 60), side * (width / 2 - 50), height + 1)
        for end in (-1, 1)
        for side in (-1, 1)
    ]
    triangle, distance = first_hits(mesh, np.array(corners), np.tile([0.0, 0, 1], (4, 1)))
    assert (triangle >= 0).all()
    assert distance == pytest.approx(gap - 1, abs=0.01)
    low, high = tier_bounds_mm(mesh)[0]
    # raised flippers reach outward too
    assert np.allclose([low[0], high[0]], [-length / 2 - 155, length / 2 + 155], atol=1)
    assert np.allclose([low[1], high[1]], [-width / 2 - 155, width / 2 + 155], atol=1)


def test_eight_cables_rise_above_the_usual_image():
    mesh = build_spreader("40")
    height = 2591 + 8000
    x = np.arange(-2000, 2000, 2.0)
    found = 0
    for side in (-1, 1):
        origins = np.column_stack([x, np.full(len(x), side * 3000.0), np.full(len(x), height)])
        triangle, distance = first_hits(mesh, origins, np.tile([0.0, -side, 0], (len(x), 1)))
        found += np.count_nonzero(np.diff((triangle >= 0).astype(int)) == 1)
        assert (distance[triangle >= 0] < 3000).all()
    assert found == 8
    _, high = mesh.bounds_mm
    assert high[2] > 2591 + 12000


@pytest.mark.parametrize("camera", ["A", "B", "Cl", "Cr"])
@pytest.mark.parametrize("index", [0, 1, 2, 3])
def test_ids_and_depth_equal_ray_casts_through_pixel_centres(generator, camera, index):
    sample = generator.render(index=index, camera=camera)
    mesh = build_container(sample.scene.container.kind, sample.scene.container.profiles)
    hits = oracle.cast(mesh, sample.view, sample.scene)
    expected = oracle.object_ids(sample.scene, mesh, hits)
    assert (expected == oracle.SPREADER).sum() > 300
    wrong = sample.ids != expected
    assert wrong.mean() < 3e-4
    # away from edges, only a pixel centre exactly on a seam between two sheets may differ
    of_spreader = (sample.ids == oracle.SPREADER) | hits.spreader
    assert not (wrong & of_spreader & ~oracle.near_edge(expected)).any()
    assert (wrong & ~oracle.near_edge(expected)).sum() <= 1
    both = np.isfinite(hits.depth_m) & np.isfinite(sample.depth)
    both &= ~wrong & ~oracle.near_edge(expected)
    error = np.abs(sample.depth[both] - hits.depth_m[both]) / hits.depth_m[both]
    assert np.quantile(error, 0.999) < 1e-3
    spreader = both & hits.spreader
    error = np.abs(sample.depth[spreader] - hits.depth_m[spreader]) / hits.depth_m[spreader]
    # a pixel centre may fall on either side of an inner edge, so a few pixels may differ
    assert np.quantile(error, 0.99) < 1e-5


@pytest.mark.parametrize(
    ("quality", "side", "least"), [("draft", 640, 0.9), ("balanced", 320, 0.99)]
)
@pytest.mark.parametrize("camera", ["A", "B"])
def test_cables_are_unbroken_lines(generators, quality, side, least, camera):
    """Where rays show a cable, an adjacent pixel shows it too."""
    generator = generators(seed=6, size=(side, side), quality=quality)
    scene = generator.scene(0)
    scene = replace(scene, spreader=replace(scene.spreader, present=True))
    sample = generator.render(scene=scene, camera=camera)
    steps, rows = 8, slice(8, 24)
    offset = (np.arange(steps) + 0.5) / steps - 0.5
    x, y = np.meshgrid(np.arange(side), np.arange(side)[rows])
    centers = np.stack([x, y], axis=-1)[..., None, :] + 0.5
    across = np.stack([offset, np.zeros(steps)], axis=-1)
    mesh = build_container(scene.container.kind, scene.container.profiles)
    expected = oracle.cast(mesh, sample.view, scene, centers + across).spreader.any(axis=2)
    assert np.count_nonzero(expected) > 100
    shown = cv2.dilate((sample.cover > 0).astype(np.uint8), np.ones((1, 3)))[rows] > 0
    assert shown[expected].mean() > least


def front_marker(scene, down):
    """Return the scene with one marker in the front's upper left corner and a camera facing it."""
    kind = scene.container.kind
    mesh = build_container(kind, scene.container.profiles)
    _, _, _, height = mesh.charts[mesh.chart_index("front")].rect_mm
    center = (130.0, height - 100.0)
    marker = Decal("marker", "C3.1", "front", center, (140.0, 140.0), art="C3.1")
    place = mesh.sheet_to_surface("front", [center])[0][0]
    camera = replace(
        scene.cameras[0],
        name="close",
        position_mm=(place[0], -7000.0, place[2]),
        target_mm=tuple(place),
        focal_mm=100.0,
        roll_deg=0.0,
    )
    spreader = Spreader(present=True, flippers_down=(down, down), gap_mm=10.0)
    return replace(scene, decals=(marker,), damages=(), spreader=spreader, cameras=(camera,))


def test_a_marker_behind_a_lowered_flipper_is_hidden(generator):
    scene = generator.scene(0)
    bare = generator.render(scene=front_marker(scene, down=False), camera="close")
    hidden = generator.render(scene=front_marker(scene, down=True), camera="close")
    marker = bare.ids == 2
    assert marker.sum() > 50
    assert not (hidden.ids == 2).any()
    assert (hidden.ids[marker] == oracle.SPREADER).all()
    (item,) = (o for o in hidden.objects if o.class_name == "C3.1")
    assert item.bbox is None
    assert item.area == 0


def test_damage_neither_moves_nor_marks_the_spreader(generators):
    config = Config.from_values({"spreader": {"probability": 1}, "damage": {"probability": 1}})
    inner = []
    generator = generators(config, seed=32, size=SIZE)
    for index in range(3):
        scene = generator.scene(index)
        for camera in scene.cameras:
            damaged = generator.render(scene=scene, camera=camera)
            undamaged = generator.render(scene=replace(scene, damages=()), camera=camera)
            spreader = damaged.ids == oracle.SPREADER
            assert (damaged.damage[spreader] == 0).all()
            both = spreader & (undamaged.ids == oracle.SPREADER)
            assert both.sum() >= 0.99 * spreader.sum()
            np.testing.assert_allclose(damaged.depth[both], undamaged.depth[both], rtol=1e-5)
            same = (damaged.image == undamaged.image).all(axis=-1)
            inner.append(same[both & ~oracle.near_edge(damaged.ids)])
    assert np.concatenate(inner).mean() > 0.99


def test_decals_do_not_appear_on_the_spreader(generator):
    scene = generator.scene(2)
    bare = replace(scene, decals=())
    for camera in scene.cameras:
        with_decals = generator.render(scene=scene, camera=camera)
        without = generator.render(scene=bare, camera=camera)
        inner = (with_decals.ids == oracle.SPREADER) & ~oracle.near_edge(with_decals.ids)
        np.testing.assert_array_equal(with_decals.image[inner], without.image[inner])
        spreader = with_decals.ids == oracle.SPREADER
        np.testing.assert_array_equal(spreader, without.ids == oracle.SPREADER)


def test_the_spreader_has_the_scenes_paint(generator):
    scene = generator.scene(1)
    red = replace(scene, spreader=replace(scene.spreader, albedo=(0.6, 0.02, 0.02)))
    sample = generator.render(scene=red, camera="Cl", layer="base")
    image = sample.image[sample.ids == oracle.SPREADER].astype(int)
    painted = (image[:, 0] - image[:, 1] > 100).mean()
    assert painted > 0.6


def test_the_prepared_spreader_is_the_one_that_is_drawn(generator):
    scene = generator.scene(1)
    generator.render(scene=scene, camera="B")
    mesh = PreparedScene(scene).spreader.mesh
    pixels, depth = view_of(scene.camera("B"), SIZE).project(mesh.positions_mm)
    assert (depth > 0).all()
    sample = generator.render(scene=scene, camera="B")
    x0, y0, x1, y1 = oracle.box_of(sample.ids == oracle.SPREADER)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    assert low[0] - 1 <= x0
    assert x1 <= high[0] + 1
    assert max(low[1], 0) - 1 <= y0
    assert y1 <= high[1] + 1
    none = replace(scene, spreader=Spreader(present=False))
    assert PreparedScene(none).spreader is None
    assert not (generator.render(scene=none, camera="B").ids == oracle.SPREADER).any()


def test_scenes_round_trip_through_json_and_older_ones_have_no_spreader(generator):
    scene = generator.scene(5)
    assert scene.spreader.present
    assert Scene.from_json(scene.to_json()) == scene
    plain = json.loads(scene.to_json())
    del plain["spreader"]
    assert Scene.from_json(json.dumps(plain)).spreader == Spreader(present=False)


def test_nine_scenes_in_ten_have_a_spreader_and_nothing_else_depends_on_it():
    usual, never = (
        Generator(Config.from_values({"markings": FEW_DECALS, **values}), 8)
        for values in ({}, {"spreader": {"probability": 0}})
    )
    scenes = [usual.scene(i) for i in range(200)]
    count = sum(scene.spreader.present for scene in scenes)
    assert abs(count - 180) < 4 * math.sqrt(200 * 0.9 * 0.1)
    assert {scene.spreader.flippers_down for scene in scenes} == {
        (a, b) for a in (True, False) for b in (True, False)
    }
    for index, scene in enumerate(scenes[:20]):
        other = never.scene(index)
        assert not other.spreader.present
        assert replace(other, spreader=scene.spreader) == scene


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: build_spreader("41"), "41"),
        (lambda: build_spreader("20", gap_mm=-1.0), "gap_mm: -1"),
        (lambda: build_spreader("20", gap_mm=900.0), "gap_mm: 900"),
        (lambda: Config.from_values({"spreader": {"colors": []}}), "spreader.colors"),
        (lambda: Config.from_values({"spreader": {"colors": ["pink"]}}), "pink"),
        (lambda: Config.from_values({"spreader": {"probability": 2}}), "spreader.probability: 2"),
        (lambda: Config.from_values({"spreader": {"gap_mm": [0, 500]}}), "spreader.gap_mm"),
    ],
)
def test_bad_input_is_named_in_one_line(make, message):
    with pytest.raises(ConfigError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
