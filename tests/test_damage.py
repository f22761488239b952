"""Damage: the shader compared with Embree rays on its numpy twin, and sampled proportions."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen.classes import ALL_DAMAGE_CLASSES
from fastgen.config.config import Config
from fastgen.damages.plain import fold_path_mm
from fastgen.generator import Generator
from fastgen.geometry import damage_law
from fastgen.geometry.container import build_container
from fastgen.render.settings import QUALITY, Quality
from fastgen.render.visibility_buffer import VisibilityBuffer
from fastgen.scene import Damage, Scene, Spreader
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.door_gear import BAR_Y_MM
from fastgen.scene.object_ids import mask_values
from tests import oracle
from tests.random_damages import FORM_NAMES

SIZE = (256, 256)
DAMAGED = Config.from_values({"damage": {"probability": 1.0, "kinds": list(ALL_DAMAGE_CLASSES)}})
PAPER = Config.from_values(
    {
        "damage": {
            "probability": 1.0,
            "axis": {"kinked": 0},
            "concave": {"buckled": 0, "creased": 0},
            "dented": {"marks": {"probability": 0}},
            "perforation": {"torn": 0},
        }
    }
)
"""Damage of the forms that the SeaFront paper describes."""

THRESHOLD_MM = DAMAGED.damage.mask_threshold_mm


@pytest.fixture(scope="module")
def generator():
    with Generator(DAMAGED, seed=21, size=SIZE) as made:
        yield made


@pytest.fixture(scope="module")
def paper():
    with Generator(PAPER, seed=21, size=SIZE) as made:
        yield made


@pytest.mark.parametrize("index", range(8))
def test_masks_and_depth_equal_rays_on_the_mesh_deformed_in_numpy(generator, index):
    scene = generator.scene(index)
    mesh = build_container(scene.container.kind, scene.container.profiles)
    for camera in scene.cameras:
        sample = generator.render(scene=scene, camera=camera)
        hits = oracle.cast(mesh, sample.view, scene)
        expected = oracle.damage_values(scene, hits, THRESHOLD_MM)
        wrong = sample.damage != expected
        assert wrong.mean() < 1e-3
        # away from edges, only a pixel centre exactly on a seam between two parts may differ
        assert (wrong & ~oracle.near_edge(expected)).sum() <= 3
        ids = oracle.object_ids(scene, mesh, hits)
        assert ((sample.ids != ids) & ~oracle.near_edge(ids)).sum() <= 3
        both = np.isfinite(sample.depth) & hits.hit & ~oracle.near_edge(expected)
        error_m = np.abs(sample.depth[both] - hits.depth_m[both])
        allowed_m = np.maximum(1e-3, 1e-3 * hits.depth_m[both])
        # pixel centres on a crease may be on either facet
        assert (error_m <= allowed_m).mean() > 0.999


def test_ids_on_a_bulge_are_right_from_behind_the_plane_of_its_sheet(generators):
    """A camera behind the plane of a sheet sees decals on a part that bulges outward."""
    bulging = {"probability": 1, "kinds": ["concave", "dented"], "count": [4, 4]}
    generator = generators(Config.from_values({"damage": bulging}), seed=0, size=(256, 192))
    for index, camera in ((1463, "Cr"), (1103, "Cr"), (373, "Cl")):
        sample = generator.render(index=index, camera=camera)
        mesh = build_container(sample.scene.container.kind, sample.scene.container.profiles)
        ids = oracle.object_ids(sample.scene, mesh, oracle.cast(mesh, sample.view, sample.scene))
        assert ((sample.ids != ids) & ~oracle.near_edge(ids)).sum() <= 3


def test_outward_lips_show_from_behind_the_plane_of_their_sheet(paper):
    """The lower lip of the tear, which runs upright near a post, bends outward by up to 150 mm."""
    scene = paper.scene(0)
    end_mm = KINDS[scene.container.kind].length_mm / 2
    tear = Damage(
        kind="perforation", form="torn", face="front", origin_mm=(end_mm - 500, -1204.0, 1300.0),
        along=(0.0, 0.0, 1.0), across=(-1.0, 0.0, 0.0), inward=(0.0, 1.0, 0.0),
        size_mm=(500.0, 80.0), depth_mm=150.0, shape=(120.0, 1.0, 0.0, 5.0, 1.0, 0.0, 2.0),
    )  # fmt: skip
    camera = replace(
        scene.cameras[0], name="end", position_mm=(end_mm + 6000, -1000.0, 1300.0),
        target_mm=(end_mm, -1250.0, 1300.0), focal_mm=150.0, roll_deg=0.0,
    )  # fmt: skip
    scene = replace(scene, damages=(tear,), cameras=(camera,), spreader=Spreader())
    sample = paper.render(scene=scene, camera="end")
    mesh = build_container(scene.container.kind, scene.container.profiles)
    expected = oracle.damage_values(scene, oracle.cast(mesh, sample.view, scene), THRESHOLD_MM)
    assert (expected == 501).sum() > 30
    wrong = sample.damage != expected
    assert (wrong & ~oracle.near_edge(expected)).sum() == 0
    assert wrong.sum() <= 3


def close_up(scene: Scene, kind: str, form: str | None = None, away_mm: float = 2500) -> Scene:
    """Return the scene with only its first damage of a kind, and a camera in front of it."""
    damage = next(d for d in scene.damages if d.kind == kind and form in (None, d.form))
    origin, inward = np.array(damage.origin_mm), np.array(damage.inward)
    place = origin - away_mm * inward + 150 * np.array(damage.along)
    camera = replace(
        scene.cameras[0], name="close", position_mm=tuple(place), target_mm=damage.origin_mm,
        focal_mm=28.0,
    )  # fmt: skip
    return replace(scene, damages=(damage,), cameras=(camera,))


@lru_cache(500)  # tests search the same scenes for different damages
def scene_of(generator, index):
    return generator.scene(index)


def damages_of(generator):
    """Yield each damage of the first scenes, with its scene."""
    for index in range(200):
        scene = scene_of(generator, index)
        yield from ((scene, damage) for damage in scene.damages)


def scene_with(generator, kind, form=None):
    return next(
        scene for scene, d in damages_of(generator) if d.kind == kind and form in (None, d.form)
    )


@pytest.mark.parametrize(("kind", "form"), FORM_NAMES)
def test_every_form_matches_rays_from_close_by(generator, kind, form):
    scene = scene_with(generator, kind, form)
    damage = next(d for d in scene.damages if (d.kind, d.form) == (kind, form))
    scene = close_up(scene, kind, form, float(np.clip(4 * min(damage.size_mm), 900, 2500)))
    sample = generator.render(scene=scene, camera="close")
    value = mask_values(scene.damages)[0]
    assert (sample.damage == value).sum() > 200
    mesh = build_container(scene.container.kind, scene.container.profiles)
    hits = oracle.cast(mesh, sample.view, scene)
    expected = oracle.damage_values(scene, hits, THRESHOLD_MM)
    assert (sample.damage != expected).mean() < 2e-3
    item = next(o for o in sample.objects if o.class_name == kind)
    assert item.bbox == oracle.box_of(sample.damage == value)


@pytest.mark.parametrize("kind", ["rust_through", "missing_paint", "graffiti"])
def test_a_mark_changes_the_image_in_its_mask_and_nowhere_else(generator, kind):
    scene = close_up(scene_with(generator, kind), kind)
    marked = generator.render(scene=scene, camera="close")
    # a tiny mark, so that the same programs draw both images: others may round edges otherwise
    tiny = tuple(replace(damage, size_mm=(6.0, 6.0)) for damage in scene.damages)
    bare = generator.render(scene=replace(scene, damages=tiny), camera="close")
    changed = np.abs(marked.image.astype(int) - bare.image).max(axis=2) > 2
    mask, border = marked.damage > 200, oracle.near_edge(marked.damage)
    assert mask.sum() > 200
    assert changed[mask & ~border].mean() > 0.7
    # the pixel filter may see a sliver of the mark that no pixel centre beside it shows
    assert changed[~mask & ~border].sum() <= 1


def test_marks_of_later_kinds_cover_those_of_earlier_ones(generator):
    scene = close_up(scene_with(generator, "graffiti"), "graffiti", away_mm=1500)
    (tag,) = scene.damages
    flaked = replace(
        tag, kind="missing_paint", shape=(30.0, 0.5, 2.0, 0.5, 90.0), fresh=1.0,
        bare_albedo=(0.27, 0.09, 0.05),
    )  # fmt: skip
    alone = generator.render(scene=scene, camera="close")
    both = generator.render(scene=replace(scene, damages=(flaked, tag)), camera="close")
    sprayed = alone.damage == mask_values((tag,))[0]
    np.testing.assert_array_equal(both.damage == mask_values((tag,))[0], sprayed)
    inside = ~oracle.near_edge(both.damage)
    np.testing.assert_array_equal(both.image[sprayed & inside], alone.image[sprayed & inside])
    below = both.damage == mask_values((flaked,))[0]
    assert below.sum() > 500
    assert (both.image != alone.image)[below & inside].any(axis=1).mean() > 0.9


@pytest.mark.parametrize(
    ("kind", "ranges"),
    [
        ("axis", {"reach_mm": 1500}),
        ("dented", {"amplitude_mm": 200, "width_mm": 300, "sink_share": 0.9, "depth_mm": 90}),
    ],
)
def test_a_mask_covers_all_steel_that_its_damage_moves(generators, kind, ranges):
    """A wide `axis` reaches beyond the fade of other kinds, a winding dent beyond its width."""
    values = {"probability": 1.0, "count": [1, 1], "kinds": [kind], kind: ranges}
    generator = generators(Config.from_values({"damage": values}), 5, SIZE)
    for index in range(3):
        scene = close_up(replace(generator.scene(index), spreader=Spreader()), kind)
        sample = generator.render(scene=scene, camera="close")
        mesh = build_container(scene.container.kind, scene.container.profiles)
        hits = oracle.cast(mesh, sample.view, scene)
        expected = oracle.damage_values(scene, hits, THRESHOLD_MM)
        wrong = sample.damage != expected
        assert (wrong & ~oracle.near_edge(expected)).sum() <= 3


def test_a_hole_shows_the_inside_and_never_the_sky(paper):
    scene = close_up(scene_with(paper, "perforation"), "perforation")
    sample = paper.render(scene=scene, camera="close")
    through = (sample.damage == 501) & (sample.depth > 3.5)
    assert through.sum() > 50  # rim and sheet are at about 2.5 m, the far wall beyond 4 m
    assert np.isfinite(sample.depth[through]).all()
    assert (sample.ids[through] == 1).all()
    around = sample.image[(sample.damage == 101)].mean()
    assert sample.image[through].mean() < 0.6 * around


def test_a_hole_shows_brown_floor_boards_and_grey_walls(paper):
    scene, damage = next(
        (scene, damage)
        for scene, damage in damages_of(paper)
        if damage.kind == "perforation" and damage.face == "front"
    )
    x, y, _ = damage.origin_mm
    low = replace(damage, origin_mm=(x, y, 500.0), size_mm=(300.0, 300.0))
    scene = close_up(replace(scene, damages=(low,)), "perforation")
    above = replace(scene.cameras[0], position_mm=tuple(
        np.array(scene.cameras[0].position_mm) + (0.0, 0.0, 600.0)
    ))  # fmt: skip
    scene = replace(scene, cameras=(above,))
    albedo = paper.render(scene=scene, camera="close", layer="base")
    sample = paper.render(scene=scene, camera="close", normals=True)
    through = (sample.damage == 501) & (sample.depth > 3.5)
    up = (sample.normals @ sample.view.rotation)[..., 2]
    for part, low, high in ((up > 0.95, 1.3, 2.0), (np.abs(up) < 0.4, 0.9, 1.1)):
        seen = albedo.image[through & part].astype(float).mean(axis=0)
        assert (through & part).sum() > 10
        assert low < seen[0] / seen[2] < high


def test_normals_in_a_hole_are_those_of_the_walls_behind_it(paper):
    scene = close_up(scene_with(paper, "perforation"), "perforation")
    sample = paper.render(scene=scene, camera="close", normals=True)
    mesh = build_container(scene.container.kind, scene.container.profiles)
    hits = oracle.cast(mesh, sample.view, scene)
    behind = (hits.hole >= 0) & (hits.triangle >= 0) & (sample.depth > 3.5)
    corners = mesh.positions_mm[mesh.triangles[hits.triangle[behind]]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= -np.linalg.norm(normal, axis=1, keepdims=True)  # their back faces are seen
    cosine = (sample.normals[behind] * (normal @ sample.view.rotation.T)).sum(axis=1)
    assert behind.sum() > 50
    assert np.median(cosine) > 0.999
    assert (cosine > 0.99).mean() > 0.8  # other pixels blend two sides of a corrugation


def test_outer_and_inner_view_may_share_two_texture_rows(generator, monkeypatch):
    """Textures are two rows too short for the outer view and the inner view of a hole."""
    scene = close_up(scene_with(generator, "perforation"), "perforation")
    monkeypatch.setitem(QUALITY, "balanced", Quality(2, 1))
    with Generator(DAMAGED, seed=21, size=SIZE) as other:
        usual = other.render(scene=scene, camera="close")

    shortened = []

    def made(gl, *rest):
        monkeypatch.setitem(gl.ctx.info, "GL_MAX_TEXTURE_SIZE", 2 * (2 * SIZE[1] + 1) - 2)
        shortened.append(VisibilityBuffer(gl, *rest))
        return shortened[-1]

    monkeypatch.setattr("fastgen.render.recent_targets.VisibilityBuffer", made)
    with Generator(DAMAGED, seed=21, size=SIZE) as other:
        short = other.render(scene=scene, camera="close")
    assert shortened[0].inner_row == 2 * SIZE[1] - 1
    assert (usual.depth > 3.5).sum() > 50
    for name in ("image", "ids", "damage"):
        np.testing.assert_array_equal(getattr(short, name), getattr(usual, name))
    np.testing.assert_allclose(short.depth, usual.depth, rtol=4e-6)


def test_a_hole_behind_rods_and_handles_shows_no_sky(generators):
    values = {"probability": 1.0, "count": [1, 1], "kinds": ["perforation"], "faces": ["door"]}
    generator = generators(Config.from_values({"damage": values}), 77, (256, 256))
    samples = [generator.render(index, "Cr") for index in range(7)]
    holes = [sample.damage == 501 for sample in samples]
    assert sum(int(hole.sum()) for hole in holes) > 600
    for sample, hole in zip(samples, holes, strict=True):
        assert (sample.ids[hole] > 0).all()
        assert np.isfinite(sample.depth[hole]).all()


def test_opposite_holes_let_the_sky_through(paper):
    scene = close_up(scene_with(paper, "perforation"), "perforation")
    first = replace(scene.damages[0], size_mm=(300.0, 300.0), shape=(60.0, *[0.0] * 10))
    inward = np.array(first.inward)
    if abs(inward[0]) > 0.5:
        # holes spare locking bars, so at an end the line of sight passes between two of them
        x, _, z = first.origin_mm
        first = replace(first, origin_mm=(x, sum(BAR_Y_MM[:2]) / 2, z))
    size = {"20": 6058, "40": 12192, "40HC": 12192, "45HC": 13716}[scene.container.kind]
    across = 2438 if abs(inward[1]) > 0.5 else size
    far = np.array(first.origin_mm) + (across - 30) * inward
    second = replace(
        first, origin_mm=tuple(far), inward=tuple(-inward), size_mm=(700.0, 700.0)
    )  # fmt: skip
    camera = replace(
        scene.cameras[0],
        position_mm=tuple(np.array(first.origin_mm) - 2500 * inward),
        target_mm=first.origin_mm,
    )
    holed = replace(scene, damages=(first, second), cameras=(camera,))
    sample = paper.render(scene=holed, camera="close")
    assert sample.ids[128, 128] == 0
    assert sample.damage[128, 128] == 501
    assert np.isinf(sample.depth[128, 128])
    assert sample.cover[128, 128] == 0


def test_deformed_steel_is_dulled_and_rusts(paper):
    """Blue paint without other rust becomes partly brown where a dent is deep."""
    scene = close_up(scene_with(paper, "dented"), "dented")
    worn = replace(scene.damages[0], paint_loss=1.0, fresh=0.0)
    scene = replace(scene, damages=(worn,))
    surface = scene.surface
    paint = replace(surface.paint, albedo=(0.02, 0.05, 0.4))
    rust = replace(surface.rust, coverage=0.0)
    scene = replace(scene, surface=replace(surface, paint=paint, rust=rust), decals=())
    undamaged = replace(scene, damages=())
    dented, whole = (
        paper.render(scene=one, camera="close", layer="rust") for one in (scene, undamaged)
    )
    marked = dented.damage == mask_values(scene.damages)[0]
    worked, painted = (one.image[marked].astype(float).mean(axis=0) for one in (dented, whole))
    assert worked[0] / worked[2] > 1.3 * painted[0] / painted[2]
    # along the fold all paint changes, rusty or not
    (damage,) = scene.damages
    mesh = build_container(scene.container.kind, scene.container.profiles)
    hits = oracle.cast(mesh, dented.view, scene)
    along, across, _ = damage_law.local_coordinates(damage, hits.rest_mm)
    fold = np.abs(across - fold_path_mm(damage, along)) < 0.3 * damage.shape[0]
    fold &= marked & (np.abs(along) < 0.6 * damage.size_mm[0] / 2)
    assert fold.sum() > 100
    blue = (one.image[fold][:, 2].astype(int) for one in (dented, whole))
    assert (np.subtract(*blue) < -5).all()


def test_a_dented_leaf_stays_behind_its_locking_gear(generators):
    """A dented leaf does not reach bars, hubs and levers, and hardly the plates of the catches.

    Where the leaf folds sharply, it may pass the flat triangles of the plates by up to 10 mm.
    """
    doors = {"damage": {"probability": 1.0, "faces": ["door"], "kinds": ["dented"]}}
    across, up = np.meshgrid(np.arange(-870.0, 870.0, 8.0), np.arange(900.0, 1200.0, 8.0))
    eyes = np.column_stack([np.full(across.size, 9000.0), across.ravel(), up.ravel()])
    rays = np.tile([-1.0, 0.0, 0.0], (len(eyes), 1))

    def first_x_mm(positions, triangles):
        body = trimesh.Trimesh(positions, triangles.astype(np.int64), process=False)
        points, ray, _ = RayMeshIntersector(body).intersects_location(
            eyes, rays, multiple_hits=False
        )
        x_mm = np.full(len(eyes), -np.inf)
        x_mm[ray] = points[:, 0]
        return x_mm

    count = 0
    generator = generators(Config.from_values(doors), seed=3, size=(64, 64))
    for scene in map(generator.scene, range(16)):
        mesh = build_container(scene.container.kind, scene.container.profiles)
        names = [chart.name.startswith(("door.bar", "door.handle")) for chart in mesh.charts]
        is_gear = np.array(names)[mesh.chart[mesh.triangles[:, 0]]]
        parts = mesh.triangles[is_gear], mesh.triangles[~is_gear]
        gear, leaf = (first_x_mm(mesh.positions_mm, part) for part in parts)
        seen = gear > leaf
        plate = seen & (gear < gear.max() - 30)  # behind bars and levers
        moved = damage_law.deform(scene.damages, mesh.positions_mm)
        gear, leaf = (first_x_mm(moved, part) for part in parts)
        assert (leaf < gear)[seen & ~plate].all()
        assert (leaf < gear + 10)[plate].all()
        assert (leaf < gear)[plate].mean() > 0.9
        assert plate.sum() > 200
        count += (seen & ~plate).sum()
    assert count > 16 * 200


def test_undamaged_places_do_not_change(generator):
    scene = generator.scene(3)
    camera = scene.cameras[1]
    damaged = generator.render(scene=scene, camera=camera)
    undamaged = generator.render(scene=replace(scene, damages=()), camera=camera)
    far = damaged.damage == undamaged.damage
    same = (damaged.image == undamaged.image).all(axis=-1)
    assert far.mean() > 0.5
    assert same[far].mean() > 0.9
