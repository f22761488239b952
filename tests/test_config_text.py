"""The complete configuration printed as commented YAML."""

import dataclasses
import shutil
import typing
from operator import attrgetter
from pathlib import Path

import pytest
import yaml

from fastgen.cli.main import main
from fastgen.config.commented_yaml import as_yaml, meanings
from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.errors import ConfigError
from fastgen.light.hdri import bundled_hdris

OWN = {
    "cameras": {"gate": {"face": "door", "focal_mm": 35, "distance_mm": 4000}},
    "surface": {"colors": {"no": "#102030", "schön": "#ffffff"}},
    "environment": {"names": ["1e3", "park"]},
    "weather": {"shutter_s": 1e-5},
}
"""Values that YAML misreads unless they are written carefully."""

CONFIGS = {**{name: Config.preset(name) for name in PRESETS}, "own": Config.from_values(OWN)}


@pytest.mark.parametrize("name", CONFIGS)
def test_printed_yaml_reads_back_as_the_same_config(name, tmp_path):
    text = as_yaml(CONFIGS[name])
    (tmp_path / "all.yaml").write_text(text, encoding="utf-8")
    assert Config.load(tmp_path / "all.yaml", Config.preset("crane")) == CONFIGS[name]
    assert yaml.safe_load(text) == CONFIGS[name].to_plain()  # as any other YAML reader would


def test_the_command_prints_a_preset_changed_by_a_file(tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text("damage: {probability: 0.75}")
    assert main(["config", "--preset", "crane", "--config", str(tmp_path / "mine.yaml")]) == 0
    printed = yaml.safe_load(capsys.readouterr().out)
    assert printed["damage"]["probability"] == 0.75
    assert printed["cameras"]["A"]["lens"]["model"] == "fisheye"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "cameras: {x: {face: door, focal_mm: 24, distance_mm: 5000, "
            "lens: {model: fisheye, k1: [-0.5, 0.1]}}}",
            "cameras.x.focal_mm: 24 mm is too short for this lens at 640x640; use at least",
        ),
        (
            "cameras: {x: {face: door, focal_mm: 3, distance_mm: 5000, lens: {k1: 0}}}",
            "cameras.x.focal_mm: 3 mm is too short for this lens at 640x640; use at least",
        ),
        ("environment: {names: [quay]}", "environment.names: HDRI 'quay' is not available"),
        (
            "environment: {names: [park], weights: {park: 0}}",
            "environment.weights: all weights are 0",
        ),
    ],
)
def test_the_command_refuses_a_file_that_a_run_would_refuse(tmp_path, capsys, text, words):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    assert main(["config", "--config", str(path)]) == 2
    said = capsys.readouterr()
    assert said.err.startswith(f"fastgen: {path}: {words}")
    assert said.out == ""


def test_environment_names_may_be_those_of_an_hdri_folder(tmp_path, capsys):
    shutil.copy(bundled_hdris()["sky"], tmp_path / "quay.exr")
    (tmp_path / "mine.yaml").write_text("environment: {names: [quay]}")
    shown = ["config", "--config", str(tmp_path / "mine.yaml"), "--hdri", str(tmp_path)]
    assert main(shown) == 0
    assert yaml.safe_load(capsys.readouterr().out)["environment"]["names"] == ["quay"]


def records(cls):
    """Yield a dataclass and all dataclasses in its fields, at any depth."""
    yield cls
    for hint in typing.get_type_hints(cls).values():
        for part in (hint, *typing.get_args(hint)):
            if dataclasses.is_dataclass(part):
                yield from records(part)


@pytest.mark.parametrize("cls", sorted(set(records(Config)), key=attrgetter("__name__")))
def test_every_key_is_explained(cls):
    about, words = meanings(cls)
    hints = typing.get_type_hints(cls)
    plain = {name for name, hint in hints.items() if not dataclasses.is_dataclass(hint)}
    assert about
    assert plain <= words.keys()
    assert "Raises" not in " ".join([about, *words.values()])


def test_printed_limits_are_the_enforced_limits():
    (line,) = (line for line in as_yaml(Config.preset()).splitlines() if "rust_scale_mm" in line)
    assert "range, 50 to 100000 mm" in line
    for value, good in ((50, True), (49.9, False), (1e5, True), (100001, False)):
        try:
            Config.from_values({"surface": {"rust_scale_mm": value}})
            taken = True
        except ConfigError:
            taken = False
        assert taken == good


def test_the_docs_page_shows_the_printed_config():
    page = Path("docs/configuration.md").read_text(encoding="utf-8")
    assert f"```yaml\n{as_yaml(Config.preset())}```\n" in page


def test_lines_of_the_printed_config_have_at_most_100_characters():
    for config in CONFIGS.values():
        assert max(map(len, as_yaml(config).splitlines())) <= 100
