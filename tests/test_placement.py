"""Sampling of neighbours, props and the ground, and the configurations that allow no placement."""

import functools
import itertools
import math
from collections import Counter

import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.config.surroundings import ARRANGEMENTS
from fastgen.errors import ConfigError
from fastgen.sampling.contents import Contents, sample_contents
from fastgen.sampling.scene import sample_scene, without_container
from fastgen.sampling.streams import stream
from fastgen.scene import Scene
from fastgen.scene.check import check_scene
from fastgen.scene.container_kinds import KINDS

ENVIRONMENTS = {"sky": 1.0}
PLAIN = {
    "markings": {
        "marked_containers": 0,
        "stickers_per_face": 0,
        "brand": {},
        "main_text": {},
        "runs": 0,
    }
}
"""Few decals, which take most of the time."""

PLAIN_CONFIG = Config.from_values(PLAIN)


def config_of(arrangements, **values):
    if isinstance(arrangements, str):
        arrangements = {arrangements: 1}
    placement = {"arrangements": arrangements, **values.pop("placement", {})}
    return Config.from_values({**PLAIN, "placement": placement, **values})


def sampled(config, count, seed=3):
    return [sample_scene(config, seed, index, ENVIRONMENTS) for index in range(count)]


@functools.cache
def contents_of(kind):
    return sample_contents(PLAIN_CONFIG, kind, functools.partial(stream, 0, 0))


def places(config, count, seed=3):
    """Sample scenes in which all containers of a kind carry the same, which is much faster."""

    def same(config, kind, *_):
        return contents_of(kind)

    with pytest.MonkeyPatch.context() as patch:
        for module in ("scene", "neighbours"):
            patch.setattr(f"fastgen.sampling.{module}.sample_contents", same)
        return sampled(config, count, seed)


def solids(scene):
    """Yield size, position and yaw in degrees of each container."""
    yield KINDS[scene.container.kind].size_mm, (0.0, 0.0, 0.0), 0.0
    for each in scene.neighbours:
        yield KINDS[each.container.kind].size_mm, each.pose.position_mm, each.pose.yaw_deg


def local(points, position, yaw_deg):
    """Return world points in the frame of a body."""
    angle = math.radians(yaw_deg)
    x, y, z = (points - np.array(position)).T
    along = math.cos(angle) * x + math.sin(angle) * y
    return np.stack([along, math.cos(angle) * y - math.sin(angle) * x, z], axis=1)


def contains(solid, points, margin=0.0):
    """Return which world points are inside a container's box, enlarged by a margin in mm."""
    (length, width, height), position, yaw = solid
    x, y, z = local(points, position, yaw).T
    low, high = -margin, height + margin
    across = (abs(x) < length / 2 + margin) & (abs(y) < width / 2 + margin)
    return across & (z > low) & (z < high)


def filled(solid):
    """Return points in and on a container's box in the world, 100 mm apart or less near edges."""
    (length, width, height), position, yaw = solid
    inset = 0.05
    grids = [
        np.linspace(-length / 2 + inset, length / 2 - inset, 61),
        np.linspace(-width / 2 + inset, width / 2 - inset, 13),
        np.linspace(inset, height - inset, 13),
    ]
    x, y, z = (each.ravel() for each in np.meshgrid(*grids))
    angle = math.radians(yaw)
    turned = [math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x + math.cos(angle) * y]
    return np.stack([*turned, z], axis=1) + np.array(position)


@pytest.fixture(scope="module")
def mixed():
    """200 scenes of all arrangements."""
    kinds = {"20": 1, "40": 0.5, "40HC": 0.5, "45HC": 0.2}
    config = config_of(
        dict.fromkeys(ARRANGEMENTS, 1.0),
        placement={"neighbours": [0, 6], "yaw_deg": [-3, 3]},
        container={"kinds": kinds},
    )
    return places(config, 200)


def test_containers_never_overlap(mixed):
    touched = 0
    for scene in mixed:
        found = list(solids(scene))
        for i, one in enumerate(found):
            points = filled(one)
            for other in found[:i]:
                assert not contains(other, points).any()
                assert not contains(one, filled(other)).any()
            touched += len(found) > 1
    assert touched > 40


