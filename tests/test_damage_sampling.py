"""Sampled damages: kinds, forms, sizes and places."""

import math
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fastgen.classes import BUNDLED_DAMAGE_CLASSES, DAMAGE_CLASSES, DRAWN_DAMAGE_CLASSES
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.geometry import damage_law
from fastgen.geometry.container import build_container
from fastgen.sampling.damage import sample_damages
from fastgen.sampling.streams import stream, weighted_choice
from fastgen.scene import Scene
from fastgen.scene.check import check_scene
from fastgen.scene.container_kinds import KINDS
from tests.plain import FEW_DECALS

SEED = 7


@pytest.fixture(scope="module")
def many():
    generator = Generator(Config.from_values({"markings": FEW_DECALS}), seed=4)
    return [generator.scene(i) for i in range(600)]


def within(count, n, p):
    """Return whether `count` is within 4 binomial standard deviations; 1 in 16,000 runs is not."""
    return abs(count - n * p) < 4 * math.sqrt(n * p * (1 - p))


def test_two_scenes_in_five_are_damaged(many):
    assert within(sum(bool(scene.damages) for scene in many), len(many), 0.4)


def test_kinds_and_counts_are_uniform(many):
    kinds = [damage.kind for scene in many for damage in scene.damages]
    for kind in DAMAGE_CLASSES:
        assert within(kinds.count(kind), len(kinds), 0.25)
    counts = [len(scene.damages) for scene in many if scene.damages]
    for count in range(1, 5):
        assert within(counts.count(count), len(counts), 0.25)


def test_damage_stays_in_its_ranges_and_on_the_container(many):
    config = Config.preset().damage
    depths = {
        ("axis", "plain"): config.axis.depth_mm,
        ("axis", "kinked"): config.axis.kink_depth_mm,
        ("concave", "plain"): config.concave.depth_mm,
        ("concave", "creased"): config.concave.depth_mm,
        ("concave", "buckled"): config.concave.depth_mm,
        ("dented", "plain"): config.dented.depth_mm,
        ("dented", "ribs"): config.dented.marks.depth_mm,
        ("perforation", "plain"): config.perforation.depth_mm,
        ("perforation", "torn"): config.perforation.depth_mm,
    }
    for scene in many:
        for damage in scene.damages:
            ranges = depths[damage.kind, damage.form]
            assert ranges.lo <= abs(damage.depth_mm) <= ranges.hi
            assert abs(damage.origin_mm[0]) <= 13716 / 2
            assert abs(damage.origin_mm[1]) <= 2438 / 2
            assert 0 <= damage.origin_mm[2] <= 2896
            axes = np.array([damage.along, damage.across, damage.inward])
            np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-5)


def test_scenes_with_damage_round_trip_through_json(many):
    scene = next(scene for scene in many if len(scene.damages) > 2)
    assert Scene.from_json(scene.to_json()) == scene


@pytest.mark.parametrize("shares", [0.0, 1.0])
def test_damages_have_plain_numbers_alone(shares):
    """NumPy's numbers are floats as well, but not every writer of JSON accepts them."""
    axis = {"kinked": shares, "kinked_posts": shares, "leaning_posts": shares}
    gear = {"gasket": shares, "missing": shares, "open": shares}
    kinds = list(BUNDLED_DAMAGE_CLASSES)
    found = damages_of(kinds=kinds, count=[9, 9], axis=axis, door_gear=gear)
    assert {damage.kind for _, damage in found} == set(kinds)
    for _, damage in found:
        for value in vars(damage).values():
            values = value if isinstance(value, tuple) else (value,)
            assert {type(each) for each in values} <= {float, str}, damage


def test_a_hundred_damages_of_one_kind_are_refused():
    with pytest.raises(ConfigError, match=r"damage.count: 100 is out of range; give 0 to 99"):
        Config.from_values({"damage": {"count": [99, 100], "kinds": ["axis"]}})


