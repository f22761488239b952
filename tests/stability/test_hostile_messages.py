"""Messages about hostile input: one short line that a terminal shows as it is."""

import json
import unicodedata

import pytest

from fastgen import Config
from fastgen.cli.main import main
from fastgen.errors import AssetError, ConfigError, OutputError
from fastgen.light.hdri import hdris_by_name
from fastgen.scene import Scene
from fastgen.validation import check_known, whole

RED = "\x1b[31m"
REVERSED = "\u202e"
"""Right-to-left override: the text after it is shown in reverse."""

STRANGE = [f"a{RED}b", f"a{REVERSED}b", "a\x00b", "a\x07b", "a\x9b31mb", "a\nb", "a\rb", "a\u2028b"]


def assert_printable(text):
    kinds = {unicodedata.category(character) for character in text}
    assert not kinds & {"Cc", "Cf", "Cs", "Zl", "Zp"}, repr(text)


def refusals(text, folder):
    """Yield functions that each refuse a text: as a key, as a value or as the name of a file."""
    yield lambda: Config.from_values({text: 1})
    yield lambda: Config.from_values({"damage": {text: 1}})
    yield lambda: Config.from_values({"cameras": {text: {}}})
    yield lambda: Config.from_values({"damage": {"kinds": [text]}})
    yield lambda: Config.from_values({"damage": {"kinds": text}})
    yield lambda: Config.from_values({"surface": {"colors": {text: "red"}}})
    yield lambda: Config.from_values({"environment": {"weights": {text: -1}}})
    yield lambda: Config.load(folder / text)
    yield lambda: Config.preset(text)
    yield lambda: Scene.from_json(json.dumps({"scene": {text: 1}}))
    yield lambda: check_known("task", "imdg", [text])
    yield lambda: whole("seed", text)


@pytest.mark.parametrize("text", STRANGE, ids=ascii)
def test_control_characters_are_shown_escaped(text, tmp_path):
    for refuse in refusals(text, tmp_path):
        with pytest.raises(ConfigError) as caught:
            refuse()
        assert_printable(str(caught.value))


@pytest.mark.parametrize("length", [1000, 100_000])
def test_long_values_and_keys_are_cut(length, tmp_path):
    for refuse in refusals("long " * (length // 5), tmp_path):
        with pytest.raises(ConfigError) as caught:
            refuse()
        assert len(str(caught.value)) < 8000
    with pytest.raises(ConfigError) as caught:
        Config.from_values({"damage": {"k" * length: 1}})
    assert len(str(caught.value)) < 300


def test_the_end_of_a_long_message_says_what_to_do():
    message = str(OutputError("x" * 100_000 + ": make it shorter"))
    assert message.startswith("xxx")
    assert message.endswith("xxx: make it shorter")
    assert len(message) < 5000


@pytest.mark.parametrize("number", [10**4200, 1 << 40_000, -(1 << 40_000)], ids=["4k", "12k", "-"])
def test_numbers_with_more_digits_than_python_writes_are_refused(number):
    for path in ("damage.count", "damage.probability", "damage.kinds", "surface.dirt_color"):
        section, key = path.split(".")
        with pytest.raises(ConfigError, match=rf"^{path}"):
            Config.from_values({section: {key: number}})
    with pytest.raises(ConfigError, match=r"^seed: "):
        whole("seed", number)
    with pytest.raises(ConfigError, match=r"^task: "):
        check_known("task", number, ["imdg"])


def test_names_of_files_are_shown_escaped(tmp_path):
    for suffix in (".hdr", ".exr"):
        (tmp_path / f"night{RED}{suffix}").write_bytes(b"")
    with pytest.raises(AssetError) as caught:
        hdris_by_name(tmp_path)
    assert_printable(str(caught.value))
    assert "night\\x1b[31m.hdr" in str(caught.value)


@pytest.mark.parametrize("text", STRANGE, ids=ascii)
@pytest.mark.parametrize(
    "arguments",
    [
        ["verify", "{}"],
        ["stats", "{}"],
        ["generate", "x", "--images", "{}"],
        ["generate", "x", "--images", "1", "--split", "{}"],
        ["show", "--index", "0", "--size", "{}", "-o", "x.png"],
        ["show", "--index", "0", "-o", "{}"],
        ["config", "--config", "{}"],
        ["{}"],
        ["config", "--{}"],
    ],
    ids=" ".join,
)
def test_the_command_line_escapes_what_it_refuses(arguments, text, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        code = main([part.format(text) for part in arguments])
    except SystemExit as stop:
        code = stop.code
    assert code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert_printable(error.removesuffix("\n"))
