"""Controls of `fastgen studio`, and what their values become: a configuration and a file."""

import json

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from fastgen import Config
from fastgen.config.assignments import changed
from fastgen.config.presets import PRESETS
from fastgen.config.schema import json_schema
from fastgen.studio.changes import as_file, bases, values_of
from fastgen.studio.controls import MOST_USED, controls


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(sorted(PRESETS)), st.sampled_from(sorted(PRESETS)))
def test_a_file_turns_any_preset_into_any_other(name, other):
    config = Config.preset(name)
    values = yaml.safe_load(as_file(config, other)) or {}
    made = Config.from_values(values, Config.preset(other))
    assert made.to_plain() == config.to_plain()
    assert list(made.cameras) == list(config.cameras)
    assert bool(values) == (name != other)


def test_a_users_file_comes_first_and_stays_in_the_copied_yaml(tmp_path):
    file = tmp_path / "port.yaml"
    file.write_text("cameras: {gate: {face: door, focal_mm: 35, distance_mm: 4000}}\n")
    offered = bases("crane", Config.load(file, Config.preset("crane")), str(file))
    assert list(offered) == [
        str(file),
        "crane",
        *sorted(set(PRESETS) - {"crane"}, key=list(PRESETS).index),
    ]
    base = offered[str(file)]
    config = changed(base.config, {"cameras.gate.focal_mm": 40})
    again = Config.from_values(yaml.safe_load(as_file(config, "crane")), Config.preset("crane"))
    assert again == config
    assert again.cameras["gate"].focal_mm == 40


def test_every_key_of_the_schema_has_one_control_with_its_limits():
    made = controls(Config.preset())
    by_key = {each["key"]: each for each in made}
    assert len(by_key) == len(made)
    assert {"surface.rust_coverage", "cameras.Cr.focal_mm", "sensor.noise.probability"} <= set(
        by_key
    )
    leaves = 0

    def walk(plain, path):
        nonlocal leaves
        if path in by_key:
            leaves += 1
        else:
            assert isinstance(plain, dict), path
            for name, value in plain.items():
                walk(value, f"{path}.{name}".lstrip("."))

    walk(Config.preset().to_plain(), "")
    assert leaves == len(made)
    assert all(each["help"] for each in made if not each["key"].startswith("container.profiles"))
    limits = json_schema()["$defs"]["CameraConfig"]["properties"]["focal_mm"]
    assert by_key["cameras.A.focal_mm"]["min"] == limits["minimum"]
    assert by_key["cameras.A.focal_mm"]["unit"] == "mm"


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_the_values_of_all_controls_are_accepted_and_change_nothing(preset):
    config = Config.preset(preset)
    texts = {
        each["key"]: each["value"] if each["kind"] == "yaml" else json.dumps(each["value"])
        for each in controls(config)
    }
    assert changed(config, values_of(texts)) == config


def test_sliders_cover_the_usual_values_and_stay_inside_the_limits():
    for each in controls(Config.preset("crane")):
        if "slider" in each:
            low, high, step = each["slider"]
            values = each["value"] if isinstance(each["value"], list) else [each["value"]]
            assert each["min"] <= low < high <= each["max"], each["key"]
            assert low <= min(values) <= max(values) <= high, each["key"]
            assert 0 < step <= high - low


def test_the_most_used_keys_exist():
    assert set(MOST_USED) <= {each["key"] for each in controls(Config.preset())}