def test_scrapes_that_would_reach_the_opposite_wall_are_refused():
    """The bound is the same in configurations and in scenes."""
    widest = {"damage": {"probability": 1, "kinds": ["scrape"], "scrape": {"contact_mm": 200}}}
    scene = Generator(Config.from_values(widest), seed=1).scene(0)
    assert check_scene(scene).damages[0].shape[2] == 200
    widest["damage"]["scrape"]["contact_mm"] = 201
    with pytest.raises(ConfigError, match=r"scrape.contact_mm: 201 is out of range; give 5 to 200"):
        Config.from_values(widest)
    (first, *_) = scene.damages
    deep = replace(first, shape=(*first.shape[:2], 201.0, *first.shape[3:]))
    words = (
        r"scene.damages\[0\].shape\[2\] \(depth behind the face up to which the sheet is scraped "
        r"in mm\): 201.0 is out of range; give 0.001 to 200"
    )
    with pytest.raises(ConfigError, match=words):
        check_scene(replace(scene, damages=(deep,)))


@pytest.mark.parametrize(
    "name",
    [
        *("axis.reach_mm", "axis.depth_mm", "concave.depth_mm", "dented.depth_mm"),
        *("dented.width_mm", "dented.amplitude_mm", "perforation.depth_mm"),
    ],
)
def test_sizes_beyond_the_container_width_are_refused(name):
    kind, key = name.split(".")
    inward = {"concave": {"outward": 0}}
    Config.from_values({"damage": inward | {kind: inward.get(kind, {}) | {key: 2400}}})
    with pytest.raises(ConfigError, match=rf"damage.{name}: 2438 is out of range; give \d to 2400"):
        Config.from_values({"damage": {kind: {key: 2438}}})


def test_displacements_of_damages_add_up_even_for_a_wide_crease(many):
    dents = [d for scene in many for d in scene.damages if (d.kind, d.form) == ("dented", "plain")][
        :4
    ]
    assert len(dents) == 4
    rng = np.random.default_rng(2)
    for dent in dents:
        wide = replace(dent, shape=(900.0, *dent.shape[1:]))
        points = np.array(dent.origin_mm) + rng.uniform(-1500, 1500, (3000, 3))
        moved = sum(
            damage_law.amount_mm(d, points)[:, None] * np.array(d.inward) for d in (wide, *dents)
        )
        assert np.abs(moved).max() > 5
        np.testing.assert_allclose(
            damage_law.deform((wide, *dents), points), points + moved, atol=1e-9
        )


def containers_of(scenes, /, **values):
    """Return the kinds and damages of the containers of the first scenes of a seed.

    Whole scenes have the same damages, but take ten times as long to sample.

    Args:
        scenes: Number of scenes.
        values: Values of the section `damage`.
    """
    config = Config.from_values({"damage": {"probability": 1, **values}})
    assert config.damage.toward_cameras == 0, "the damages depend on the cameras of the scene"
    found = []
    for index in range(scenes):
        streams = partial(stream, SEED, index)
        kind = weighted_choice(streams("kind"), config.container.kinds)
        damages = sample_damages(config.damage, KINDS[kind].size_mm, streams, lambda _: 1.0)
        found.append((kind, damages))
    return found


def test_scenes_have_the_damages_that_are_sampled_for_their_containers():
    values = {"kinds": list(DRAWN_DAMAGE_CLASSES), "scrape": {"beside": 0.5}}
    config = Config.from_values({"damage": {"probability": 1, **values}, "markings": FEW_DECALS})
    expected = [
        (scene.container.kind, scene.damages)
        for scene in map(Generator(config, seed=SEED).scene, range(20))
    ]
    assert containers_of(20, **values) == expected


def damages_of(**values):
    """Return container kinds and damages of 150 scenes with these values of `damage`."""
    return [(kind, d) for kind, damages in containers_of(150, **values) for d in damages]


@pytest.mark.parametrize(
    ("kind", "key", "form"),
    [
        ("axis", ("kinked",), "kinked"),
        ("concave", ("buckled",), "buckled"),
        ("concave", ("creased",), "creased"),
        ("dented", ("marks", "probability"), "ribs"),
        ("perforation", ("torn",), "torn"),
    ],
)
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_forms_have_their_configured_shares(kind, key, form, share):
    values = share
    for name in reversed(key):
        values = {name: values}
    others = {name: 0 for name in ("buckled", "creased") if kind == "concave"}
    forms = [damage.form for _, damage in damages_of(kinds=[kind], **{kind: others | values})]
    assert set(forms) <= {"plain", form}
    if 0 < share < 1:
        assert within(forms.count(form), len(forms), share)
    else:
        assert forms.count(form) == share * len(forms)