def test_cameras_are_outside_all_containers_and_above_the_ground(mixed):
    for scene in mixed:
        eyes = np.array([camera.position_mm for camera in scene.cameras])
        for number, solid in enumerate(solids(scene)):
            assert not contains(solid, eyes, 299.0 if number else 99.0).any()
        if scene.ground is not None:
            assert (eyes[:, 2] >= scene.ground.height_mm + 299.9).all()


def test_sampled_scenes_pass_the_check_and_read_back(mixed):
    for scene in mixed[::5]:
        assert check_scene(scene) == scene
        assert Scene.from_json(scene.to_json()) == scene


def arrangement_of(scene):
    """Return the arrangement as the scene shows it."""
    if scene.ground is None:
        return "alone"
    kinds = Counter(prop.shape for prop in scene.props)
    return "vehicle" if kinds else "ground"


def test_arrangements_occur_as_often_as_configured():
    weights = {"alone": 0.5, "trailer": 0.3, "standing": 0.2}
    found = Counter(map(arrangement_of, places(config_of(weights), 400)))
    for name, share in (("alone", 0.5), ("vehicle", 0.3), ("ground", 0.2)):
        assert abs(found[name] / 400 - share) < 4 * math.sqrt(share * (1 - share) / 400)


def test_by_default_a_scene_has_one_container_and_no_ground():
    for scene in sampled(Config.from_values(PLAIN), 5):
        assert (scene.neighbours, scene.ground, scene.props) == ((), None, ())


def test_the_first_container_is_the_same_in_every_arrangement():
    plain = sampled(Config.from_values(PLAIN), 3)
    for name in ARRANGEMENTS:
        if name == "twin":
            continue
        for scene, usual in zip(sampled(config_of(name), 3), plain, strict=True):
            for field in Contents._fields:
                assert getattr(scene, field) == getattr(usual, field)
            assert scene.environment == usual.environment


def test_a_neighbour_does_not_depend_on_how_many_there_are():
    few, many = (sampled(config_of("row", placement={"neighbours": count}), 6) for count in (1, 4))
    for one, other in zip(few, many, strict=True):
        assert set(one.neighbours) <= set(other.neighbours)
        assert len(one.neighbours) < len(other.neighbours)


def test_scenes_are_the_same_again():
    config = config_of({"stack": 1, "twin": 1}, container={"kinds": {"20": 1}})
    assert sampled(config, 4) == sampled(config, 4)


def test_piles_are_of_one_length_and_rest_on_the_ground():
    placement = {"neighbours": [5, 8], "tiers": [2, 4]}
    tiers = Counter()
    for scene in places(config_of("stack", placement=placement), 40):
        piles = {}
        for size, (x, y, z), _ in solids(scene):
            # containers of a pile are at most 40 mm apart
            key = next((k for k in piles if math.dist(k, (x, y)) < 100), (x, y))
            piles.setdefault(key, []).append((z, size))
        for pile in piles.values():
            pile.sort()
            assert len({size[0] for _, size in pile}) == 1
            assert pile[0][0] == pytest.approx(scene.ground.height_mm, abs=0.2)
            for (low, size), (high, _) in itertools.pairwise(pile):
                assert high - low - size[2] == pytest.approx(25, abs=0.2)
        tiers[len(piles[(0.0, 0.0)])] += 1
    assert set(tiers) >= {2, 3, 4}


def test_nothing_is_on_top_of_a_held_container():
    config = config_of("stack", spreader={"probability": 1}, placement={"neighbours": [3, 6]})
    below = 0
    for scene in places(config, 30):
        assert scene.spreader.present
        column = [n for n in scene.neighbours if math.hypot(*n.pose.position_mm[:2]) < 100]
        assert all(n.pose.position_mm[2] < 0 for n in column)
        below += len(column)
    assert below


def test_twins_are_end_to_end_and_show_their_doors_at_the_same_end():
    config = config_of("twin", container={"kinds": {"20": 1}}, spreader={"probability": 1})
    for scene in places(config, 20):
        twin = scene.neighbours[0]
        assert abs(twin.pose.position_mm[0]) == 6058 + 76
        assert (twin.container.kind, twin.pose.yaw_deg) == ("20", 0)
        assert not scene.spreader.present
        joint = math.copysign(1, twin.pose.position_mm[0])
        for camera in scene.cameras:
            if camera.name in ("Cl", "Cr"):
                at_joint = (camera.name == "Cr") == (joint > 0)
                assert (abs(camera.target_mm[0]) > 6058) == at_joint


