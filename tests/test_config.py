"""Any configuration gives either scenes that can be rendered or one error that names the key."""

import dataclasses
import json
import math
import typing
from functools import partial

import numpy as np
import pytest

from fastgen.config.cameras import CameraConfig
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.geometry.damage_law import deform
from fastgen.sampling.contents import sample_contents
from fastgen.sampling.coverage import possible_shapes
from fastgen.sampling.scene import environment_weights, sample_scene
from fastgen.sampling.streams import stream
from fastgen.validation import Bounds, annotation
from tests.plain import FEW_DECALS

NASTY: tuple[typing.Any, ...] = (
    *(
        math.nan,
        math.inf,
        -math.inf,
        1e300,
        10**400,
        -1,
        0,
        -0.0,
        0.5,
        None,
        True,
        "",
        "x",
        "#+1+2+3",
    ),
    *([], [[]], [None], ["a", "b"], [1, 2, 3], [2, 1], [0, -0.0], [math.nan, 1], [1, math.inf]),
    [-1e9, 1e9],
    *({}, {"": 1}, {1: 2}, {"a": None}, {"a": {}}, {"front": math.nan}),
)

MUCH = {
    "damage": {"probability": 1, "count": [4, 4]},
    "markings": {"markers_per_face": [1, 3], "stickers_per_face": [0, 2]},
}
"""Changes to the preset that make every scene use nearly every field."""


def keys(value, path=()):
    """Yield the path of every key of nested mappings, including inner nodes."""
    for key, item in value.items():
        yield (*path, key)
        if isinstance(item, dict):
            yield from keys(item, (*path, key))


def nested(path, value):
    for key in reversed(path):
        value = {key: value}
    return value


def sampled(config, count=2):
    """Sample scenes and check that all their numbers are finite, before and after damage."""
    for index in range(count):
        scene = sample_scene(config, 1, index, {"x": 1.0})
        json.dumps(dataclasses.asdict(scene), allow_nan=False)
        places = [damage.origin_mm for damage in scene.damages]
        assert all(math.isfinite(v) for place in places for v in deform(scene.damages, place))


@pytest.mark.parametrize("path", list(keys(Config.preset().to_plain())), ids=".".join)
def test_any_value_is_either_sampled_or_refused_by_its_key(path):
    base = Config.from_values(MUCH)
    for value in NASTY:
        try:
            config = Config.from_values(nested(path, value), base)
        except ConfigError as error:
            message = str(error)
            named = message.split(":")[0]
            assert named.split("[")[0].startswith(path[0]), message
            assert len(message) < 800  # the longest lists all stickers
            assert "\n" not in message
            # a value may conflict with another field of its group; the error then names that one
            assert named.startswith((".".join(path), ".".join(path[:-1]))), message
            continue
        if path != ("environment", "names"):  # the available names are known only at sampling
            sampled(config)


def limits(cls, path=()):
    """Yield path and bounds of the numbers in a dataclass and its parts, except in mappings."""
    for name, hint in typing.get_type_hints(cls, include_extras=True).items():
        plain = typing.get_args(hint)[0] if typing.get_origin(hint) is typing.Annotated else hint
        if dataclasses.is_dataclass(hint):
            yield from limits(hint, (*path, name))
        elif typing.get_origin(plain) is not dict and (bounds := annotation(Bounds, hint)):
            yield (*path, name), bounds


BOUNDED = {
    path: bounds
    for path, bounds in (*limits(Config), *limits(CameraConfig, ("cameras", "A")))
    if "profiles" not in path  # the widths of a wave must add up to its pitch
    # 0 needs a marker or a brand of the user
    and path[-1] not in ("other_marker_weight", "bundled_brand_weight")
}


@pytest.mark.parametrize(
    ("path", "bounds"), BOUNDED.items(), ids=[".".join(path) for path in BOUNDED]
)
def test_the_limits_of_every_field_can_be_sampled(path, bounds):
    base = Config.from_values(MUCH)
    for given in (bounds.lo, bounds.hi):
        if path == ("container", "depth_scale"):
            given = [0.2, 2.6]  # 2.6 * 46 mm is just below the deepest wave allowed
        if path[-1] == "principal_point":
            given = [given, given]
        if path[-1] in ("depth_mm", "distance_mm"):  # bulges could come too close to a camera
            base = Config.from_values({"damage": {"concave": {"outward": 0}}}, base)
        if path[-1] in ("azimuth_deg", "elevation_deg"):  # far enough for any angle
            base = Config.from_values({"cameras": {"A": {"distance_mm": 9000}}}, base)
        sampled(Config.from_values(nested(path, given), base), 1)


