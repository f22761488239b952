"""Repairs: patches of sheet or paint and strips of tape, which have no label."""

import itertools
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.sampling.damage_spots import damage_spots
from fastgen.scene import Camera, Decal, Spreader
from fastgen.scene.faces import FACE_AXES
from fastgen.scene.object_ids import object_ids
from fastgen.srgb import DECODED
from tests.plain import EVEN_PAINT
from tests.unlabelled import added, assert_same_labels

COUNT = 60
FRAME_MM = 110.0


def config(share, **repairs):
    # runs and old codes may lie on other decals
    others = {"chalk": {"probability": 0}, "runs": 0, "identifiers": {"painted_over": 0}}
    markings = {"repairs": {"probability": share, **repairs}, **others}
    damage = {"probability": 1.0, "kinds": ["concave", "dented", "perforation"]}
    dry = {"wet_probability": 0}
    return Config.from_values({"markings": markings, "damage": damage, "weather": dry})


@pytest.fixture(scope="module")
def pairs():
    """Scenes without and with repairs."""
    without, given = Generator(config(0.0), seed=4), Generator(config(1.0), seed=4)
    return [(without.scene(index), given.scene(index)) for index in range(COUNT)]


def corners(decal):
    """Corners [4, 2] of a decal on its sheet, mm."""
    half, angle = np.array(decal.size_mm) / 2, math.radians(decal.rotation_deg)
    right = np.array([math.cos(angle), math.sin(angle)])
    up = np.array([-math.sin(angle), math.cos(angle)])
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.array([decal.center_mm + a * half[0] * right + b * half[1] * up for a, b in signs])


def mesh_of(scene):
    return SHAPES.container(scene.container.kind, scene.container.profiles)


def is_tape(decal):
    return min(decal.size_mm) <= 75


def test_repairs_change_nothing_else_in_a_scene_and_have_no_id(pairs):
    found = 0
    for without, given in pairs:
        repairs = added((without, given))
        assert replace(given, decals=without.decals) == without
        assert set(object_ids(given)[: len(repairs)]) <= {0}
        assert object_ids(given)[len(repairs) :] == object_ids(without)
        found += bool(repairs)
    assert found > 0.9 * COUNT


def test_repairs_lie_inside_the_frame_of_their_face(pairs):
    for pair in pairs:
        mesh = mesh_of(pair[1])
        for decal in added(pair):
            width, height = mesh.charts[mesh.chart_index(decal.face)].rect_mm[2:]
            points = corners(decal)
            assert (points >= FRAME_MM - 1).all()
            assert (points <= np.array([width, height]) - FRAME_MM + 1).all()
            axes = FACE_AXES[decal.face]
            middle = mesh.bounds_mm[0] + mesh.bounds_mm[1]
            half = (mesh.bounds_mm[1] - mesh.bounds_mm[0]) / 2
            surface, _ = mesh.sheet_to_surface(decal.face, points)
            for axis in (axes.right, axes.up):
                away = np.abs((surface - middle / 2) @ axis)
                assert (away < abs(half @ axis) - 40).all()


def test_repairs_cover_no_other_decal(pairs):
    for pair in pairs:
        for repair in added(pair):
            low, high = corners(repair).min(axis=0), corners(repair).max(axis=0)
            for other in (d for d in pair[0].decals if d.face == repair.face):
                apart = [low - corners(other).max(axis=0), corners(other).min(axis=0) - high]
                assert np.max(apart) > 0


def test_sizes_of_patches_seams_and_tape_are_those_of_the_configuration(pairs):
    counts = {"tape": 0, "patch": 0, "seam": 0}
    for pair in pairs:
        repairs = added(pair)
        for below, above in itertools.zip_longest(repairs, repairs[1:]):
            assert below.art == "patch"
            if is_tape(below):
                counts["tape"] += 1
                assert 50 <= min(below.size_mm) <= 75
                assert max(below.size_mm) <= 1100
                continue
            seamed = above is not None and above.center_mm == below.center_mm
            if seamed:
                counts["seam"] += 1
                wider = np.subtract(below.size_mm, above.size_mm)
                assert (wider > 11.9).all()
                assert (wider < 28.1).all()
                assert below.albedo != above.albedo
            else:
                counts["patch"] += 1
                assert min(below.size_mm) >= 150
                assert max(below.size_mm) <= 900
    assert min(counts.values()) > 10, counts


def test_the_configuration_decides_the_share_of_containers_and_of_tape():
    share = 0.3
    generator = Generator(config(share, tape=1.0), seed=4)
    bare = Generator(config(0.0), seed=4)
    found = 0
    for index in range(100):
        repairs = added((bare.scene(index), generator.scene(index)))
        assert all(is_tape(decal) for decal in repairs)
        found += bool(repairs)
    assert abs(found / 100 - share) < 4 * math.sqrt(share * (1 - share) / 100)


def near_damage(scene, decal):
    """Test whether the middle of a decal is as near to a damage as a repair beside one."""
    middle, _ = mesh_of(scene).sheet_to_surface(decal.face, decal.center_mm)
    for damage in (d for d in scene.damages if d.face == decal.face):
        reach = (max(damage.size_mm) + math.hypot(*decal.size_mm)) / 2 + 220
        if np.linalg.norm(middle[0] - damage.origin_mm) < reach:
            return True
    return False


