"""Files that other programs leave in a dataset: listed by `verify`, never changed."""

import json

import pytest

from fastgen.cli.main import main
from fastgen.dataset.seal import seal
from tests.folders import content

pytestmark = pytest.mark.usefixtures("no_workers")

LEFT_BEHIND = (
    ".DS_Store",
    "images/train/.DS_Store",
    "images/train/Thumbs.db",
    "imdg/labels/train.cache",
    "imdg/runs/detect/train/weights/best.pt",
    "imdg/runs/detect/train/args.yaml",
    "runs/events.out",
    "shards/000009.json",
    "shards/note.txt",
)

LISTED = [
    ".DS_Store",
    "images/train/.DS_Store",
    "images/train/Thumbs.db",
    "imdg/labels/train.cache",
    "imdg/runs/",
    "runs/",
    "shards/000009.json",
    "shards/note.txt",
]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "dataset"
    arguments = ["--images", "4", "--size", "64x64", "--split", "train", "--workers", "1"]
    assert main(["generate", str(out), *arguments]) == 0
    for name in LEFT_BEHIND:
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_bytes(name.encode())
    return out


def lines(capsys, end):
    """Return the printed lines with this end, without it."""
    printed = capsys.readouterr().out.splitlines()
    return [line.removesuffix(end) for line in printed if line.endswith(end)]


def test_foreign_files_are_listed_and_are_no_fault(dataset, capsys):
    assert main(["verify", str(dataset)]) == 0
    assert lines(capsys, ": not part of the dataset") == LISTED


def test_a_damaged_file_among_foreign_ones_is_a_fault(copy, capsys):
    (image,) = copy.glob("images/train/*_A.jpg")
    image.unlink()
    assert main(["verify", str(copy)]) == 1
    printed = capsys.readouterr().out.splitlines()
    assert f"images/train/{image.name}: missing" in printed
    assert [line for line in printed if line.endswith(": missing")] == printed[:1]


def test_repair_restores_damaged_files_and_leaves_foreign_ones(dataset, copy, capsys):
    next(copy.glob("imdg/labels/train/*_A.txt")).write_text("")
    next(copy.glob("damage/masks/train/*_B.png")).unlink()
    (copy / "dataset.json").write_bytes((dataset / "dataset.json").read_bytes())
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert lines(capsys, ": not part of the dataset") == LISTED
    assert content(copy) == content(dataset)


def test_a_lost_manifest_does_not_make_its_samples_foreign(copy, capsys):
    (copy / "shards/000000.json").unlink()
    assert main(["verify", str(copy)]) == 1
    assert lines(capsys, ": not part of the dataset") == LISTED


def test_foreign_files_do_not_stop_an_extension(copy):
    arguments = ["--images", "5", "--size", "64x64", "--split", "train", "--workers", "1"]
    assert main(["generate", str(copy), *arguments]) == 0
    assert all((copy / name).read_bytes() == name.encode() for name in LEFT_BEHIND)


def test_stats_takes_class_names_from_the_dataset(copy, capsys):
    path = copy / "dataset.json"
    manifest = json.loads(path.read_bytes())
    del manifest["digest"]
    names = [f"class {number}" for number, _ in enumerate(manifest["classes"]["imdg"])]
    manifest["classes"]["imdg"] = names
    path.write_bytes(seal(json.dumps(manifest, indent=1).encode()))
    assert main(["stats", str(copy), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["imdg"]) == names
    assert found["imdg"]["class 0"] == {"train": 4, "val": 0, "test": 0}
    manifest["classes"]["imdg"] = []
    path.write_bytes(seal(json.dumps({**manifest}, indent=1).encode()))
    assert main(["stats", str(copy)]) == 2
    assert "is damaged; run fastgen verify" in capsys.readouterr().err