def test_scrapes_are_drawn_where_they_are_listed_alone_and_beside_dents():
    assert {d.kind for _, d in damages_of()} == set(DAMAGE_CLASSES)
    found = [d for _, d in damages_of(kinds=["scrape"])]
    assert {d.kind for d in found} == {"scrape"}
    both = [d for _, d in damages_of(kinds=list(DRAWN_DAMAGE_CLASSES), scrape={"beside": 0.5})]
    moved = sum(d.kind in ("concave", "dented") for d in both)
    drawn = sum(d.kind not in ("concave", "dented") for d in both)
    # of the kinds that are drawn, three in five bring none
    beside = drawn - 1.5 * moved
    assert abs(beside - 0.5 * moved) < 4 * math.sqrt(len(both))


def test_a_scrape_beside_a_dent_lies_across_it_or_touches_it():
    containers = containers_of(80, count=1, kinds=["dented", "scrape"], scrape={"beside": 1})
    dented = [damages for _, damages in containers if damages[0].kind == "dented"]
    assert len(dented) > 20
    for dent, scrape in dented:
        assert scrape.kind == "scrape"
        assert scrape.face == dent.face
        one, other = corners_of(dent), corners_of(scrape)
        gaps = one.min(axis=0) - other.max(axis=0), other.min(axis=0) - one.max(axis=0)
        assert np.max(gaps) < 1


def corners_of(damage):
    """Return the corners [4, 3] of the rectangle of a damage."""
    along, across = (
        0.5 * extent * np.array(axis)
        for extent, axis in zip(damage.size_mm, (damage.along, damage.across), strict=True)
    )
    sides = [along + across, along - across, across - along, -along - across]
    return np.array(damage.origin_mm) + sides


@pytest.mark.parametrize("turn_deg", [[-12, 12], [-180, 180], 90])
@pytest.mark.parametrize("size", [{}, {"length_mm": 20000, "width_mm": [5, 20000]}])
def test_scrapes_stay_within_the_frame_of_their_face(turn_deg, size):
    scrape = {"beside": 1, "turn_deg": turn_deg, **size}
    faces = ["front", "back", "door", "no_door", "roof"]
    found = damages_of(kinds=["concave", "dented", "scrape"], faces=faces, scrape=scrape)
    scrapes = [(KINDS[name], d) for name, d in found if d.kind == "scrape"]
    assert len(scrapes) > 200
    for kind, each in scrapes:
        half = np.array([kind.length_mm, kind.width_mm, kind.height_mm]) / 2
        away = np.abs(corners_of(each) - [0, 0, half[2]]).max(axis=0)
        # posts and rails are 190 mm wide, and the sheet is 15 mm behind the castings
        free = half - 190 - np.array([15, 15, 0])
        on_face = np.abs(each.inward) < 0.5
        assert (away <= free + 0.2)[on_face].all()
        assert min(each.size_mm) > 1


def yard(kinds, count, beside):
    """Return the damages of all ten containers of two scenes, which can be drawn."""
    damage = {"probability": 1, "count": count, "kinds": kinds, "scrape": {"beside": beside}}
    values = {
        "damage": {**damage, "toward_cameras": 0},  # which would take several times as long
        "placement": {"neighbours": 9, "damaged": 1},
        "markings": FEW_DECALS,
    }
    generator = Generator(Config.from_values(values, Config.preset("yard")), seed=2)
    for scene in (check_scene(generator.scene(index)) for index in (1, 4)):
        assert len(scene.neighbours) == 9
        yield [scene.damages, *(each.damages for each in scene.neighbours)]


@pytest.mark.parametrize("kind", ["axis", "dented", "scrape"])
def test_no_scene_has_more_damages_of_a_kind_than_masks_distinguish(kind):
    for first, *others in yard([kind], 99, 0):
        assert len(first) == 99
        assert not any(others)
    for found in yard([kind], 20, 0):
        assert [len(damages) for damages in found] == [20] * 4 + [19] + [0] * 5


@pytest.mark.parametrize("count", [20, 60, 99])
def test_scrapes_beside_dents_are_left_out_before_listed_damages(count):
    """Scrapes beside dents exceed the limit with 20 damages, and listed damages with 60."""
    kinds = list(DRAWN_DAMAGE_CLASSES)
    for both, alone in zip(yard(kinds, count, 1), yard(kinds, count, 0), strict=True):
        counts = Counter(d.kind for damages in both for d in damages)
        assert counts["scrape"] == 99
        assert max(counts.values()) == 99
        for more, fewer in zip(both, alone, strict=True):
            assert more[: len(fewer)] == fewer