def test_repairs_are_at_damages_as_often_as_configured():
    shares = []
    for at_damage in (0.0, 1.0):
        generator = Generator(config(1.0, at_damage=at_damage, count=1, tape=0.0), seed=4)
        bare = Generator(config(0.0), seed=4)
        near = []
        for index in range(COUNT):
            given = generator.scene(index)
            near += [near_damage(given, d) for d in added((bare.scene(index), given))]
        shares.append(np.mean(near))
    assert shares[1] > 0.6
    assert shares[1] > shares[0] + 0.3


def seen_from_before(scene, decal):
    """Return a scene and a camera 2.5 m in front of a decal."""
    point, _ = mesh_of(scene).sheet_to_surface(decal.face, decal.center_mm)
    axes = FACE_AXES[decal.face]
    target = point[0]
    position = target + 2500 * np.array(axes.out) + 300 * np.array(axes.right)
    camera = Camera("near", tuple(map(float, position)), tuple(map(float, target)), 28.0)
    spreader = replace(scene.spreader, present=False)
    return replace(scene, cameras=(camera,), spreader=spreader, neighbours=()), camera


def pixels(camera, points_mm, size):
    """Project points [K, 3] with a pinhole that is level; returns [K, 2] as x and y."""
    position = np.array(camera.position_mm)
    forward = np.array(camera.target_mm) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    away = points_mm - position
    scale = camera.focal_mm / camera.sensor_width_mm * size
    x, y = (away @ axis / (away @ forward) * scale + size / 2 for axis in (right, down))
    return np.stack([x, y], axis=1)


@pytest.mark.parametrize("quality", ["draft", "balanced", "fine"])
def test_a_patch_shows_its_colour_at_its_place_and_no_label(generators, quality):
    size = 200
    clean = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}}, config(1.0))
    bare = Config.from_values({"markings": {"repairs": {"probability": 0}}}, clean)
    generator = generators(clean, seed=4, size=(size, size), quality=quality)
    patches = []
    for index in range(12):
        without = Generator(bare, seed=4).scene(index)
        repairs = added((without, generator.scene(index)))
        walls = [d for d in repairs if d.face in ("front", "back") and min(d.size_mm) > 200]
        patches += [(without, d) for d in walls[-1:]]
    assert len(patches) > 2
    for without, patch in patches[:2]:
        patch = replace(patch, wear=0.0, albedo=(0.05, 0.5, 0.1))
        scene, camera = seen_from_before(without, patch)
        repaired = replace(scene, decals=(patch, *scene.decals))
        shown, plain = (
            generator.render(scene=each, camera="near", layer="decals")
            for each in (repaired, scene)
        )
        steps = np.linspace(-1, 1, 21) / 2
        grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        lower_left, lower_right, _, upper_left = corners(patch)
        axes = np.array([lower_right - lower_left, upper_left - lower_left])
        border = np.abs(grid).max(axis=1) > 0.49
        for places, share in ((0.9 * grid, 1.0), (1.15 * grid[border], 0.0)):
            points, _ = mesh_of(scene).sheet_to_surface(patch.face, patch.center_mm + places @ axes)
            at = pixels(camera, points, size)
            column, row = at[((at > 1) & (at < size - 1)).all(axis=1)].astype(int).T
            away = np.abs(DECODED[shown.image[row, column]] - patch.albedo).max(axis=1)
            assert abs((away < 0.03).mean() - share) < 0.02
        assert_same_labels(plain, shown)


@pytest.mark.parametrize("kind", ["dented", "scrape"])
def test_a_repair_covers_the_bare_steel_of_a_dent_but_no_scrape(generators, kind):
    """The same damage without bare steel looks equal below the repair, and elsewhere different."""
    drawn = {"probability": 1, "count": 1, "kinds": [kind], "faces": ["front"]}
    values = {"damage": {**drawn, "dented": {"marks": {"probability": 0}}}}
    generator = generators(Config.from_values(values), seed=3, size=(256, 256))
    scene = generator.scene(0)
    (damage,) = scene.damages
    (spot,) = damage_spots(mesh_of(scene), scene.damages)
    patch = Decal(
        "sticker", "", "front", spot.center_mm, (300.0, 4000.0), art="patch",
        albedo=(0.5, 0.02, 0.02),
    )  # fmt: skip
    x, y, z = damage.origin_mm
    camera = Camera("C", (x, y - 2500.0, z), damage.origin_mm, 35.0)
    bare, painted = (
        replace(
            scene, damages=(replace(damage, paint_loss=loss, fresh=1.0),), decals=(patch,),
            cameras=(camera,), spreader=Spreader(),
        )
        for loss in (1.0, 0.0)
    )  # fmt: skip
    one, other = (generator.render(scene=each).image.astype(int) for each in (bare, painted))
    worn = np.abs(one - other).max(axis=-1) > 8
    red = (other[..., 0] > 2 * other[..., 1:].max(axis=-1)).astype(np.uint8)
    square = np.ones((9, 9), np.uint8)
    below, away = cv2.erode(red, square) > 0, cv2.dilate(red, square) == 0
    assert below.sum() > 1000
    assert (worn & away).sum() > 40
    if kind == "scrape":
        assert (worn & below).sum() > 40
    else:
        assert not (worn & below).any()
