"""Configurations, scenes, datasets and states that no program of ours wrote.

Each is accepted or refused with an error of the package that names the place. Nothing else may
escape, and nothing may take long.
"""

import pytest
import yaml

from fastgen import Config
from fastgen.config.yaml_values import LONGEST_FILE
from fastgen.errors import ConfigError

DOUBLED = "a0: &a0 [1, 2]\n" + "".join(f"a{i + 1}: &a{i + 1} [*a{i}, *a{i}]\n" for i in range(60))
"""Lists that each hold the one before twice: 2^60 values in 1.5 kB."""

MERGED = "m0: &m0 {k: 1}\n" + "".join(
    f"m{i + 1}: &m{i + 1} {{<<: [*m{i}, *m{i}]}}\n" for i in range(60)
)


def refused(text, folder):
    """Return the message about a configuration file with this text."""
    path = folder / "port.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    with pytest.raises(ConfigError) as caught:
        Config.load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    return message.removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("!!bool maybe", "'maybe' is not of the type bool"),
        ("!!timestamp soon", "'soon' is not of the type timestamp"),
        ("!!timestamp 2026-02-30", "'2026-02-30' is not of the type timestamp"),
        ("2026-01-01 00:00:00 +99:99", "+99:99' is not of the type timestamp"),
        ("!!binary é", "failed to convert base64"),
        ("!!int [1]", "expected a scalar node"),
        ("!!set [1]", "expected a mapping node"),
        ("!!python/name:os.system x", "could not determine a constructor"),
        ('"\\UFFFFFFFF"', "a character or version number is out of range"),
        ('"\\U00110000"', "a character or version number is out of range"),
        ("9" * 5000, "...9999999999999' has more characters than a number may"),
        ("1" + ":1" * 5000, "has more characters than a number may"),
        ("0x" + "f" * 4000, "has more characters than a number may"),
        ("0x" + "f" * 998, "a: unknown key"),
        ("0" + "7" * 998, "YAML reads '077"),
        ("0b" + "1" * 998, "a: unknown key"),
        ("0." + "3" * 5000, "has more characters than a number may"),
        ("[" * 50_000, "values are nested too deeply"),
        ("{a: " * 50_000, "values are nested too deeply"),
        ("- " * 50_000, "not a YAML file"),
    ],
    ids=lambda part: part[:20],
)
def test_values_that_yaml_cannot_read_are_refused_with_their_place(value, words, tmp_path):
    message = refused(f"a: {value}", tmp_path)
    assert words in message
    assert words == "a: unknown key" or "(line 1, column " in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"%YAML {'9' * 5000}.1\n---\na", "a character or version number is out of range"),
        (DOUBLED, "aliases repeat more than 200000 values"),
        (MERGED, "aliases repeat more than 200000 values"),
        (b"a: \xff", "not a YAML file ('utf-8' codec can't decode"),
        (f"? {'9' * 5000}\n: 1", "has more characters than a number may"),
        ("!!timestamp soon: 1", "'soon' is not of the type timestamp"),
        ("#" * (LONGEST_FILE + 1), f"more than the limit of {LONGEST_FILE:,}"),
    ],
    ids=lambda part: str(part[:12]),
)
def test_texts_that_yaml_cannot_read_are_refused(text, words, tmp_path):
    assert words in refused(text, tmp_path)


def test_a_file_of_the_longest_length_is_read(tmp_path):
    path = tmp_path / "port.yaml"
    path.write_text("damage: {probability: 0.5}".ljust(LONGEST_FILE, "#").replace("}#", "} #"))
    path.write_bytes(path.read_bytes()[:LONGEST_FILE])
    assert Config.load(path).damage.probability == 0.5


def test_no_long_number_is_computed(tmp_path, monkeypatch):
    """PyYAML takes quadratic time for numbers to base 60: 49 s for 400 kB."""
    lengths = []
    for name in ("construct_yaml_int", "construct_yaml_float"):
        original = getattr(yaml.SafeLoader, name)

        def recorded(loader, node, original=original):
            lengths.append(len(node.value))
            return original(loader, node)

        monkeypatch.setattr(yaml.SafeLoader, name, recorded)
    tails = ("", ".5")
    numbers = [f"1{':1' * count}{tail}" for count in (2, 2000, 200_000) for tail in tails]
    for number in (*numbers, "0x" + "f" * 200_000, "1" * 200_000 + ".5"):
        refused(f"damage: {{count: {number}}}", tmp_path)
    assert 0 < max(lengths) <= 1000
