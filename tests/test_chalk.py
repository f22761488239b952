"""Surveyors' crayon marks: around damages and around nothing, without a label."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.decals.artwork import art_images, art_layers
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.scene.faces import FACE_AXES
from fastgen.scene.object_ids import object_ids
from tests.plain import FEW_DECALS
from tests.unlabelled import bare_of, changed_pixels

COUNT = 60
FRAME_MM = 110.0
KINDS = ["concave", "dented", "perforation", "scrape"]


def config(share, damaged=1.0, **chalk):
    markings = {**FEW_DECALS, "chalk": {"probability": share, **chalk}}
    damage = {"probability": damaged, "kinds": KINDS, "count": [1, 3]}
    return Config.from_values({"markings": markings, "damage": damage})


def scenes(values, count=COUNT):
    generator = Generator(values, seed=8)
    return [generator.scene(index) for index in range(count)]


@pytest.fixture(scope="module")
def at_damages():
    return scenes(config(1.0, at_damage=1.0))


def marks(scene, name="crayon_"):
    return [decal for decal in scene.decals if decal.art.startswith(name)]


def mesh_of(scene):
    return SHAPES.container(scene.container.kind, scene.container.profiles)


def on_face(scene, face, sheet_mm):
    """Positions [K, 2] of sheet coordinates [K, 2] in front of a face: to the right and up."""
    points, _ = mesh_of(scene).sheet_to_surface(face, sheet_mm)
    axes = FACE_AXES[face]
    return points @ np.transpose([axes.right, axes.up])


def damages_on_face(scene, face):
    """Outline [24, 2] and middle [2] of each damage of a face, to the right and up."""
    axes = np.array([FACE_AXES[face].right, FACE_AXES[face].up])
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    for damage in (d for d in scene.damages if d.face == face):
        half = np.array(damage.size_mm) / 2
        swing = np.outer(np.cos(angle) * half[0], damage.along)
        swing += np.outer(np.sin(angle) * half[1], damage.across)
        middle = np.array(damage.origin_mm) @ axes.T
        yield middle + swing @ axes.T, middle


def test_chalk_and_repairs_change_nothing_else_and_have_no_id():
    found = 0
    for share in (0.0, 1.0):
        values = {"markings": {"repairs": {"probability": share}, "chalk": {"probability": share}}}
        sampled = scenes(Config.from_values(values), 25)
        if share == 0:
            bare = sampled
    for without, given in zip(bare, sampled, strict=True):
        drawn = marks(given)
        assert list(given.decals[len(given.decals) - len(drawn) :]) == drawn
        count = len(given.decals) - len(drawn) - len(without.decals)
        assert given.decals[count : count + len(without.decals)] == without.decals
        assert replace(given, decals=without.decals) == without
        ids = object_ids(given)
        assert ids[count : count + len(without.decals)] == object_ids(without)
        assert set(ids[:count]) | set(ids[len(ids) - len(drawn) :]) <= {0}
        found += bool(drawn) and count > 0
    assert found > 15


def test_marks_lie_inside_the_frame_of_their_face(at_damages):
    for scene in at_damages:
        mesh = mesh_of(scene)
        for mark in marks(scene):
            angle = math.radians(mark.rotation_deg)
            width, height = mark.size_mm
            turn = np.abs([[math.cos(angle), math.sin(angle)], [math.sin(angle), math.cos(angle)]])
            reach = turn @ [width / 2, height / 2]
            room = mesh.charts[mesh.chart_index(mark.face)].rect_mm[2:]
            assert (np.array(mark.center_mm) - reach >= FRAME_MM - 0.1).all()
            assert (np.array(mark.center_mm) + reach <= np.array(room) - FRAME_MM + 0.1).all()


def test_the_drawings_of_rings_leave_three_quarters_free_and_close():
    images, layers = art_images(), art_layers()
    rings = [name for name in layers if name.startswith("crayon_ring")]
    assert len(rings) == 5
    at = np.arange(256) - 127.5
    away = np.hypot(at[None], at[:, None]) / 128
    turn = np.arctan2(at[:, None], at[None])
    for name in rings:
        ink = images[layers[name], ..., 3] > 100
        assert away[ink].min() > 0.72
        sectors = np.histogram(turn[ink], bins=24)[0]
        assert (sectors > 0).sum() >= 22


def test_rings_at_damages_enclose_them_or_the_middle_of_large_ones(at_damages):
    whole = total = 0
    for scene in at_damages:
        for ring in marks(scene, "crayon_ring"):
            angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
            # the innermost stroke, see the test above
            oval = 0.72 * np.stack([np.cos(angle), np.sin(angle)], axis=1) * ring.size_mm / 2
            drawn = on_face(scene, ring.face, ring.center_mm + oval @ ring.turn.T)
            here = [
                (outline, middle)
                for outline, middle in damages_on_face(scene, ring.face)
                if _inside(middle[None], drawn)
            ]
            assert here
            whole += any(_inside(outline, drawn) for outline, _ in here)
            total += 1
    assert total > 40
    assert whole > 0.25 * total


def _inside(points, polygon):
    """Test whether points [K, 2] lie inside a convex polygon [N, 2], counter-clockwise."""
    ahead = np.roll(polygon, -1, axis=0)
    edges, away = (ahead - polygon)[:, None], points[None] - polygon[:, None]
    return bool((edges[..., 0] * away[..., 1] > edges[..., 1] * away[..., 0]).all())


def test_arrows_at_damages_point_at_them_from_outside(at_damages):
    found = total = 0
    for scene in at_damages:
        for arrow in marks(scene, "crayon_arrow"):
            length = arrow.size_mm[0]
            ends = np.array([[-length / 2, 0.0], [length / 2, 0.0]])
            tail, tip = on_face(scene, arrow.face, arrow.center_mm + ends @ arrow.turn.T)
            ahead = (tip - tail) / np.linalg.norm(tip - tail)
            hits = 0
            for _, middle in damages_on_face(scene, arrow.face):
                beside = abs((middle - tail) @ (-ahead[1], ahead[0]))
                hits += (middle - tip) @ ahead > 0 and beside < 60
            found += hits > 0
            total += 1
    assert total > 20
    assert found > 0.9 * total


def test_half_of_the_marks_of_damaged_containers_are_at_a_damage():
    shares = []
    for at_damage in (0.0, 0.5, 1.0):
        at = []
        for scene in scenes(config(1.0, at_damage=at_damage)):
            for mark in (m for m in marks(scene) if not m.art.startswith("crayon_code")):
                middles = [middle for _, middle in damages_on_face(scene, mark.face)]
                here = on_face(scene, mark.face, mark.center_mm)[0]
                near = [np.linalg.norm(middle - here) for middle in middles]
                if not mark.art.startswith("crayon_arrow"):
                    at.append(bool(near) and min(near) < 40)
        shares.append(np.mean(at))
    assert shares[0] < 0.03
    assert shares[2] > 0.97
    assert 0.35 < shares[1] < 0.65


def test_damage_does_not_decide_whether_there_is_chalk():
    share, count = 0.4, 150
    found = []
    for damaged in (0.0, 1.0):
        sampled = scenes(config(share, damaged), count)
        found.append([bool(marks(scene)) for scene in sampled])
    deviation = math.sqrt(share * (1 - share) / count)
    assert all(abs(np.mean(each) - share) < 4 * deviation for each in found)
    # a container's own share is drawn without regard to its damage; few marks have no room
    assert np.mean(np.not_equal(*found)) < 0.05


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_chalk_changes_colours_and_no_label(generators, at_damages, quality):
    generator = generators(config(1.0), seed=8, size=(320, 320), quality=quality)
    pairs = [(bare_of(scene, marks(scene)), scene) for scene in at_damages[:3]]
    assert changed_pixels(generator, pairs, ("A", "B", "Cl")) > 100
