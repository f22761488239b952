"""Streaks below markers, stickers and damages, which have no label."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.scene.object_ids import object_ids
from tests.plain import NO_REPAIRS
from tests.unlabelled import bare_of, changed_pixels

COUNT = 40
DIRTY = {"dirt_streaks": [0.7, 0.7], "rust_coverage": [0.1, 0.1]}
DAMAGED = {"probability": 1.0, "kinds": ["perforation", "dented"]}


def config(share, **surface):
    markings = {"runs": share, **NO_REPAIRS}
    return Config.from_values(
        {"markings": markings, "surface": {**DIRTY, **surface}, "damage": DAMAGED}
    )


def runs(scene):
    return [decal for decal in scene.decals if decal.art.startswith("run_")]


def top(run):
    return np.array(run.center_mm) + (0.0, run.size_mm[1] / 2)


@pytest.fixture(scope="module")
def scenes():
    generator = Generator(config(1.0), seed=6)
    return [generator.scene(index) for index in range(COUNT)]


def test_runs_move_nothing_and_have_no_id(scenes):
    generator = Generator(config(0.0), seed=6)
    for index, scene in enumerate(scenes):
        without = generator.scene(index)
        assert not runs(without)
        count = len(without.decals)
        assert scene.decals[:count] == without.decals
        assert list(scene.decals[count:]) == runs(scene)
        assert replace(scene, decals=without.decals) == without
        assert set(object_ids(scene)[count:]) <= {0}
        assert object_ids(scene)[:count] == object_ids(without)


def test_a_run_begins_at_the_lower_corner_of_nearly_every_marker(scenes):
    found = total = 0
    for scene in scenes:
        for marker in (d for d in scene.decals if d.kind == "marker" and d.face != "roof"):
            corner = np.array(marker.center_mm) - (0.0, marker.size_mm[1] / 2)
            near = [r for r in runs(scene) if r.face == marker.face]
            hits = [r for r in near if np.abs(top(r) - corner).max() < 0.1 * marker.size_mm[1]]
            assert all(r.center_mm[1] < marker.center_mm[1] for r in hits)
            found += bool(hits)
            total += corner[1] > 200
    assert total > 200
    assert found > 0.9 * total


def test_rust_runs_from_the_place_of_each_rusty_hole_on_the_sheet(scenes):
    found, total = {True: 0, False: 0}, {True: 0, False: 0}
    for scene in scenes:
        mesh = SHAPES.container(scene.container.kind, scene.container.profiles)
        for hole in (d for d in scene.damages if d.kind == "perforation" and d.face != "roof"):
            tops = [top(r) for r in runs(scene) if r.face == hole.face]
            points, _ = mesh.sheet_to_surface(hole.face, np.array(tops).reshape(-1, 2))
            # the hole's axis goes through the sheet wherever a corrugation puts it
            away = points - hole.origin_mm
            away -= np.outer(away @ hole.inward, hole.inward)
            rusty = hole.paint_loss > 0 and hole.fresh < 1
            if hole.origin_mm[2] > 400:
                found[rusty] += (np.linalg.norm(away, axis=1) < 0.6 * hole.size_mm[0]).any()
                total[rusty] += 1
    assert total[True] > 20
    assert found[True] > 0.85 * total[True]
    # some others are above the run of a decal or of nothing
    assert found[False] < 0.7 * total[False]


def test_as_many_runs_are_below_nothing(scenes):
    below = elsewhere = 0
    for scene in scenes:
        for run in runs(scene):
            here = [d for d in scene.decals if d.face == run.face and d not in runs(scene)]
            edges = [np.array(d.center_mm) - (0.0, d.size_mm[1] / 2) for d in here]
            near = any(
                abs(e[0] - top(run)[0]) < d.size_mm[0] / 2 and abs(e[1] - top(run)[1]) < 40
                for e, d in zip(edges, here, strict=True)
            )
            below += near
            elsewhere += not near
    assert 0.6 < elsewhere / below < 1.6


def test_clean_containers_have_no_runs():
    generator = Generator(config(1.0, dirt_streaks=[0, 0], rust_coverage=[0, 0]), seed=6)
    assert not any(runs(generator.scene(index)) for index in range(10))


def test_the_share_decides_how_many_there_are(scenes):
    generator, share = Generator(config(0.25), seed=6), 0.25
    few = sum(len(runs(generator.scene(index))) for index in range(COUNT))
    many = sum(len(runs(scene)) for scene in scenes)
    assert abs(few / many - share) < 4 * math.sqrt(share * (1 - share) / many) + 0.03


def test_runs_change_colours_and_no_label(generators, scenes):
    generator = generators(config(1.0), seed=6, size=(320, 320))
    pairs = [(bare_of(scene, runs(scene)), scene) for scene in scenes[:3]]
    assert changed_pixels(generator, pairs, ("B", "Cl")) > 500
