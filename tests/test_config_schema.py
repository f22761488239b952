"""JSON Schema of configuration files, read by an independent validator."""

import json

import pytest
import yaml
from jsonschema import Draft202012Validator

from fastgen.cli.main import main
from fastgen.config.commented_yaml import as_yaml, meanings
from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.config.schema import json_schema
from fastgen.config.sensor import LensConfig
from fastgen.errors import ConfigError
from fastgen.scene.faces import FACES
from fastgen.scene.limits import CORNERS

VALIDATOR = Draft202012Validator(json_schema())


def definition(name):
    """Return the properties of a class in the schema."""
    return VALIDATOR.schema["$defs"][name]["properties"]


def test_the_schema_is_valid():
    Draft202012Validator.check_schema(VALIDATOR.schema)
    assert VALIDATOR.schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"


def test_the_command_prints_the_schema(capsys):
    assert main(["config", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out) == VALIDATOR.schema


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_accepted(preset):
    VALIDATOR.validate(yaml.safe_load(as_yaml(Config.preset(preset))))


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        "damage: {count: 3}",
        "damage: {kinds: [axis], faces: []}",
        "cameras: {A: {}}",
        "cameras: {A: {lens: {k1: [-0.2, 0]}}, B: {lens: null}}",
        "cameras: {gate-1: {face: underside, focal_mm: 35, distance_mm: [4000, 5000]}}",
        "surface: {dirt_color: '102030', colors: {any name: '#ABCDEF'}}",
        "labels: {min_visible_px: 5.0}",
        "container: {kinds: {'20': 1}, profiles: {side: {depth_mm: 30}}}",
        "weather: {shutter_s: 0.001}",
    ],
)
def test_values_that_config_accepts_are_accepted(text):
    data = yaml.safe_load(text)
    Config.from_values(data)
    VALIDATOR.validate(data)


@pytest.mark.parametrize(
    "text",
    [
        "damge: {}",
        "damage: {cuont: 3}",
        "damage: null",
        "damage: {probability: 1.5}",
        "damage: {probability: '0.5'}",
        "damage: {probability: true}",
        "damage: {count: [1, 100]}",
        "damage: {count: 2.5}",
        "damage: {count: [1, 2, 3]}",
        "damage: {count: [1]}",
        "damage: {kinds: dented}",
        "damage: {kinds: [dent]}",
        "damage: {axis: {length_mm: [1, 700]}}",
        "markings: {brand: {lid: 1}}",
        "markings: {marker_faces: [underside]}",
        "container: {kinds: {'30': 1}}",
        "container: {depth_scale: []}",
        "container: {depth_scale: 1.0}",
        "container: {profiles: {side: {depth_mm: 121}}}",
        "cameras: {}",
        "cameras: {A: {face: lid}}",
        "cameras: {A: {lens: {model: pinhole}}}",
        "cameras: {A: {lens: {k9: 0}}}",
        "cameras: {a b: {face: door, focal_mm: 24, distance_mm: 5000}}",
        "surface: {dirt_color: red}",
        "surface: {dirt_color: 102030}",
        "surface: {colors: {}}",
        "surface: {rust_colors: ['#12345']}",
        "sensor: {stamp: {corners: [middle]}}",
        "spreader: {gap_mm: 201}",
    ],
)
def test_values_that_config_refuses_are_refused(text):
    data = yaml.safe_load(text)
    with pytest.raises(ConfigError):
        Config.from_values(data)
    assert not VALIDATOR.is_valid(data)


def test_fields_have_descriptions_units_limits_and_choices():
    gap = definition("SpreaderConfig")["gap_mm"]
    assert gap["description"].endswith("within the range. Unit: mm.")
    one, both = gap["oneOf"]
    assert (one["minimum"], one["maximum"]) == (0, 200)
    assert both["prefixItems"] == [one, one]
    assert definition("CameraConfig")["face"]["enum"] == list(FACES)
    assert definition("StampConfig")["corners"]["items"]["enum"] == list(CORNERS)
    for name, words in meanings(LensConfig)[1].items():
        assert definition("LensConfig")[name]["description"] == words


def test_every_key_is_described_and_optional():
    definitions = VALIDATOR.schema["$defs"]
    for part in (VALIDATOR.schema, *definitions.values()):
        assert part["description"]
        assert part["additionalProperties"] is False
        assert "required" not in part
        for name, field in part["properties"].items():
            assert field.get("description") or "$ref" in field, name
