"""Seals: shape, ids, boxes and keypoints compared with rays, and their place at moved hasps."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_matrix

from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.export import export_glb
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.damage_law import deform
from fastgen.geometry.seals import hasp_middle_mm, scene_seals
from fastgen.scene import Camera, Damage, Lens, Neighbour, Pose, Scene, Seal
from tests import oracle
from tests.mesh_probe import winding_normals

SIZE = (320, 240)
CONFIG = Config.from_values({"damage": {"probability": 0}, "spreader": {"probability": 0}})
ALL = (
    Seal("bolt", 0),
    Seal("cable", 1, albedo=(0.02, 0.1, 0.5)),
    Seal("bolt", 2, "hanging"),
    Seal("cable", 3, "hanging"),
)
VIEWS = {
    "square": (0, (900.0, 0.0, 0.0)),
    "from below": (1, (700.0, 150.0, -500.0)),
    "between bars": (2, (1200.0, 500.0, 200.0)),
    "grazing": (3, (150.0, -900.0, 100.0)),
    "from afar": (2, (4000.0, -900.0, 600.0)),
}
DENT = Damage(
    kind="concave",
    face="door",
    origin_mm=(0.0, -245.0, 1120.0),
    along=(0.0, 1.0, 0.0),
    across=(0.0, 0.0, 1.0),
    inward=(-1.0, 0.0, 0.0),
    size_mm=(700.0, 600.0),
    depth_mm=60.0,
)


@pytest.fixture(scope="module")
def generator():
    with Generator(CONFIG, seed=5, size=SIZE) as made:
        yield made


@pytest.fixture(scope="module")
def scene(generator):
    return replace(generator.scene(0), seals=ALL)


def looking_at(scene, hasp, offset_mm, lens=None):
    """Return a camera at an offset from a hasp, which it looks at."""
    middle = hasp_middle_mm(scene.container.kind, hasp)
    place, target = (middle + offset_mm).tolist(), (middle - (25.0, 0.0, 20.0)).tolist()
    return Camera("near", tuple(place), tuple(target), 45.0, lens=lens)


def dented(scene):
    origin = (hasp_middle_mm(scene.container.kind, 0)[0] - 58.0, *DENT.origin_mm[1:])
    return replace(scene, damages=(replace(DENT, origin_mm=origin),))


def check_against_rays(sample):
    """Compare ids, boxes, areas and visible fractions of the seals with rays."""
    scene = sample.scene
    mesh = build_container(scene.container.kind, scene.container.profiles)
    hits = oracle.cast(mesh, sample.view, scene)
    bare = oracle.object_ids(scene, mesh, hits)
    expected = oracle.with_seals(bare, hits, scene, sample.view)
    seen = expected >= oracle.SEAL
    wrong = (sample.ids != expected) & (seen | (sample.ids >= oracle.SEAL))
    assert wrong.sum() <= 1 + 2e-3 * seen.sum()  # centres on an edge
    for item in (thing for thing in sample.objects if thing.class_name == "seal"):
        shown = expected == item.id
        assert abs(item.area - np.count_nonzero(shown)) <= wrong.sum()
        if not wrong.any():
            assert item.bbox == oracle.box_of(shown)
        assert (item.bbox is None) == (item.area == 0)
        if item.area:
            x0, y0, x1, y1 = item.amodal_bbox
            a, b, c, d = item.bbox
            assert (np.array([x0 - a, y0 - b, c - x1, d - y1]) < 1).all()
    return seen


@pytest.mark.parametrize("view", VIEWS)
def test_ids_and_boxes_equal_ray_casts(generator, scene, view):
    seen = check_against_rays(generator.render(scene=scene, camera=looking_at(scene, *VIEWS[view])))
    assert seen.sum() > (100 if view != "from afar" else 4)


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_ids_and_boxes_of_seals_on_a_dented_door_equal_ray_casts(scene, quality):
    with Generator(CONFIG, seed=5, size=SIZE, quality=quality) as generator:
        camera = looking_at(scene, 0, VIEWS["square"][1])
        sample = generator.render(scene=dented(scene), camera=camera)
        assert check_against_rays(sample).sum() > 100
        shown = sample.ids >= oracle.SEAL
        assert (sample.damage[shown] == 101).all()


def test_ids_with_lens_distortion_equal_ray_casts(generator, scene):
    lens = Lens("brown_conrady", (-0.2, 0.05, 0.0, 0.0, 0.0))
    camera = looking_at(scene, 1, (900.0, 200.0, 100.0), lens)
    assert check_against_rays(generator.render(scene=scene, camera=camera)).sum() > 100


def test_visible_fraction_and_keypoint_equal_ray_casts(generator, scene):
    """Tested on a seal that a locking bar hides in part, and on one behind nothing."""
    fractions = []
    for offset in ((110.0, 2000.0, 0.0), (1800.0, 0.0, 0.0)):
        camera = replace(looking_at(scene, 0, offset), focal_mm=200.0)
        sample = generator.render(scene=replace(scene, seals=ALL[:1]), camera=camera)
        (item,) = (thing for thing in sample.objects if thing.class_name == "seal")
        start, rays = sample.view.rays()
        seals = scene_seals(sample.scene)
        hit, _ = oracle.first_hits(seals.mesh, sample.view, start, rays.reshape(-1, 3))
        alone = int(np.count_nonzero(hit >= 0))
        assert not item.truncated
        assert item.visible_fraction == pytest.approx(item.area / alone, abs=0.02)
        fractions.append(item.visible_fraction)
        x, y, flag = item.keypoints[0]
        assert (x, y) == pytest.approx(sample.view.project(seals.middles_mm)[0][0], abs=1e-3)
        assert (flag == 2) == (sample.ids[int(y), int(x)] == item.id)
    assert 0 < fractions[0] < 0.9
    assert fractions[1] > 0.97


def test_solids_are_closed_and_face_outward(scene):
    for seal in ALL:
        mesh = scene_seals(replace(scene, seals=(seal,))).mesh
        assert len(mesh.triangles) < 100
        places, welded = np.unique(mesh.positions_mm.round(3), axis=0, return_inverse=True)
        corners = welded[mesh.triangles]
        directed = np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])
        count = coo_matrix((np.ones(len(directed)), directed.T), (len(places),) * 2).tocsr()
        assert (count != count.T).nnz == 0
        stored = mesh.normals[mesh.triangles[:, 0]]
        assert np.einsum("ij,ij->i", stored, winding_normals(mesh)).min() > 1 - 1e-4


@pytest.mark.parametrize("kind", ["20", "40HC", "45HC"])
def test_seals_are_between_the_leaf_and_the_plane_of_the_frame(kind, scene):
    container = replace(scene.container, kind=kind)
    seals = scene_seals(replace(scene, container=container, seals=ALL))
    depth = build_container(kind).bounds_mm[1][0] - seals.mesh.positions_mm[:, 0]
    assert depth.min() > 12.5
    assert depth.max() < 58.0


def test_a_seal_moves_as_a_whole_with_the_catch_behind_it(scene):
    hurt = dented(scene)
    rest, moved = scene_seals(scene), scene_seals(hurt)
    shift = moved.middles_mm - rest.middles_mm
    catch = hasp_middle_mm(scene.container.kind, 0) - (25.0, 0.0, 0.0)
    assert shift[0] == pytest.approx(deform(hurt.damages, catch) - catch, abs=1e-6)
    assert shift[0][0] < -20
    own = rest.facets.owner == 0
    apart = moved.mesh.positions_mm[own] - rest.mesh.positions_mm[own]
    assert np.abs(apart - shift[0]).max() < 2e-3


def test_a_hasp_without_a_seal_has_no_object(generator, scene):
    bare = generator.render(
        scene=replace(scene, seals=ALL[2:3]), camera=looking_at(scene, 2, (900.0, 0.0, 0.0))
    )
    named = [item.id for item in bare.objects if item.class_name == "seal"]
    assert named == [oracle.SEAL + 2]
    assert set(np.unique(bare.ids[bare.ids >= oracle.SEAL])) == {oracle.SEAL + 2}


def test_a_seal_has_its_own_colour(generator, scene):
    camera = looking_at(scene, 1, (500.0, 0.0, 0.0))
    for channel in (0, 2):
        albedo = tuple(0.6 if i == channel else 0.01 for i in range(3))
        sample = generator.render(
            scene=replace(scene, seals=(Seal("cable", 1, albedo=albedo),)), camera=camera
        )
        x, y, flag = next(o for o in sample.objects if o.class_name == "seal").keypoints[0]
        assert flag == 2
        assert int(sample.image[int(y), int(x)].argmax()) == channel


def test_scenes_with_seals_round_trip_and_files_without_them_load(scene):
    assert Scene.from_json(scene.to_json()) == scene
    plain = json.loads(scene.to_json())
    del plain["seals"]
    assert Scene.from_json(json.dumps(plain)) == replace(scene, seals=())


@pytest.mark.parametrize(
    ("seals", "message"),
    [
        ((Seal("bolt", 1), Seal("cable", 1)), "scene.seals: 2 are at hasp 1"),
        ((Seal("bolt", 4),), "scene.seals"),
        ((Seal("wire", 0),), "scene.seals"),
    ],
)
def test_seals_that_cannot_be_drawn_are_refused(generator, scene, seals, message):
    with pytest.raises(ConfigError, match=message):
        generator.render(scene=replace(scene, seals=seals))


def test_shares_of_the_config_are_those_of_its_scenes():
    values = {"probability": 0.6, "second": 0.5, "hanging": 0.3, "kinds": {"bolt": 3, "cable": 1}}
    generator = Generator(Config.from_values({"seals": values}), seed=2)
    carried = [generator.scene(index).seals for index in range(300)]
    each = [seal for seals in carried for seal in seals]
    with_seals = [seals for seals in carried if seals]
    assert len(with_seals) / 300 == pytest.approx(0.6, abs=0.08)
    assert np.mean([len(seals) == 2 for seals in with_seals]) == pytest.approx(0.5, abs=0.1)
    assert np.mean([seal.state == "hanging" for seal in each]) == pytest.approx(0.3, abs=0.08)
    assert np.mean([seal.kind == "bolt" for seal in each]) == pytest.approx(0.75, abs=0.08)
    assert {seal.hasp for seal in each} == {0, 1, 2, 3}
    assert all(len({seal.hasp for seal in seals}) == len(seals) for seals in carried)
    assert len({seal.albedo for seal in each}) == 6


def test_scenes_of_the_paper_have_no_seals_and_otherwise_stay_the_same():
    plain = Generator(Config.preset(), seed=2).scene(0)
    sealed = Generator(Config.from_values({"seals": {"probability": 1}}), seed=2).scene(0)
    assert plain.seals == ()
    assert sealed.seals
    assert replace(sealed, seals=()) == plain
    with pytest.raises(ConfigError, match=r"seals.*kinds: all weights are 0"):
        Config.from_values({"seals": {"kinds": {"bolt": 0, "cable": 0}}})


def test_an_exported_scene_has_its_seals(generator, scene, tmp_path):
    path = tmp_path / "sealed.glb"
    export_glb(generator, scene, path, cameras=[], texel_mm=16.0)
    parts = dict(trimesh.load(path, process=False).geometry)
    names = {f"seal_{hasp}" for hasp in range(4)} | {"seal_steel"}
    assert set(parts) == {"container", *names}
    seals = scene_seals(scene).mesh
    points = np.concatenate([parts[name].vertices for name in sorted(names)])
    low, high = points.min(axis=0), points.max(axis=0)
    assert [low[0], high[1]] == pytest.approx(
        [seals.bounds_mm[0][0] / 1000, seals.bounds_mm[1][2] / 1000], abs=1e-5
    )
    assert sum(len(parts[name].faces) for name in names) == len(seals.triangles)
    blue = parts["seal_1"].visual.material.baseColorFactor
    assert blue[:3] == pytest.approx([round(255 * c) for c in ALL[1].albedo], abs=1)


def test_a_seal_is_as_shaded_by_a_neighbour_as_the_door_behind_it(generator, scene):
    """A container 1.2 m before the door hides most of the sky from both."""
    kind = scene.container.kind
    albedo = (0.4, 0.4, 0.4)
    alone = replace(scene, seals=(Seal("bolt", 1, albedo=albedo),), decals=())
    place = (build_container(kind).bounds_mm[1][0] * 2 + 1200.0, 0.0, 0.0)
    beside = replace(alone, neighbours=(Neighbour(Pose(place), scene.container, scene.surface),))
    camera = looking_at(scene, 1, (600.0, 0.0, 0.0))
    found = []
    for each in (alone, beside):
        sample = generator.render(scene=each, camera=camera)
        light = (sample.image / 255).mean(axis=2) ** 2.2
        seal = sample.ids == oracle.SEAL + 1
        around = cv2.dilate(seal.astype(np.uint8), np.ones((25, 25), np.uint8)) > 0
        found.append(light[seal].mean() / light[around & ~seal].mean())
    assert found[1] == pytest.approx(found[0], rel=0.3)