def test_bulges_end_at_the_bottom_rail_where_the_configuration_says_so():
    outward = {"outward": 1.0, "at_bottom": 1.0}
    for _, damage in damages_of(kinds=["concave"], concave=outward):
        assert damage.depth_mm < 0
        length, width = damage.size_mm
        height = length * abs(damage.along[2]) + width * abs(damage.across[2])
        assert damage.origin_mm[2] - height / 2 == pytest.approx(190, abs=0.2)


def test_only_kinks_that_tilt_a_casting_move_one():
    """The outer edge of a tilted casting stays straight, and its end does not move."""
    values = {"count": [1, 1], "kinds": ["axis"]}
    for name, damage in damages_of(**values, axis={"tilted_castings": 0.0, "leaning_posts": 0.0}):
        assert not largest_move_of_castings(name, damage)
    posts = {"kinked": 1.0, "kinked_posts": 1.0, "leaning_posts": 0.0, "tilted_castings": 1.0}
    tilted = damages_of(**values, axis=posts)
    assert len(tilted) > 100
    for name, damage in tilted:
        assert largest_move_of_castings(name, damage) > 15
        height = KINDS[name].height_mm
        low = damage.origin_mm[2] < height / 2
        z = np.linspace(0, 110, 5) if low else height - np.linspace(0, 110, 5)
        edge = np.column_stack([np.tile(damage.origin_mm[:2], (5, 1)), z])
        move = damage_law.amount_mm(damage, edge)
        assert abs(move[0]) < 1
        np.testing.assert_allclose(move, np.linspace(0, move[-1], 5), atol=0.12 * move[-1])


def test_a_leaning_post_is_straight_from_one_end_to_its_deepest_point():
    posts = {"kinked": 1.0, "kinked_posts": 1.0, "leaning_posts": 1.0}
    leaning = damages_of(count=[1, 1], kinds=["axis"], axis=posts)
    assert len(leaning) > 100
    for name, damage in leaning:
        z = np.linspace(0, KINDS[name].height_mm, 201)
        line = np.column_stack([np.tile(damage.origin_mm[:2], (len(z), 1)), z])
        move = damage_law.amount_mm(damage, line)
        deepest = int(move.argmax())
        assert abs(move[0]) < 1
        assert abs(move[-1]) < 1
        assert move[deepest] > 0.85 * damage.depth_mm  # it is rounded
        assert 0.08 < deepest / 200 < 0.92
        assert abs(deepest / 200 - 0.5) > 0.08
        for part in (move[: deepest + 1], move[deepest:]):
            straight = np.linspace(part[0], part[-1], len(part))
            np.testing.assert_allclose(part, straight, atol=0.15 * damage.depth_mm)


def largest_move_of_castings(name, damage):
    mesh = build_container(name)
    charts = [i for i, chart in enumerate(mesh.charts) if chart.name.startswith("casting.")]
    return damage_law.amount_mm(damage, mesh.positions_mm[np.isin(mesh.chart, charts)]).max()


def test_holes_in_the_roof_are_near_its_castings():
    values = {"kinds": ["perforation"], "faces": ["roof"]}
    for name, damage in damages_of(**values, perforation={"at_castings": 1.0}):
        half = KINDS[name].length_mm / 2, KINDS[name].width_mm / 2
        gaps = [h - abs(x) for h, x in zip(half, damage.origin_mm, strict=False)]
        reach = math.hypot(*damage_law.reach_mm(damage)[:2])
        # a casting is 180 mm long and stands within the frame of 190 mm
        assert max(gaps) < 190 + 350 + reach + 20
    apart = [d for _, d in damages_of(**values, perforation={"at_castings": 0.0})]
    assert np.median([abs(d.origin_mm[0]) for d in apart]) < 5000


def test_splits_are_long():
    lengths = [
        damage.size_mm[0]
        for _, damage in damages_of(
            kinds=["perforation"],
            perforation={"torn": 1, "split": 1, "split_length_mm": [900, 1800]},
        )
    ]
    assert min(lengths) >= 900
    assert max(lengths) <= 1800