def test_errors_in_a_file_name_the_file(tmp_path):
    for text, words in (
        (
            "damage: {kinds: [dent]}",
            r"damage.kinds\[0\]: 'dent' is unknown \(did you mean dented",
        ),
        ("damage: {faces: [lid]}", r"damage.faces\[0\]: 'lid' is unknown"),
        ("damage: {faces: []}", "damage.faces: the list is empty"),
        ("markings: {fonts: [comic]}", "markings.fonts: 'comic' is unknown"),
        ("markings: {brand: {lid: 1}}", "markings.brand: 'lid' is unknown"),
        ("container: {depth_scale: [1, 3]}", r"container.depth_scale\[1\]: 3 times end.depth_mm"),
        (
            "container: {profiles: {side: {slope_mm: 1}}}",
            "container.profiles.side.pitch_mm: 278 is",
        ),
        (
            "damage: {count: a}",
            r"damage.count: expected \[lowest, highest\] or one number, got 'a'",
        ),
        ("damage: {count: 2.5}", "damage.count: expected a whole number, got 2.5"),
        ("damage:\n", "damage: expected a mapping of fields, got None; remove the key"),
        ("markings: {marker_faces: [door, door]}", "markings.marker_faces: a value is given twice"),
        ("damage: {kinds: [axis, axis]}", "damage.kinds: a value is given twice"),
        ("damage: {faces: [roof, door, roof]}", "damage.faces: a value is given twice"),
        (
            "cameras: {a: {face: front, focal_mm: 12, distance_mm: 5000}, A: {}}",
            "cameras.A: its files would be those of a on disks",
        ),
        ("cameras: {A: {target_shift_mm: 20000}}", "cameras.A.target_shift_mm: 20000 is out"),
        ("damage: {kinds: dented}", r"damage.kinds: .* got 'dented'; write \['dented'\]"),
        ("markings: {marker_side_mm: 20}", "markings.marker_side_mm: 20 is out of range"),
        ("damage: {}\nlabels: {}\ndamage: {}", ".*'damage' is given twice .*.line 3, column 1."),
        ('{"split": {"val": 1, "val": 0}}', ".*'val' is given twice"),
        ("cameras: {0x8: {face: front}, 8: {face: back}}", ".*'8' is given twice"),
        ("cameras: {010: {face: front}}", ".*YAML reads '010' as 8; write that, or put it in"),
        ("damage: {count: -0_17}", ".*YAML reads '-0_17' as -15; .* .line 1, column 17."),
        ("damage: {count: 1:30}", ".*YAML reads '1:30' as 90; write that"),
        ("damage: {count: 0200000001}", ".*as 33554433; write that"),
        (f"damage: {{count: 0{'7' * 400}}}", ".*YAML reads '0777.*7' as "),
        (f"weather: {{wind: {'1:' + '30:' * 250}30.5}}", ".*is not a number"),
        ("damage: {count: !!int ''}", ".*'' is not a number"),
        ("weather: {wind: 1:30.5}", ".*YAML reads '1:30.5' as 90.5; write that"),
        ("weather: {shutter_s: ['1e-3', 0.1]}", "weather.shutter_s.* write 0.001 without quotes"),
        ("cameras: {no: {face: front}}", "cameras: expected a name, got False; put it in quotes"),
    ):
        path = tmp_path / "port.yaml"
        path.write_text(text)
        with pytest.raises(ConfigError, match=f"{path}: {words}"):
            Config.load(path)


@pytest.mark.parametrize("base", ["crane", {}])
def test_a_base_that_is_not_a_config_is_refused(base, tmp_path):
    path = tmp_path / "port.yaml"
    path.write_text("damage: {probability: 0.5}")
    with pytest.raises(ConfigError, match=r"base: .* is not a Config; take one from Config.preset"):
        Config.from_values({}, base)
    with pytest.raises(ConfigError, match=r"base: .* is not a Config"):
        Config.load(path, base)


def test_cameras_may_share_values_through_a_yaml_anchor(tmp_path):
    path = tmp_path / "port.yaml"
    shared = "{face: front, focal_mm: 12, distance_mm: 5000}"
    path.write_text(f"cameras:\n  gantry: &shared {shared}\n  gate: {{<<: *shared, focal_mm: 35}}")
    rig = Config.load(path).cameras
    assert (rig["gantry"].focal_mm, rig["gate"].focal_mm) == (12, 35)
    assert rig["gate"].distance_mm == rig["gantry"].distance_mm


def test_possible_shapes_are_exactly_those_of_sampled_scenes(monkeypatch):
    # decals take most of the time, and containers and spreaders have random streams of their own
    for part in ("decals", "runs", "repairs", "chalk"):
        monkeypatch.setattr(f"fastgen.sampling.contents.sample_{part}", lambda *_: [])
    config = Config.from_values(
        {
            "spreader": {"gap_mm": [12, 34], "probability": 0.8},
            "container": {"kinds": {"20": 1}},
        }
    )
    environments = {"park": 1.0}

    def shape(container, spreader):
        held = (spreader.flippers_down, spreader.gap_mm) if spreader.present else None
        return container, held

    possible = {shape(*pair) for pair in possible_shapes(config)}
    scenes = [sample_scene(config, 5, index, environments) for index in range(800)]
    assert {shape(scene.container, scene.spreader) for scene in scenes} == possible


