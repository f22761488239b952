"""A configuration from presets, several files and single values."""

import pytest
import yaml

from fastgen.cli.main import main
from fastgen.config.assignments import assigned
from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.errors import ConfigError


def printed(capsys, *arguments):
    """Return what `fastgen config` prints, read by PyYAML."""
    assert main(["config", *map(str, arguments)]) == 0
    return yaml.safe_load(capsys.readouterr().out)


def test_of_several_files_each_changes_the_result_of_those_before_it(tmp_path, capsys):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text("damage: {probability: 0.1, count: 2}\nseals: {probability: 1}\n")
    second.write_text("damage: {probability: 0.2}\n")
    found = printed(capsys, "--config", first, "--config", second)
    assert (found["damage"]["probability"], found["damage"]["count"]) == (0.2, [2, 2])
    assert found["seals"]["probability"] == 1
    found = printed(capsys, "--config", second, "--config", first)
    assert found["damage"]["probability"] == 0.1


def test_a_single_value_wins_over_files_and_keeps_everything_else(tmp_path, capsys):
    path = tmp_path / "port.yaml"
    path.write_text("damage: {probability: 0.1}\n")
    before = printed(capsys, "--config", path)
    settings = ["damage.probability=0.8", "cameras.A.focal_mm=30", "container.kinds.20=0"]
    settings += ["cameras.A.lens.k1=[-0.1, 0]", "surface.colors.oxide red='#000001'"]
    found = printed(capsys, "--config", path, *(w for s in settings for w in ("--set", s)))
    before["damage"]["probability"] = 0.8
    before["cameras"]["A"]["focal_mm"] = 30
    before["container"]["kinds"]["20"] = 0
    before["surface"]["colors"]["oxide red"] = "#000001"
    lens = found["cameras"]["A"].pop("lens")
    assert before["cameras"]["A"].pop("lens") is None
    assert (lens["model"], lens["k1"], lens["k2"]) == ("brown_conrady", [-0.1, 0], [0, 0])
    assert found == before
    assert list(found["cameras"]) == ["A", "B", "Cl", "Cr"]  # the order decides image numbers


def test_a_table_as_value_inherits_as_in_a_file():
    given = "cameras={A: {focal_mm: 20}, new: {face: door, focal_mm: 30, distance_mm: 5000}}"
    text = given.partition("=")[2]
    assert assigned(Config.preset(), [given]) == Config.from_values(
        {"cameras": yaml.safe_load(text)}
    )


def test_the_last_of_equal_keys_wins():
    config = assigned(Config.preset(), ["damage.count=1", "damage.count=2"])
    assert config.damage.count == (2, 2)


def test_a_field_of_view_replaces_the_focal_length():
    config = assigned(Config.preset(), ["cameras.A.fov_deg=90"])
    assert config.cameras["A"].focal_mm == pytest.approx(18)  # of a sensor of 36 mm
    assert config.cameras["B"] == Config.preset().cameras["B"]


@pytest.mark.parametrize("turn", [1, -1])
def test_a_key_inside_of_another_is_refused(turn):
    texts = ["damage.count=1", "damage={}"][::turn]
    with pytest.raises(ConfigError, match=r"--set: damage\.count: damage is changed as a whole"):
        assigned(Config.preset(), texts)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("damage.probabilty=0.8", "--set: damage.probabilty: unknown key (did you mean prob"),
        ("damge.probability=0.8", "--set: damge: unknown key (did you mean damage?)"),
        ("damage.probability=8", "--set: damage.probability: 8 is out of range; give 0 to 1"),
        ("damage.probability.x=1", "--set: damage.probability: expected a number, got {'x': 1}"),
        ("damage.probability", "--set 'damage.probability': give a key and its value"),
        ("=1", "--set '=1': give a key and its value"),
        ("damage.kinds=[axis", "--set damage.kinds: the value is not YAML ("),
        ("cameras.Ad.focal_mm=20", "--set: cameras.Ad: missing face, distance_mm (did you mean A?"),
        ("cameras.new.focal_mm=20", "--set: cameras.new: missing face, distance_mm\n"),
        (
            "markings.markers={C3_1: {weight: 2}}",
            "--set: markings.markers.C3_1.art: is missing, and fastgen has no such marker (did you "
            "mean C3.1?)",
        ),
        (
            "preset=gate",
            "--set: preset: is allowed only in the first configuration",
        ),
    ],
)
def test_an_unusable_single_value_gets_one_line(text, words, capsys):
    assert main(["config", "--set", text]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"fastgen: {words}")
    assert said.count("\n") == 1


def test_an_unknown_key_has_the_same_message_in_a_file(tmp_path, capsys):
    path = tmp_path / "port.yaml"
    path.write_text("damage: {probabilty: 0.8}")
    messages = []
    for given in (["--config", str(path)], ["--set", "damage.probabilty=0.8"]):
        assert main(["config", *given]) == 2
        messages.append(capsys.readouterr().err.partition(": ")[2].partition(": ")[2])
    assert messages[0] == messages[1] != ""


def test_a_file_may_start_from_a_preset_or_from_another_file(tmp_path, capsys):
    (tmp_path / "inner").mkdir()
    gate, port = tmp_path / "inner" / "gate.yaml", tmp_path / "port.yaml"
    gate.write_text("preset: gate\ndamage: {probability: 0.1}\n")
    port.write_text("preset: inner/gate.yaml\ndamage: {count: 1}\n")
    changes = {"damage": {"probability": 0.1, "count": 1}}
    wanted = Config.from_values(changes, Config.preset("gate"))
    assert Config.load(port) == wanted
    assert Config.preset(str(port)) == wanted
    assert Config.from_values({"preset": str(gate), "damage": {"count": 1}}) == wanted
    assert printed(capsys, "--preset", port) == printed(capsys, "--config", port)


@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        ("preset: gat", [], "{port}: preset: 'gat' is unknown (did you mean gate?)"),
        ("preset: 5", [], "{port}: preset: 5 is unknown (choose from crane,"),
        ("preset: port.yaml", [], "{port}: {port}: preset: the file starts from itself"),
        ("preset: gone.yaml", [], "{port}: {gone}: cannot be read"),
        (
            "preset: gate",
            ["--preset", "yard"],
            "{port}: preset: is allowed only in the first configuration",
        ),
        (
            "preset: gate",
            ["--config", "{more}"],
            "{port}: preset: is allowed only in the first configuration",
        ),
    ],
)
def test_an_unusable_preset_gets_one_line(text, arguments, words, tmp_path, capsys):
    places = {name: str(tmp_path / f"{name}.yaml") for name in ("port", "gone", "more")}
    (tmp_path / "port.yaml").write_text(text)
    (tmp_path / "more.yaml").write_text("{}")
    given = [each.format(**places) for each in arguments]
    assert main(["config", *given, "--config", places["port"]]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"fastgen: {words.format(**places)}")
    assert said.count("\n") == 1


def test_the_command_lists_every_preset_with_a_line(capsys):
    assert main(["presets"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[: len(PRESETS)]] == list(PRESETS)
    assert all(len(line.split()) > 5 for line in lines)


def test_the_command_checks_the_lenses_at_the_size_of_the_run(capsys):
    wide = ["--set", "cameras.A.lens={model: fisheye, k1: 0}", "--set", "cameras.A.focal_mm=15.5"]
    assert main(["config", *wide, "--size", "640x360"]) == 0
    capsys.readouterr()
    assert main(["config", *wide, "--size", "640x1280"]) == 2
    assert "cameras.A.focal_mm: 15.5 mm is too short for this lens at 640x1280" in (
        capsys.readouterr().err
    )
