"""Older identifiers under fresh paint: visible, but without labels."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.decals.iso6346 import check_digit
from fastgen.generator import Generator
from fastgen.render.constants import DECAL_CELL_MM
from fastgen.render.decal_tables import MARGIN_MM
from fastgen.sampling.sheet import has_slots
from fastgen.scene import Decal
from fastgen.scene.limits import MOST_NEARBY, NEARBY_MM
from fastgen.scene.object_ids import object_ids
from tests.plain import NO_REPAIRS
from tests.unlabelled import added, changed_pixels

COUNT = 60


def config(share):
    markings = {"identifiers": {"painted_over": share}, **NO_REPAIRS}
    return Config.from_values({"markings": markings})


@pytest.fixture(scope="module")
def pairs():
    """Scenes without and with an older identifier."""
    without, given = Generator(config(0.0), seed=3), Generator(config(1.0), seed=3)
    return [(without.scene(index), given.scene(index)) for index in range(COUNT)]


def test_an_older_identifier_moves_no_other_decal_and_has_no_id(pairs):
    found = 0
    for without, given in pairs:
        older = added((without, given))
        assert replace(given, decals=without.decals) == without
        ids = object_ids(given)
        assert set(ids[: len(older)]) <= {0}
        assert ids[len(older) :] == object_ids(without)
        found += bool(older)
    assert found == COUNT


def test_old_letters_are_another_valid_identifier_on_paint_of_nearly_their_colour(pairs):
    seen = 0
    for pair in pairs:
        older = added(pair)
        present = next(d.text for d in pair[0].decals if any(p.role == "owner" for p in d.parts))
        for letters in (d for d in older if d.kind == "text"):
            spelled = {part.role: part.text for part in letters.parts}
            assert int(spelled["check"]) == check_digit(spelled["owner"] + spelled["serial"])
            assert letters.text != present
            patches = [d for d in older if d.art == "patch" and d.face == letters.face]
            assert any(np.abs(np.subtract(d.albedo, letters.albedo)).max() < 0.25 for d in patches)
            low, high = bounds(patches)
            inner_low, inner_high = bounds([letters])
            assert (low <= inner_low + 1).all()
            assert (inner_high - 1 <= high).all()
            seen += 1
    assert seen > COUNT / 2


def bounds(decals):
    center = np.array([d.center_mm for d in decals])
    half = np.array([d.size_mm for d in decals]) / 2
    return (center - half).min(axis=0), (center + half).max(axis=0)


def test_the_configured_share_of_containers_has_an_older_identifier():
    generator, share, count = Generator(config(0.3), seed=3), 0.3, 150
    without = Generator(config(0.0), seed=3)
    older = sum(len(generator.scene(i).decals) > len(without.scene(i).decals) for i in range(count))
    assert abs(older / count - share) < 4 * math.sqrt(share * (1 - share) / count)


def test_an_older_identifier_changes_colours_and_no_label(generators, pairs):
    generator = generators(config(1.0), seed=3, size=(320, 320))
    assert changed_pixels(generator, pairs[:3], ("B", "Cl", "Cr")) > 500


def test_near_is_as_far_as_one_cell_of_the_grid_reaches():
    assert DECAL_CELL_MM + 2 * MARGIN_MM == NEARBY_MM


def test_slots_count_the_decals_near_the_most_crowded_place():
    def at(x, y=500.0):
        return Decal("sticker", "", "front", (x, y), (100.0, 100.0), art="patch")

    pile = [at(500.0)] * (MOST_NEARBY - 1)
    assert has_slots([at(540.0)], pile)
    assert not has_slots([at(540.0), at(480.0)], pile)
    assert not has_slots([at(540.0)] * 2, pile)
    assert has_slots([at(540.0), at(2000.0)], pile)
    assert has_slots([at(500.0 + 100 + NEARBY_MM + 1)] * 2, pile)
    assert has_slots([at(1000.0)], [at(900.0 + 200 * i, 300.0 + 99 * i) for i in range(12)])