def test_weights_of_hdris_replace_those_that_are_usual(monkeypatch):
    environments = {"park": 1.0, "sky": 2.5, "workshop": 0.0}
    weights = {"weights": {"workshop": 3, "sky": 0, "far": 9}}
    config = Config.from_values({"environment": weights, "markings": FEW_DECALS})
    # decals take most of the time, and the environment has a random stream of its own
    container = sample_contents(config, "20", partial(stream, 5, 0))
    monkeypatch.setattr("fastgen.sampling.scene.sample_contents", lambda *_: container)
    names = [sample_scene(config, 5, index, environments).environment.name for index in range(400)]
    assert set(names) == {"park", "workshop"}
    assert 0.68 < names.count("workshop") / len(names) < 0.82
    named = Config.from_values({"environment": {"names": ["park", "sky"], "weights": {"sky": 3}}})
    assert environment_weights(named, environments) == {"park": 1.0, "sky": 3}


@pytest.mark.parametrize("number", ["1e-05", "1E-3", "2.5e-4", "1.0e-05", ".5e-3", "+1e-4"])
def test_numbers_with_exponents_are_read_as_numbers(tmp_path, number):
    path = tmp_path / "weather.yaml"
    path.write_text(f"weather: {{shutter_s: [{number}, 1e-1]}}")
    assert Config.load(path).weather.shutter_s == (float(number), 0.1)


def test_other_notations_of_whole_numbers_are_read_correctly(tmp_path):
    path = tmp_path / "port.yaml"
    for text in ("12", "+12", "1_2", "0xC", "0b1100", "0xc"):
        path.write_text(f"damage: {{count: [0, {text}]}}")
        assert Config.load(path).damage.count == (0, 12)


def test_one_number_sets_both_ends_of_a_range():
    assert Config.from_values({"damage": {"count": 3}}).damage.count == (3, 3)


@pytest.mark.parametrize("escaped", [True, False])
def test_names_may_use_any_script(escaped, tmp_path):
    """JSON escapes characters beyond U+FFFF as surrogate pairs (RFC 8259, section 7)."""
    colors = {"Gr\u00f6\u00dfe \U0001f6a2": "#ff0000"}
    path = tmp_path / "port.json"
    text = json.dumps({"surface": {"colors": colors}}, ensure_ascii=escaped)
    path.write_text(text, encoding="utf-8")
    assert Config.load(path).surface.colors == colors


def test_a_lone_surrogate_is_refused(tmp_path):
    path = tmp_path / "port.json"
    path.write_text('{"surface": {"colors": {"\\ud83d": "#ff0000"}}}')
    with pytest.raises(ConfigError, match=r"not a YAML file .*half of a surrogate pair"):
        Config.load(path)


def test_a_config_can_be_written_to_json_and_read_back(tmp_path):
    config = Config.from_values({"weather": {"shutter_s": [1e-5, 1e-3]}}, Config.preset("crane"))
    path = tmp_path / "config.json"
    path.write_text(json.dumps(config.to_plain()))
    assert Config.load(path) == config


def test_numpy_numbers_and_arrays_are_accepted():
    values = {"damage": {"probability": np.float32(0.5), "count": np.int64(2)}}
    config = Config.from_values(values)
    assert config.damage.probability == 0.5
    assert type(config.damage.probability) is float
    assert config.damage.count == (2, 2)
    arrays = {"container": {"depth_scale": np.array([1.0, 1.1])}}
    arrays["surface"] = {"rust_coverage": np.array([0.1, 0.2])}
    config = Config.from_values(arrays | {"damage": {"kinds": np.array(["dented"])}})
    assert config.container.depth_scale == (1.0, 1.1)
    assert config.surface.rust_coverage == (0.1, 0.2)
    assert config.damage.kinds == ("dented",)


def test_a_color_that_yaml_read_as_a_comment_is_explained(tmp_path):
    file = tmp_path / "rig.yaml"
    file.write_text("surface:\n  dirt_color: #332211\n")
    with pytest.raises(ConfigError, match=r"surface\.dirt_color: .* began with #, quote it"):
        Config.load(file)
    file.write_text("surface: {rust_colors: [#332211, #112233]}\n")
    with pytest.raises(ConfigError, match="put colors in quotes, as in '#332211'"):
        Config.load(file)
    file.write_text("surface: {dirt_color: 332211}\n")
    with pytest.raises(ConfigError, match=r"dirt_color: .* got 332211; put it in quotes"):
        Config.load(file)


def test_a_yaw_range_through_360_degrees_is_explained():
    with pytest.raises(ConfigError, match=r"yaw_deg: .* swap them, or write \[-10, 10\]"):
        Config.from_values({"environment": {"yaw_deg": [350, 10]}})