def test_kinds_other_than_20_are_never_twins():
    scenes = places(config_of({"twin": 1, "standing": 1}), 60)
    for scene in scenes:
        assert not scene.neighbours or scene.container.kind == "20"
    assert any(scene.neighbours for scene in scenes)


def test_neighbours_have_the_configured_share_of_damage_and_paint():
    placement = {"neighbours": [4, 6], "damaged": 0.5, "same_paint": 0.4, "turned": 0.25}
    config = config_of("row", placement=placement, damage={"probability": 1})
    scenes = sampled(config, 60)
    pairs = [(scene, each) for scene in scenes for each in scene.neighbours]
    count = len(pairs)

    def near(found, share):
        return abs(found / count - share) < 4 * math.sqrt(share * (1 - share) / count)

    assert all(scene.damages for scene in scenes)
    assert near(sum(bool(each.damages) for _, each in pairs), 0.5)
    chance = 0.4 + 0.6 / len(config.surface.colors)
    same = sum(each.surface.paint.name == scene.surface.paint.name for scene, each in pairs)
    assert near(same, chance)
    assert near(sum(math.cos(math.radians(each.pose.yaw_deg)) < 0 for _, each in pairs), 0.25)


def test_lifted_containers_are_as_high_as_configured_and_above_their_cameras():
    config = config_of("lifted", placement={"lift_mm": [4000, 5000]})
    for scene in places(config, 20):
        assert -5000 <= scene.ground.height_mm <= -4000
    rig = {"below": {"face": "underside", "focal_mm": 20, "distance_mm": 9000}}
    for scene in places(config_of("lifted", cameras=rig), 5):
        assert scene.ground.height_mm <= scene.cameras[0].position_mm[2] - 300


def test_wet_containers_stand_on_wet_ground():
    weather = {"rain_probability": 1, "wetness": 0.8}
    for scene in sampled(config_of("standing", weather=weather), 10):
        assert scene.ground.wetness >= scene.weather.wetness == 0.8


def test_the_ground_has_the_configured_kinds_and_lines():
    config = config_of("standing", ground={"kinds": {"asphalt": 1, "paving": 3}})
    grounds = [scene.ground for scene in places(config, 200)]
    kinds = Counter(ground.kind for ground in grounds)
    assert set(kinds) == {"asphalt", "paving"}
    assert abs(kinds["paving"] / 200 - 0.75) < 4 * math.sqrt(0.75 * 0.25 / 200)
    lined = sum(ground.lines > 0 for ground in grounds)
    assert abs(lined / 200 - 0.5) < 4 * math.sqrt(0.25 / 200)
    for ground in grounds:
        low, high = config.ground.albedo(ground.kind)
        assert 0.93 * low <= min(ground.albedo) <= max(ground.albedo) <= 1.07 * high


def test_a_scene_without_its_container_keeps_the_ground():
    (scene,) = sampled(config_of("trailer"), 1)
    bare = without_container(scene)
    assert bare.ground == scene.ground
    assert (bare.neighbours, bare.props) == ((), ())
    assert check_scene(bare) == bare


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            {"placement": {"arrangements": {"twin": 1}}},
            "placement.arrangements: only twin has a weight.* take 40, 40HC, 45HC out of",
        ),
        ({"placement": {"arrangements": {"heap": 1}}}, "placement.arrangements: 'heap' is unknown"),
        ({"placement": {"neighbours": 16}}, "placement.neighbours: 16 is out of range"),
        ({"ground": {"kinds": {"asphalt": 0}}}, "ground.kinds: all weights are 0"),
        (
            {
                "placement": {"arrangements": {"row": 1, "lifted": 1}},
                "cameras": {"u": {"face": "underside", "focal_mm": 20, "distance_mm": 9000}},
            },
            "cameras.u.face: a camera that sees the underside is not .* placement.arrangements row",
        ),
        (
            {
                "placement": {"arrangements": {"row": 1}},
                "cameras": {
                    "u": {
                        "face": "front",
                        "focal_mm": 20,
                        "distance_mm": 4000,
                        "elevation_deg": [-88, 0],
                    }
                },
            },
            "cameras.u.elevation_deg: the camera may have to be raised",
        ),
    ],
)
def test_impossible_placements_are_refused(values, words):
    with pytest.raises(ConfigError, match=f"^{words}"):
        Config.from_values(values)
