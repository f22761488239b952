"""dataset.json and manifests of shards with values that no run of ours wrote."""

import json
import shutil
from typing import Any

import pytest

from fastgen.cli.main import main
from fastgen.dataset.dataset_json import existing, read_manifest
from fastgen.dataset.generate import _made
from fastgen.dataset.job import Job
from fastgen.dataset.repair import _job
from fastgen.dataset.seal import digest, seal
from fastgen.dataset.settings import settled
from fastgen.dataset.stats import report
from fastgen.dataset.storage import Folder
from fastgen.dataset.verify import examine
from fastgen.errors import FastgenError
from fastgen.render.settings import RenderSettings

pytestmark = pytest.mark.usefixtures("no_workers")

JSON_VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1.5, 1e300, 10**30, "", "x", "\x1b[31m", "../x"),
    *([], [1], ["x"], [[]], [None, None], {}, {"x": 1}, {"0": "x"}, {"x": {}}, {"x": [1, "x"]}),
)


def job_in(folder):
    return Job(str(folder), 2, seed=3, cameras=("A",), render=RenderSettings((64, 64)))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A finished dataset, its job and settings."""
    out = tmp_path_factory.mktemp("made") / "dataset"
    arguments = ["--images", "2", "--size", "64x64", "--cameras", "A", "--seed", "3"]
    assert main(["generate", str(out), *arguments, "--workers", "1"]) == 0
    return out, *settled(job_in(out), 1)


def readers(made):
    """Yield the name of each reader of a dataset, and a function that reads."""
    out, job, settings = made
    storage = Folder(out)
    yield "stats", lambda: report(out)
    yield "verify", lambda: examine(str(out))
    yield "repair", lambda: _job(str(out), examine(str(out)).manifest, None, None)
    yield "resume", lambda: _made(job, storage, existing(storage, job, settings) or {})


def read_by_all(made):
    """Let everything read a dataset; return what was refused, by reader. No other error is good."""
    refusals = {}
    for name, read in readers(made):
        try:
            read()
        except FastgenError as error:
            refusals[name] = str(error)
    assert all(len(words) < 4100 for words in refusals.values())
    return refusals


def sealed(manifest):
    return seal(json.dumps(manifest, indent=1).encode())


@pytest.fixture
def restored(made):
    """The folder of the dataset, whose JSON files are put back afterwards."""
    out = made[0]
    paths = [out / "dataset.json", out / "shards/000000.json"]
    before = [path.read_bytes() for path in paths]
    yield out
    for path, content in zip(paths, before, strict=True):
        path.write_bytes(content)


def test_an_unchanged_dataset_is_read_by_all(made):
    assert not read_by_all(made)
    assert not examine(str(made[0])).faults


FIELDS = (
    *("version", "format", "formats", "seed", "size", "quality", "cameras", "environments"),
    *("shard_scenes", "config", "backend", "renderer", "images", "counts", "failed", "files"),
    *("shards", "classes", "stems", "coco_masks"),
)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("finished", [True, False])
def test_every_field_of_dataset_json_may_have_any_type(made, restored, field, finished):
    path = restored / "dataset.json"
    manifest = json.loads(path.read_bytes())
    assert set(manifest) == {*FIELDS, "digest"}
    del manifest["digest"]
    named = 0
    for value in JSON_VALUES:
        changed = {**manifest, field: value}
        path.write_bytes(sealed(changed) if finished else json.dumps(changed).encode())
        read_by_all(made)
        if finished:
            found = examine(str(restored)).faults if field != "formats" or value == [] else []
            named += any(fault.startswith(f"dataset.json: {field}") for fault in found)
    changed = {key: manifest[key] for key in manifest if key != field}
    path.write_bytes(sealed(changed) if finished else json.dumps(changed).encode())
    read_by_all(made)
    assert named > 0 or not finished or field == "formats"


@pytest.mark.parametrize("depth", [100, 190, 250, 900, 990, 5000])
@pytest.mark.parametrize("field", ["config", "environments", "seed", "new"])
def test_deeply_nested_values_are_read_or_refused(made, restored, field, depth):
    path = restored / "dataset.json"
    manifest = json.loads(path.read_bytes())
    del manifest["digest"]
    text = json.dumps({**manifest, field: "HERE"}, indent=1)
    for opening, closing in (('{"a": ', "}"), ("[", "]")):
        deep = text.replace('"HERE"', f"{opening * depth}1{closing * depth}").encode()
        for content in (deep, seal(deep)):
            path.write_bytes(content)
            read_by_all(made)


def test_a_shard_whose_values_have_other_types_counts_as_missing(made, restored):
    path, storage = restored / "shards/000000.json", Folder(restored)
    manifest = json.loads(path.read_bytes())
    dataset = json.loads((restored / "dataset.json").read_bytes())
    del manifest["digest"], dataset["digest"]
    missing = 0
    for field in manifest:
        for value in JSON_VALUES:
            content = seal(json.dumps({**manifest, field: value}).encode())
            path.write_bytes(content)
            shards = {"0": digest(content)}
            (restored / "dataset.json").write_bytes(sealed({**dataset, "shards": shards}))
            refusals = read_by_all(made)
            if read_manifest(storage, 0) is None:
                missing += 1
                assert "resume" not in refusals  # the shard is made again
                assert examine(str(restored)).broken >= {"shards/000000.json"} or field == "shard"
    assert missing > 100


@pytest.mark.parametrize("value", ["x", None, [2]])
@pytest.mark.parametrize("command", [["stats"], ["verify"], ["verify", "--repair"]])
def test_the_commands_end_with_their_own_code(made, tmp_path, capsys, command, value):
    """1 is for faults that verify finds, 2 for what cannot be read."""
    copy = tmp_path / "copy"
    shutil.copytree(made[0], copy)
    manifest = json.loads((copy / "dataset.json").read_bytes())
    del manifest["digest"]
    (copy / "dataset.json").write_bytes(sealed({**manifest, "images": value}))
    assert main([command[0], str(copy), *command[1:]]) == (1 if command == ["verify"] else 2)
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    assert said.err.count("\n") <= 1


def test_a_repair_calls_no_function_that_a_dataset_names(restored, tmp_path, monkeypatch, capsys):
    """Not even its module is imported, and the damaged file stays."""
    called = tmp_path / "called"
    (tmp_path / "trap.py").write_text(f"open({str(called)!r}, 'w')\n\ndef spring(*_): pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    manifest = json.loads((restored / "dataset.json").read_bytes())
    manifest["config"]["postprocess"] = "trap:spring"
    del manifest["digest"]
    (restored / "dataset.json").write_bytes(sealed(manifest))
    (image,) = sorted(restored.glob("images/*/*.jpg"))[:1]
    whole = image.read_bytes()
    image.write_bytes(b"damaged")
    try:
        assert main(["verify", str(restored), "--repair"]) == 2
        words = "was made with the function 'trap:spring', which a repair would call; give --run-"
        assert words in capsys.readouterr().err
        assert image.read_bytes() == b"damaged"
        assert not called.exists()
    finally:
        image.write_bytes(whole)
