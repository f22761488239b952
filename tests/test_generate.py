"""Datasets made from the command line: complete, reproducible, resumable, with clear errors."""

import json
import os
import re
import shutil
import signal
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.dataset.generate import generate
from fastgen.dataset.job import Job, manifest_path, shard_of
from fastgen.dataset.shards import Maker
from fastgen.dataset.storage import storage_of
from fastgen.errors import OutputError
from fastgen.generator import Generator
from fastgen.render.settings import RenderSettings
from fastgen.sampling.scene import split_of
from fastgen.scene import Scene
from tests.backends import needs_osmesa
from tests.folders import content
from tests.in_process import no_workers
from tests.interruptible import begun

SMALL = RenderSettings((64, 64))
ARGUMENTS = ["--images", "14", "--size", "96x80", "--seed", "3"]
MANY = ["--images", "60", "--shard", "1"]
WHOLE = [*ARGUMENTS, *MANY, "--workers", "2"]


def run(out, *more):
    """Generate without worker processes."""
    with no_workers():
        return main(["generate", str(out), *ARGUMENTS, *more])


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "dataset"
    assert main(["generate", str(out), *ARGUMENTS, "--workers", "2"]) == 0
    return out


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Dataset with many shards, so that a run is far from its end when its first shards exist."""
    out = tmp_path_factory.mktemp("whole") / "dataset"
    assert run(out, *MANY) == 0
    return out


def records(out):
    return [json.loads(p.read_text()) for p in sorted(out.glob("scenes/*/*.json"))]


def test_a_quiet_run_names_failed_scenes(tmp_path, monkeypatch, capsys):
    failed = [{"scene": 3, "seed": 0, "error": "no room"}]
    manifest = {"files": {}, "counts": {"train": {"images": 0}}, "failed": failed}
    monkeypatch.setattr("fastgen.cli.dataset_commands.generate", lambda *_: manifest)
    assert main(["generate", str(tmp_path), "--images", "1", "--quiet"]) == 1
    printed, said = capsys.readouterr()
    assert printed == ""
    assert said == "fastgen: scene 3 of seed 0 failed: no room\n"


def test_every_file_of_the_layout_exists(dataset):
    assert len(list(dataset.glob("images/*/*.jpg"))) == 14
    for record in records(dataset):
        split, stem = record["split"], record["stem"]
        for name in (
            f"images/{split}/{stem}.jpg",
            f"damage/masks/{split}/{stem}.png",
            f"damage/yolo/{split}/{stem}.txt",
            f"imdg/labels/{split}/{stem}.txt",
        ):
            assert (dataset / name).is_file()
    manifest = json.loads((dataset / "dataset.json").read_text())
    assert sum(s["images"] for s in manifest["counts"].values()) == 14
    assert manifest["seed"] == 3
    assert manifest["renderer"]
    sheet = cv2.imread(str(dataset / "contact_sheet.png"))
    assert sheet is not None


def test_data_yaml_pairs_images_with_labels_as_trainers_do(dataset):
    for task, classes in (("imdg", 28), ("damage", 5), ("container", 1)):
        data = yaml.safe_load((dataset / task / "data.yaml").read_text())
        assert len(data["names"]) == data["nc"] == classes
        listed = (dataset / task / "classes.txt").read_text().splitlines()
        assert listed == list(data["names"].values())
        paired = set()
        for split in ("train", "val", "test"):
            # ultralytics 8.4 needs train and val, and stops at empty folders
            if split not in data:
                assert split == "test"
                continue
            # its check_det_dataset and img2label_paths also resolve the folder first
            images = list((dataset / task / data[split]).resolve().glob("*.jpg"))
            assert images
            for image in images:
                head, tail = str(image).rsplit("/images/", 1)
                label = Path(f"{head}/labels/{tail}").with_suffix(".txt")
                assert label.is_file()
                assert image.stat().st_ino == (dataset / "images" / tail).stat().st_ino
                paired.add(image)
        assert len(paired) == 14


def test_door_folders_contain_the_views_of_the_two_ends(dataset):
    for folder, camera in (("door", "Cr"), ("no_door", "Cl")):
        found = {path.relative_to(dataset / "images"): path for path in dataset.glob("images/*/*")}
        wanted = {at for at in found if at.stem.endswith(f"_{camera}")}
        listed = list(dataset.glob(f"door/*/{folder}/*"))
        assert wanted
        assert {Path(path.parts[-3], path.name) for path in listed} == wanted
        for path in listed:
            assert path.read_bytes() == found[Path(path.parts[-3], path.name)].read_bytes()


def test_all_views_of_a_scene_share_a_split(dataset):
    splits = {}
    for record in records(dataset):
        splits.setdefault(record["scene"]["index"], set()).add(record["split"])
    assert all(len(found) == 1 for found in splits.values())
    config = Config.preset()
    drawn = [split_of(config, 3, i) for i in range(2000)]
    assert drawn.count("train") / 2000 == pytest.approx(0.7, abs=0.05)


def test_scene_files_contain_the_scene(dataset):
    for record in records(dataset)[:3]:
        scene = Scene.from_json(json.dumps(record["scene"]))
        assert record["stem"].startswith(f"s3_{scene.index:06d}_")


def test_one_worker_makes_the_same_bytes_as_two(dataset, tmp_path):
    out = tmp_path / "out"
    assert main(["generate", str(out), *ARGUMENTS, "--workers", "1"]) == 0
    assert content(out) == content(dataset)


def test_contact_sheet_shows_every_image_of_a_small_dataset(dataset):
    sheet = cv2.imread(str(dataset / "contact_sheet.png"))
    assert sheet.shape == (3 * 333, 6 * 400, 3)  # images of 96x80, without gaps
    tiles = sheet.reshape(3, 333, 6, 400, 3).swapaxes(1, 2).reshape(-1, 333 * 400 * 3)
    assert sum(np.ptp(tile) > 0 for tile in tiles) == 14


def test_crops_show_the_text_of_their_labels(tmp_path):
    out = tmp_path / "out"
    arguments = ["--images", "3", "--size", "640x480", "--cameras", "Cl", "--split", "val"]
    with no_workers():
        assert main(["generate", str(out), *arguments, "--seed", "3"]) == 0
    labels = dict(
        line.split("\t") for line in (out / "text/val/labels.txt").read_text().splitlines()
    )
    assert labels
    assert set(labels) == {p.name for p in (out / "text/val").glob("*.png")}
    for name, text in labels.items():
        stem, instance = name.removesuffix(".png").rsplit("_", 1)
        record = json.loads((out / f"scenes/val/{stem}.json").read_text())
        (shown,) = [
            o
            for o in record["objects"]
            if o["class_name"] == "text" and o["instance"] == int(instance)
        ]
        assert shown["text"] == text
        x0, y0, x1, y1 = shown["bbox"]
        crop = cv2.imread(str(out / "text/val" / name)).astype(int)
        image = cv2.imread(str(out / f"images/val/{stem}.jpg")).astype(int)
        inside = crop[3 : 3 + y1 - y0, 3 : 3 + x1 - x0]
        assert np.abs(inside - image[y0:y1, x0:x1]).mean() < 6  # the image went through JPEG
    assert main(["verify", str(out)]) == 0


@pytest.mark.parametrize(
    "lost",
    ["scenes/*/*.json", "images/*/*.jpg", "imdg/*/*/*", "damage/*/*/*", "damage/*.json", "door/*"],
)
def test_running_again_restores_what_is_missing(dataset, tmp_path, lost):
    out = tmp_path / "out"
    shutil.copytree(dataset, out, symlinks=True)
    for path in sorted(out.glob(lost))[::5]:
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert run(out) == 0
    assert content(out) == content(dataset)


def test_a_killed_run_is_finished_to_the_same_bytes(dataset, whole, tmp_path):
    out = tmp_path / "out"
    process = begun(out, *WHOLE, shards=2)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate(timeout=300)
    assert "digest" not in json.loads((out / "dataset.json").read_text())
    assert run(out, *MANY) == 0
    assert content(out) == content(whole)
    images = {k: v for k, v in content(dataset).items() if k.startswith("images")}
    assert images.items() <= content(out).items()


def test_a_stray_file_is_not_taken_for_a_shard(dataset, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(dataset, out, symlinks=True)
    (out / "shards/notes.txt").write_text("mine")
    assert run(out) == 0
    assert (out / "shards/notes.txt").read_text() == "mine"
    for number in (0, 7, 999_999, 1_000_000):
        assert shard_of(manifest_path(number)) == number
    for astray in (
        "shards/notes.txt",
        "shards/7.json",
        "shards/0000007.json",
        "images/000007.json",
    ):
        assert shard_of(astray) is None


def test_more_images_extend_a_dataset(dataset, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(dataset, out, symlinks=True)
    before = content(out / "images")
    assert run(out, "--images", "17") == 0
    after = content(out / "images")
    assert len(after) == 17
    assert before.items() <= after.items()


@needs_osmesa
def test_a_dataset_rendered_by_two_backends_is_reported(tmp_path, capfd):
    quick = ["--size", "64x64", "--quality", "draft", "--cameras", "A"]
    command = ["generate", str(tmp_path / "out"), *quick, "--shard", "1", "--images"]
    assert main([*command, "1", "--backend", "egl"]) == 0
    assert "was drawn by" not in capfd.readouterr().err
    assert main([*command, "2", "--backend", "osmesa"]) == 0
    assert re.search(r"was rendered by egl \S.* and by osmesa \S.*, which", capfd.readouterr().err)


def test_verify_passes_an_intact_dataset(dataset):
    assert main(["verify", str(dataset)]) == 0


def cut(path):
    path.write_bytes(path.read_bytes()[:-2])


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("images/*/*.jpg", lambda p: p.write_bytes(b"no jpeg")),
        ("images/*/*.jpg", cut),
        ("imdg/images/*/*.jpg", lambda p: p.write_bytes(b"no jpeg")),
        ("door/*/*/*.jpg", Path.unlink),
        ("damage/masks/*/*.png", Path.unlink),
        ("damage/masks/*/*.png", lambda p: p.write_bytes(p.read_bytes()[:60])),
        ("damage/yolo/*/*.txt", lambda p: p.write_text("0 0.1 0.1 0.2 0.1 0.2 1.1\n")),
        ("damage/coco_train.json", lambda p: p.write_text(p.read_text().replace('a":', 'a":1'))),
        ("imdg/labels/*/*.txt", lambda p: p.write_text("3 1.2 0 0 0\n")),
        ("imdg/labels/*/*.txt", lambda p: p.write_text("")),
        ("imdg/data.yaml", Path.unlink),
        ("text/train/labels.txt", lambda p: p.write_text("a.png\tABC\n")),
        ("scenes/*/*.json", lambda p: p.write_text("{}")),
        ("scenes/*/*.json", lambda p: p.write_text("[]")),
        ("images/train", shutil.rmtree),
    ],
)
def test_verify_names_the_damaged_file(dataset, tmp_path, capsys, name, spoil):
    out = tmp_path / "out"
    shutil.copytree(dataset, out, symlinks=True)
    spoilt = sorted(out.glob(name))[0]
    spoil(spoilt)
    assert main(["verify", str(out)]) == 1
    assert spoilt.relative_to(out).as_posix() in capsys.readouterr().out


def run_inside(job, tasks, on_report):
    """Do all tasks in this process."""
    maker = Maker(job, False, on_report)
    for task in tasks:
        maker(task)


def test_a_scene_that_always_fails_is_reported_and_the_rest_is_made(tmp_path, capfd, monkeypatch):
    asked = []

    class Broken(Generator):
        def render(self, *, scene, camera, normals):
            asked.append(scene.index)
            if scene.index == 1:
                raise RuntimeError("no such luck")
            return super().render(scene=scene, camera=camera, normals=normals)

    monkeypatch.setattr("fastgen.dataset.job.Generator", Broken)
    job = Job(str(tmp_path / "out"), 6, cameras=("A", "Cr"), render=SMALL)
    made = generate(job, 1, runner=run_inside)
    assert asked.count(1) == 3
    (failed,) = made["failed"]
    assert (failed["scene"], failed["seed"]) == (1, 0)
    assert "no such luck" in failed["error"]
    assert sum(split["images"] for split in made["counts"].values()) == 4
    assert "Traceback" in capfd.readouterr().err
    assert main(["verify", str(tmp_path / "out")]) == 1
    assert "scene 1 is missing: it failed" in capfd.readouterr().out
    # a later run tries again
    monkeypatch.undo()
    assert generate(job, 1, runner=run_inside)["failed"] == []
    assert main(["verify", str(tmp_path / "out")]) == 0


def test_a_run_whose_scenes_all_fail_still_ends_normally(tmp_path, monkeypatch):
    class Broken(Generator):
        def render(self, **_):
            raise RuntimeError("no such luck")

    monkeypatch.setattr("fastgen.dataset.job.Generator", Broken)
    job = Job(str(tmp_path / "out"), 2, cameras=("A",), render=SMALL)
    made = generate(job, 1, runner=run_inside)
    assert [each["scene"] for each in made["failed"]] == [0, 1]
    assert json.loads((tmp_path / "out/dataset.json").read_text())["failed"] == made["failed"]


def test_a_long_run_stops_when_its_first_scenes_all_fail(tmp_path, monkeypatch):
    asked = []

    class Broken(Generator):
        def render(self, *, scene, **_):
            asked.append(scene.index)
            raise RuntimeError("no such luck")

    monkeypatch.setattr("fastgen.dataset.job.Generator", Broken)
    job = Job(str(tmp_path / "out"), 1000, cameras=("A",), render=SMALL)
    with pytest.raises(OutputError, match=r"first 8 scenes of a process failed.*no such luck"):
        generate(job, 1, runner=run_inside)
    assert sorted(set(asked)) == list(range(8))


def test_a_second_run_on_the_same_folder_is_refused(dataset, tmp_path, capsys):
    out = tmp_path / "out"
    shutil.copytree(dataset, out)
    with storage_of(out).locked():
        assert run(out) == 2
    assert "another run uses this folder" in capsys.readouterr().err
    assert run(out) == 0


def test_ctrl_c_stops_cleanly_and_the_run_can_be_continued(whole, tmp_path):
    out = tmp_path / "out"
    process = begun(out, *WHOLE, shards=2)
    os.killpg(process.pid, signal.SIGINT)
    error = process.communicate(timeout=300)[1]
    assert process.returncode == 130
    assert error.splitlines()[-1] == "fastgen: stopped; run the same command again to go on"
    assert "Traceback" not in error
    assert not [p for p in out.iterdir() if p.name.startswith(".")]
    assert run(out, *MANY) == 0
    assert content(out) == content(whole)


@pytest.mark.parametrize("seed", range(12))
def test_verify_finds_any_single_flipped_byte(dataset, tmp_path, capsys, seed):
    out = tmp_path / "out"
    shutil.copytree(dataset, out)
    rng = np.random.default_rng(seed)
    files = sorted(p for p in out.rglob("*") if p.is_file() and p.stat().st_size)
    path = out / "dataset.json" if seed < 3 else files[rng.integers(len(files))]
    data = bytearray(path.read_bytes())
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    path.unlink()
    path.write_bytes(data)
    code = main(["verify", str(out)])
    said = capsys.readouterr()
    assert code > 0
    assert path.name in said.out + said.err


def test_stats_counts_the_labels_in_the_files(dataset, capsys):
    assert main(["stats", str(dataset)]) == 0
    printed = capsys.readouterr().out
    row = next(line for line in printed.splitlines() if line.startswith("container"))
    assert sum(int(v) for v in row.split()[1:]) == 14


def test_split_option_puts_all_images_in_one_split(tmp_path):
    out = tmp_path / "out"
    arguments = ["--images", "2", "--size", "64x64", "--cameras", "Cr", "--split", "val"]
    with no_workers():
        assert main(["generate", str(out), *arguments]) == 0
    assert len(list(out.glob("images/val/*.jpg"))) == 2
