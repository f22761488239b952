"""The package of docs/extend.md adds a marker, a format, a preset and a kind of damage."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from fastgen import plugins
from fastgen.classes import BUNDLED_DAMAGE_CLASSES
from fastgen.cli.main import main

PAGE = Path(__file__).parent.parent / "docs/extend.md"
PARTS = re.compile(r"^`([\w./]+)`[^\n]*\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SIZE = ["--size", "192x192", "--quality", "draft"]


def install(site, name, groups):
    """Describe a distribution on a folder of sys.path, as pip does."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [
        line
        for group, entries in groups.items()
        for line in (f"[{group}]", *(f"{key} = {value}" for key, value in entries.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder of sys.path with the package of the docs page."""
    site = tmp_path_factory.mktemp("site")
    parts = dict(PARTS.findall(PAGE.read_text(encoding="utf-8")))
    assert set(parts) == {
        "pyproject.toml",
        *(f"quaytools/{name}.py" for name in ("presets", "boxes", "dust", "buckle")),
        "quaytools/buckle.glsl",
    }
    (site / "quaytools").mkdir()
    (site / "quaytools/__init__.py").touch()
    project = tomllib.loads(parts.pop("pyproject.toml"))["project"]
    for path, text in parts.items():
        (site / path).write_text(text)
    Image.new("RGB", (64, 64), (20, 180, 40)).save(site / "quaytools/env.png")
    install(site, project["name"], project["entry-points"])
    return site


def fastgen(*arguments, path=(), code=0):
    """Run the command with folders on PYTHONPATH; return what it prints."""
    paths = [*map(str, path), *filter(None, [os.environ.get("PYTHONPATH")])]
    done = subprocess.run(
        [sys.executable, "-m", "fastgen", *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == code, done.stderr
    return done.stderr if code else done.stdout


@pytest.fixture(scope="module")
def dataset(site, tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "out"
    given = ["--images", "10", "--preset", "our_gate", "--also", "boxes", "--workers", "2"]
    fastgen("generate", out, *given, *SIZE, path=[site])
    return out


def test_the_preset_is_listed(site):
    listed = fastgen("presets", path=[site])
    assert re.search(r"^our_gate +our gate, with the marker of our port$", listed, re.MULTILINE)
    assert "our_gate" not in fastgen("presets")


def test_the_marker_and_the_format_reach_the_files(dataset):
    names = yaml.safe_load((dataset / "imdg/data.yaml").read_text())["names"]
    assert names[28] == "ENV"
    assert len(names) == 29
    boxes = 0
    for path in dataset.glob("boxes/*/*.csv"):
        rows = [line.split(",") for line in path.read_text().splitlines()]
        label = dataset / "imdg/labels" / path.parent.name / f"{path.stem}.txt"
        lines = [line.split() for line in label.read_text().splitlines()]
        assert [row[0] for row in rows] == [names[int(line[0])] for line in lines]
        for (_, x0, _, x1, _), line in zip(rows, lines, strict=True):
            assert float(line[3]) * 192 == pytest.approx(int(x1) - int(x0), abs=1e-3)
        boxes += len(rows)
    counts = json.loads((dataset / "dataset.json").read_text())["counts"].values()
    assert boxes == sum(count["boxes"] for count in counts) > 10
    assert "ENV" in "".join(path.read_text() for path in dataset.glob("boxes/*/*.csv"))


def test_the_function_changes_pixels_and_is_recorded(dataset, site, tmp_path):
    record = json.loads((dataset / "dataset.json").read_text())
    assert record["postprocess"]["function"] == "quaytools.dust:dust"
    assert len(record["postprocess"]["sha256"]) == 64
    pictures = []
    for name, more in (("with", []), ("again", []), ("without", ["--set", "postprocess=''"])):
        path = tmp_path / f"{name}.png"
        given = ["--index", "0", "--camera", "rear", "-o", path, *SIZE, *more]
        fastgen("show", "--preset", "our_gate", *given, path=[site])
        pictures.append(np.array(Image.open(path)).astype(int))
    dusty, again, clean = pictures
    np.testing.assert_array_equal(dusty, again)
    changed = (dusty != clean).any(axis=2)
    assert 0.005 < changed.mean() < 0.02
    np.testing.assert_array_equal(dusty[changed], clean[changed] // 2)


def test_the_dataset_needs_its_package(dataset, site):
    assert "whole and consistent" in fastgen("verify", dataset, path=[site])
    said = subprocess.run(
        [sys.executable, "-m", "fastgen", "verify", dataset], capture_output=True, text=True
    )
    assert said.returncode == 1
    assert "dataset.json: format 'boxes' is unknown; install the package" in said.stdout
    given = ["--images", "10", "--preset", "our_gate", "--also", "boxes"]
    assert "preset: 'our_gate' is unknown" in fastgen("generate", dataset, *given, *SIZE, code=2)


def test_a_changed_function_is_refused_when_a_dataset_is_continued(dataset, site):
    path = site / "quaytools/dust.py"
    text = path.read_text()
    path.write_text(text.replace("0.01", "0.02"))
    given = ["--images", "20", "--preset", "our_gate", "--also", "boxes", *SIZE]
    said = fastgen("generate", dataset, *given, path=[site], code=2)
    path.write_text(text)
    assert "was made with other settings (postprocess.sha256 was" in said


BUCKLED = "damage={probability: 1, count: 3, kinds: [buckle], ranges: {buckle: {depth_mm: 90}}}"


@pytest.fixture(scope="module")
def buckled(site, tmp_path_factory):
    """A dataset with the kind of damage of the package."""
    out = tmp_path_factory.mktemp("buckled") / "out"
    given = ["--images", "8", "--size", "256x256", "--quality", "draft", "--set", BUCKLED]
    fastgen("generate", out, *given, path=[site])
    return out


def test_masks_and_categories_have_the_kind(buckled):
    first = 100 * (len(BUNDLED_DAMAGE_CLASSES) + 2)  # after the container and fastgen's kinds
    values = set()
    for path in (buckled / "damage/masks").rglob("*.png"):
        values |= set(np.unique(np.array(Image.open(path))).tolist())
    assert values & set(range(first + 1, first + 100))
    assert values <= {0, 101, *range(first + 1, first + 100)}
    found = set()
    for path in (buckled / "damage").glob("coco_*.json"):
        coco = json.loads(path.read_text())
        names = {each["id"]: each["name"] for each in coco["categories"]}
        found |= {names[each["category_id"]] for each in coco["annotations"]}
    assert found == {"container", "buckle"}
    names = yaml.safe_load((buckled / "damage/data.yaml").read_text())["names"]
    assert names[len(names) - 1] == "buckle"
    depths = {
        damage["depth_mm"]
        for path in (buckled / "scenes").rglob("*.json")
        for damage in json.loads(path.read_text())["scene"]["damages"]
    }
    assert depths == {90.0}


def test_the_dataset_is_whole_and_its_statistics_name_the_kind(buckled, site):
    assert "whole and consistent" in fastgen("verify", buckled, path=[site])
    table = fastgen("stats", buckled, path=[site])
    (row,) = (line for line in table.splitlines() if line.startswith("buckle"))
    assert sum(map(int, row.split()[1:])) > 0


DEPTHS = """
import numpy as np
from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from tests import oracle

damage = {"probability": 1, "count": 6, "kinds": ["buckle"], "faces": ["front", "back"]}
config = Config.from_values({"damage": damage})
with Generator(config, seed=5, size=(256, 192)) as generator:
    sample = generator.render(1, "A")
# a generator that does not list the kind compiles it for the scene
with Generator(Config(), seed=5, size=(256, 192)) as generator:
    generator.render(0, "A")
    again = generator.render(scene=sample.scene, camera="A")
np.testing.assert_array_equal(again.image, sample.image)
mesh = PreparedScene(sample.scene).container
hits = oracle.cast(mesh, sample.view, sample.scene)
assert (oracle.object_ids(sample.scene, mesh, hits) != sample.ids).mean() < 2e-4
assert (oracle.damage_values(sample.scene, hits, 5.0) != sample.damage).mean() < 2e-3
assert (sample.damage > 200).mean() > 0.01
print("equal")
"""


def test_drawn_ids_are_those_of_rays_at_the_mesh_that_numpy_deforms(site):
    root = Path(__file__).parent.parent
    paths = [str(site), str(root), *filter(None, [os.environ.get("PYTHONPATH")])]
    done = subprocess.run(
        [sys.executable, "-c", DEPTHS],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (0, "equal\n"), done.stderr


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{kinds: [buckel]}", "damage.kinds[0]: 'buckel' is unknown (did you mean buckle?)"),
        (
            "{ranges: {buckle: {depth_mm: -1}}}",
            "damage.ranges.buckle.depth_mm: -1 is out of range; give 0 to 2400 mm",
        ),
        ("{ranges: {dented: {}}}", "damage.ranges.dented: write the ranges under damage.dented"),
        ("{ranges: {hole: {}}}", "damage.ranges: 'hole' is unknown (choose from buckle)"),
        ("{kinds: [buckle], faces: []}", "damage.faces: the list is empty"),
    ],
)
def test_wrong_values_of_a_kind_are_named(value, words, site):
    said = fastgen("config", "--set", f"damage={value}", path=[site], code=2)
    assert words in said


def test_statistics_need_no_package_and_a_merge_names_what_is_missing(site, dataset, tmp_path):
    out = tmp_path / "out"
    given = ["--images", "2", "--set", "damage={kinds: [buckle], probability: 1}", "--cameras", "A"]
    fastgen("generate", out, *given, *SIZE, path=[site])
    assert re.search(r"^\s*buckle +[1-9]", fastgen("stats", out), re.MULTILINE)
    said = fastgen("merge", dataset, out, tmp_path / "both", code=2)
    assert "has labels of the format boxes, which is unknown; install the package" in said


@pytest.mark.parametrize(
    ("file", "old", "new", "option", "words"),
    [
        (
            "buckle.glsl",
            "return",
            "retrn",
            ["--set", "damage={kinds: [buckle], probability: 1}"],
            "damage.kinds: shaders with the GLSL of buckle do not compile (0:",
        ),
        (
            "buckle.glsl",
            None,
            None,
            ["--set", "damage={kinds: [buckle], probability: 1}"],
            "quaytools/buckle.glsl: is missing; list it in the package data of its package",
        ),
        (
            "boxes.py",
            "item.detections",
            "item.detectons",
            ["--also", "boxes"],
            "the format boxes of quaytools.boxes failed at s0_000000_A: AttributeError(",
        ),
    ],
)
def test_a_faulty_package_is_named_in_one_line(site, tmp_path, file, old, new, option, words):
    copy = tmp_path / "site"
    shutil.copytree(site, copy)
    faulty = copy / "quaytools" / file
    if old is None:
        faulty.unlink()
    else:
        faulty.write_text(faulty.read_text().replace(old, new))
    given = ["--images", "1", "--cameras", "A", *option]
    said = fastgen("generate", tmp_path / "out", *given, *SIZE, path=[copy], code=2)
    assert words in said.splitlines()[-1]
    assert "Traceback" not in said


@pytest.fixture
def reread():
    """Let this process see packages that the test installs, and forget them afterwards."""
    plugins._offered.cache_clear()
    yield
    plugins._offered.cache_clear()


@pytest.mark.parametrize(
    ("groups", "arguments", "words"),
    [
        (
            {"fastgen.presets": {"gate": "broken:NONE"}},
            ["config", "--preset", "gate"],
            "preset: gate is offered by fastgen and other; uninstall one or rename its entry point",
        ),
        (
            {"fastgen.presets": {"mine": "broken:NONE"}},
            ["config", "--preset", "mine"],
            "preset: mine of the package other cannot be loaded from broken:NONE (ModuleNotFound",
        ),
        (
            {"fastgen.presets": {"mine": "json:dumps"}},
            ["config", "--preset", "mine"],
            "preset: mine of the package other is a function; json:dumps has to be an instance of",
        ),
        (
            {"fastgen.formats": {"mine": "quaytools.boxes:FORMAT"}},
            ["generate", "{out}", "--images", "1", "--also", "mine"],
            "also: the format mine calls itself 'boxes'; give both the same name",
        ),
        (
            {"fastgen.damages": {"scrape": "quaytools.buckle:KIND"}},
            ["config"],
            "preset seafront: kinds: scrape is offered by fastgen and other; uninstall one or",
        ),
        (
            {"fastgen.damages": {"mine": "quaytools.buckle:KIND"}},
            ["config", "--set", "damage.kinds=[mine]"],
            "--set: damage.kinds: the kind mine calls itself 'buckle'; give both the same name",
        ),
        (
            {"fastgen.damages": {"mine": "broken:NONE"}},
            ["config", "--set", "damage.kinds=[mine]"],
            "--set: damage.kinds: mine of the package other cannot be loaded from broken:NONE",
        ),
    ],
)
def test_a_broken_package_is_named(
    groups, arguments, words, site, tmp_path, monkeypatch, capsys, reread
):
    install(tmp_path, "other", groups)
    for folder in (site, tmp_path):
        monkeypatch.syspath_prepend(folder)
    given = [each.format(out=tmp_path / "out") for each in arguments]
    if "fastgen.damages" in groups:  # the names of kinds are read when fastgen is imported
        assert fastgen(*given, path=[tmp_path, site], code=2).startswith(f"fastgen: {words}")
        return
    assert main(given) == 2
    assert capsys.readouterr().err.startswith(f"fastgen: {words}")
    assert main(["presets"]) == 0
