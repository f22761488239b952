"""Generated and mutated input: only errors of the package escape, and each is one short line."""

import io
import json
from contextlib import suppress

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from fastgen import Config, Generator
from fastgen.config.yaml_values import Dumper
from fastgen.dataset.repair import _job
from fastgen.dataset.seal import seal
from fastgen.dataset.stats import report
from fastgen.dataset.verify import examine
from fastgen.errors import ConfigError, FastgenError
from fastgen.scene import Scene
from fastgen.scene.check import check_scene
from fastgen.torch import Loader
from tests.stability.fuzzing import COUNT, TEXTS, VALUES, inputs, mutated
from tests.stability.test_hostile_datasets import made, readers  # noqa: F401
from tests.test_torch import dataset

PLAIN = Config.preset().to_plain()

WORDS = st.sampled_from(
    [
        *PLAIN,
        *PLAIN["damage"],
        "A",
        "!!bool ",
        "!!timestamp ",
        "!!int ",
        "!!binary ",
        "!!set ",
        "!!",
    ]
    + ["- ", ": ", "? ", "{", "}", "[", "]", ",", "&a ", "*a ", "<<", "|\n", ">\n", "'", '"', "#"]
    + ["\n", "\n  ", "  ", "---\n", "%YAML 1.1\n", "\\U", "\\x", "\t", "0x", "1:1", "1e", ".", "_"]
    + [
        "2026-01-01",
        "00:00:00",
        "yes",
        "null",
        "~",
        "=",
        ".nan",
        ".inf",
        "9" * 30,
        "\ufeff",
        "\x85",
    ]
)
"""Pieces from which YAML is made."""


def assert_clear(error):
    words = str(error)
    assert words.isprintable(), words
    assert 0 < len(words) < 4100


def refused_clearly(read):
    """Return what `read` returns; or None after an error of the package."""
    try:
        return read()
    except FastgenError as error:
        refusal = error
    assert_clear(refusal)
    return None


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzzed") / "port.yaml"


def load(file, data):
    file.write_bytes(data)
    return refused_clearly(lambda: Config.load(file))


@inputs(150)
@given(st.one_of(st.text(), st.lists(WORDS | TEXTS, max_size=25).map("".join)))
@example("damage: {count: 0x" + "f" * 900 + "}")
def test_any_text_is_a_configuration_or_refused(file, text):
    load(file, text.encode("utf-8", "surrogatepass"))


@inputs(50)
@given(st.binary())
def test_any_bytes_are_a_configuration_or_refused(file, data):
    load(file, data)


@inputs(60)
@given(mutated(PLAIN), st.booleans())
def test_a_mutated_configuration_is_sampled_or_refused(file, plain, as_json):
    if as_json:
        text = json.dumps(plain)
    else:
        buffer = io.StringIO()
        with suppress(yaml.YAMLError):
            yaml.dump(plain, buffer, Dumper=Dumper)
        text = buffer.getvalue()
    config = load(file, text.encode("utf-8", "surrogatepass"))
    if config is not None:
        refused_clearly(lambda: Generator(config, size=(64, 64)).scene(0))


@inputs(60)
@given(st.data())
def test_a_mutated_configuration_file_is_loaded_or_refused(file, data):
    text = yaml.dump(PLAIN[data.draw(st.sampled_from(list(PLAIN)))], Dumper=Dumper)
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        length = data.draw(st.sampled_from([0, 0, 1, 1, 5, 40]))
        text = text[:start] + data.draw(WORDS | TEXTS) + text[start + length :]
    load(file, text.encode("utf-8", "surrogatepass"))


@pytest.fixture(scope="module")
def plain_scene():
    values = {"damage": {"probability": 1, "count": [2, 2]}}
    values["placement"] = {"arrangements": {"trailer": 1}, "neighbours": 1}
    return json.loads(
        Generator(Config.from_values(values), seed=2, size=(64, 64)).scene(3).to_json()
    )


@inputs(100)
@given(st.data())
def test_a_mutated_scene_is_accepted_or_refused(plain_scene, data):
    text = json.dumps(data.draw(mutated(plain_scene)))
    scene = refused_clearly(lambda: Scene.from_json(text))
    if scene is not None:
        refused_clearly(lambda: check_scene(scene))
        assert Scene.from_json(scene.to_json()) == scene


@inputs(100)
@given(st.text() | VALUES.map(json.dumps), st.integers(0, 3))
def test_any_text_is_a_scene_or_refused(text, depth):
    refused_clearly(lambda: Scene.from_json('{"scene": ' * depth + text + "}" * depth))


@inputs(60)
@given(st.data(), st.booleans())
def test_a_mutated_dataset_json_is_read_or_refused(made, data, finished):  # noqa: F811
    path = made[0] / "dataset.json"
    before = path.read_bytes()
    manifest = json.loads(before)
    del manifest["digest"]
    new = data.draw(mutated(manifest))
    try:
        text = json.dumps(new, indent=1).encode()
        path.write_bytes(seal(text) if finished and text.endswith(b"\n}") else text)
        for _, read in readers(made):
            refused_clearly(read)
    finally:
        path.write_bytes(before)


@inputs(60)
@given(st.binary(max_size=50), st.integers(0, 2000), st.integers(0, 20))
def test_a_damaged_dataset_json_is_read_or_refused(made, piece, start, length):  # noqa: F811
    path = made[0] / "dataset.json"
    before = path.read_bytes()
    try:
        path.write_bytes(before[:start] + piece + before[start + length :])
        out = str(made[0])
        refused_clearly(lambda: report(out))
        found = refused_clearly(lambda: examine(out))
        if found is not None and found.manifest:
            refused_clearly(lambda: _job(out, found.manifest, None, None))
    finally:
        path.write_bytes(before)


@inputs(100)
@given(st.data())
def test_a_mutated_state_is_loaded_or_refused_and_then_changes_nothing(loader, data):
    state = json.loads(json.dumps(loader.state_dict()))
    new = data.draw(mutated(state))
    try:
        loader.load_state_dict(new)
    except ConfigError as error:
        refusal = error
        assert loader.state_dict() == state
    else:
        loader.load_state_dict(state)
        return
    assert_clear(refusal)


@pytest.fixture(scope="module")
def loader():
    return Loader(dataset())


def test_the_number_of_inputs_can_be_set():
    assert inputs(7).max_examples == (COUNT or 7)
