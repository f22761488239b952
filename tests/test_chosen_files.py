"""The options of `generate` that choose files and their names."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from fastgen.cli.main import main
from fastgen.config.config import LabelConfig
from fastgen.dataset.shards import loose_files
from fastgen.dataset.storage import storage_of
from fastgen.formats.format import assemble
from fastgen.formats.item import Item
from fastgen.formats.obb import oriented_box
from fastgen.formats.registry import formats_of
from fastgen.formats.semantic import IGNORED, class_map
from fastgen.sample import Object
from tests.folders import content

pytestmark = pytest.mark.usefixtures("no_workers")

ARGUMENTS = ["--images", "4", "--size", "96x80", "--quality", "draft", "--workers", "1"]


def run(out, *more):
    return main(["generate", str(out), *ARGUMENTS, *more])


def folders(out):
    return {path.relative_to(out).parts[0] for path in out.rglob("*") if path.is_file()}


ALWAYS = {"images", "scenes", "shards", "dataset.json", "contact_sheet.png"}


def test_only_the_named_tasks_are_written(tmp_path, capsys):
    out = tmp_path / "out"
    assert run(out, "--tasks", "imdg,obb") == 0
    assert folders(out) == {*ALWAYS, "imdg", "obb"}
    assert main(["verify", str(out)]) == 0
    capsys.readouterr()
    assert main(["stats", str(out)]) == 0
    told = capsys.readouterr().out
    assert "Table 3: instances in the marker task" in told
    assert "damage" not in told.lower()
    next(out.glob("obb/labels/*/*.txt")).unlink()
    assert main(["verify", str(out), "--repair", "--workers", "1"]) == 0
    assert run(out, "--tasks", "imdg") == 2
    assert "formats was ['imdg', 'obb'], is now ['imdg']" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--tasks", ""], "tasks: no task is named"),
        (["--tasks", "imgd"], "tasks: 'imgd' is unknown"),
        (["--tasks", "imdg,imdg"], "tasks: a name occurs twice"),
        (["--tasks", "door", "--also", "coco"], "coco adds files to other tasks; add one of imdg"),
        (["--format", "webdataset", "--also", "coco"], "also: coco keeps labels in files that"),
        (["--stems", "long"], "stems: 'long' is unknown"),
        (["--coco-masks", "png"], "coco_masks: 'png' is unknown"),
    ],
)
def test_a_wrong_choice_is_refused_before_anything_is_written(tmp_path, capsys, more, words):
    assert run(tmp_path / "out", *more) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_parquet_without_its_library_says_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert run(tmp_path / "out", "--format", "parquet") == 2
    assert "pip install 'fastgen[parquet]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_datasets_of_different_seeds_share_no_file_of_a_sample(tmp_path):
    names = []
    for seed in ("7", "8"):
        out = tmp_path / seed
        assert run(out, "--seed", seed, "--tasks", "imdg") == 0
        names.append({path.stem for path in out.glob("*/*/*.*")})
        assert names[-1] >= {f"s{seed}_000000_{camera}" for camera in ("A", "B", "Cl", "Cr")}
    assert not {name for name in names[0] & names[1] if not name.startswith("data")}


def test_short_stems_are_the_same_files_under_other_names(tmp_path, capsys):
    for kind in ("seed", "short"):
        out = tmp_path / kind
        assert run(out, "--seed", "7", "--tasks", "imdg", "--stems", kind) == 0
        (lost,) = out.glob("images/*/*000000_Cl.jpg")
        lost.unlink()
        assert main(["verify", str(out)]) == 1
        assert main(["verify", str(out), "--repair", "--workers", "1"]) == 0
        assert main(["stats", str(out)]) == 0
    long, short = (content(tmp_path / kind) for kind in ("seed", "short"))
    for path in ("images", "imdg/images", "imdg/labels"):
        mine = {n.replace("/s7_", "/"): h for n, h in long.items() if n.startswith(f"{path}/")}
        assert mine == {n: h for n, h in short.items() if n.startswith(f"{path}/")}
        assert len(mine) == 4
    assert run(tmp_path / "short", "--seed", "7", "--tasks", "imdg", "--stems", "seed") == 2
    assert "the old --stems" in capsys.readouterr().err


def test_run_lengths_are_written_on_request(tmp_path):
    assert run(tmp_path / "out", "--split", "train", "--coco-masks", "rle") == 0
    for task in ("imdg", "damage", "container"):
        text = (tmp_path / f"out/{task}/coco_train.json").read_text()
        found = json.loads(text)["annotations"]
        assert found
        assert all(set(each["segmentation"]) == {"size", "counts"} for each in found)
    assert main(["verify", str(tmp_path / "out")]) == 0


def test_what_is_empty_is_told_at_the_end(tmp_path, capsys):
    assert run(tmp_path / "out", "--split", "val", "--cameras", "A,Cr") == 0
    told = capsys.readouterr().err
    assert "no image is in train and test; " in told
    assert "door/val/no_door" in told
    assert "door/val/door" not in told
    assert "door/train" not in told  # the split is named already
    assert (
        (tmp_path / "out/imdg/data.yaml")
        .read_text()
        .startswith("train: images/val\nval: images/val\nnc")
    )


def test_object_stores_have_no_copies_of_images_for_trainers(tmp_path, generators):
    """A store has no links, so each copy would take the space of the image."""
    out = tmp_path / "out"
    assert run(out) == 0
    copies = {path for path in storage_of(out).sizes() if "/images/" in path}
    assert len(copies) == 3 * 4
    store = storage_of(f"memory://{tmp_path}")
    sample = generators(seed=0, size=(96, 80), quality="draft").render(index=0, camera="Cr")
    item = Item(sample, "train", "s0_000000_Cr", 3, LabelConfig())
    made = [assemble(item, formats_of(("imdg", "door")))]
    store.commit(loose_files(made, store.links), "0")
    images = {path for path in store.sizes() if path.endswith(".jpg")}
    assert images == {"images/train/s0_000000_Cr.jpg", "door/train/door/s0_000000_Cr.jpg"}


def print_at(quad):
    return Object(2, "text", 1, (0, 0, 9, 9), None, 9, 1.0, False, quad=tuple(np.ravel(quad)))


def test_oriented_boxes_are_the_print_or_lie_inside_the_image():
    quad = np.array([(10, 5), (30, 10), (28, 20), (8, 15)], float)
    size, box = (40, 30), (8, 5, 30, 20)
    np.testing.assert_array_equal(oriented_box(print_at(quad), box, size), quad)
    np.testing.assert_array_equal(
        oriented_box(replace(print_at(quad), quad=()), box, size),
        [(8, 5), (30, 5), (30, 20), (8, 20)],
    )
    # an upright print that the left border cuts in the middle
    cut = oriented_box(print_at([(-10, 5), (10, 5), (10, 15), (-10, 15)]), box, size)
    assert sorted(map(tuple, cut.round(3).tolist())) == [(0, 5), (0, 15), (10, 5), (10, 15)]
    for turn in np.linspace(0, 3, 20):
        rotation = np.array([(np.cos(turn), -np.sin(turn)), (np.sin(turn), np.cos(turn))])
        corners = oriented_box(print_at((quad - (19, 12)) @ rotation.T + (38, 2)), box, size)
        assert (corners >= 0).all()
        assert (corners <= size).all()


def test_ignored_objects_do_not_count_in_semantic_masks(generators):
    sample = generators(seed=5, size=(96, 80), quality="draft").render(index=0, camera="A")
    none, container = (
        replace(
            sample,
            objects=[replace(each, ignored=each.class_name == name) for each in sample.objects],
        )
        for name in ("", "container")
    )
    plain, marked = class_map(none), class_map(container)
    on = sample.damage > 0
    assert on.any()
    assert (plain[on] < IGNORED).all()
    assert (marked[on] == IGNORED).all()
    np.testing.assert_array_equal(plain[~on], marked[~on])
