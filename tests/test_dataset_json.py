"""Datasets with a lost, damaged or edited dataset.json; shard manifests identify their run."""

import json
import os
import shutil

import pytest

from fastgen.cli.main import main
from tests.folders import content

pytestmark = pytest.mark.usefixtures("no_workers")

ARGUMENTS = ["--images", "6", "--size", "64x64", "--cameras", "A,Cr", "--seed", "3"]
ONE_BY_ONE = ["--shard", "1", "--workers", "1"]


def run(out, *more):
    return main(["generate", str(out), *ARGUMENTS, *ONE_BY_ONE, *more])


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "dataset"
    assert run(out) == 0
    return out


def without(path):
    path.unlink()


def cut_short(path):
    path.write_bytes(path.read_bytes()[:100])


def emptied(path):
    path.write_text("{}")


def nested(path):
    path.write_text("[" * 100_000)


def unfinished(path, **more):
    late = ("backend", "renderer", "images", "counts", "failed", "files", "shards", "digest")
    said = json.loads(path.read_text())
    path.write_text(json.dumps({k: v for k, v in said.items() if k not in late} | more))


def with_odd_shards(path):
    unfinished(path, shards=None)


def with_another_seed(path):
    path.write_text(path.read_text().replace('"seed": 3', '"seed": 4'))


def unfinished_with_another_seed(path):
    unfinished(path, seed=4)


@pytest.mark.parametrize(
    "spoil",
    [
        *(without, cut_short, emptied, nested),
        *(with_another_seed, unfinished_with_another_seed, with_odd_shards),
    ],
)
def test_shard_manifests_identify_the_run_if_dataset_json_does_not(dataset, copy, capsys, spoil):
    spoil(copy / "dataset.json")
    written = {path: path.stat().st_mtime_ns for path in copy.glob("images/*/*.jpg")}
    before = content(copy)
    assert run(copy, "--seed", "4") == 2
    assert "made with other settings" in capsys.readouterr().err
    assert run(copy, "--images", "5") == 2
    assert "holds more than 5 images" in capsys.readouterr().err
    assert content(copy) == before
    assert run(copy) == 0
    assert content(copy) == content(dataset)
    assert {path: path.stat().st_mtime_ns for path in written} == written


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--shard", "2"], "shard_scenes was 1, is now 2"),
        (["--seed", "4"], "seed was 3, is now 4"),
        (["--size", "96x64"], "size was [64, 64], is now [96, 64]"),
        (["--quality", "draft"], "quality was 'balanced', is now 'draft'"),
        (["--cameras", "A"], "cameras was ['A', 'Cr'], is now ['A']"),
        (["--shard", "2", "--seed", "4"], "seed was 3, is now 4; shard_scenes was 1, is now 2"),
    ],
)
def test_shards_without_dataset_json_tell_which_options_to_repeat(copy, capsys, options, named):
    (copy / "dataset.json").unlink()
    before = content(copy)
    assert run(copy, *options) == 2
    error = capsys.readouterr().err
    assert f"was made with other settings ({named}); to resume, repeat the old --" in error
    assert all(option in error for option in options[::2])
    assert content(copy) == before


def test_an_unfinished_dataset_of_an_older_version_names_that_version(copy, capsys):
    path = copy / "dataset.json"
    unfinished(path, version="0.44.0")
    said = json.loads(path.read_text())
    for newer in ("stems", "coco_masks"):  # the oldest versions lack them
        del said[newer]
    path.write_text(json.dumps(said))
    for number in range(3):
        (copy / f"shards/{number:06d}.json").unlink()
    assert run(copy) == 2
    assert "install fastgen 0.44.0 to resume" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "values"),
    [("--stems", ("seed", "short")), ("--coco-masks", ("polygon", "rle"))],
)
def test_both_values_of_an_option_are_named_when_it_changes(tmp_path, capsys, option, values):
    name = option.removeprefix("--").replace("-", "_")
    for old, new in (values, values[::-1]):
        out = tmp_path / old
        assert run(out, option, old) == 0
        before = content(out)
        assert run(out, option, new) == 2
        error = capsys.readouterr().err
        assert f"({name} was {old!r}, is now {new!r}); to resume, repeat the old {option}" in error
        assert content(out) == before


def test_the_number_of_scenes_in_a_single_shard_follows_from_its_images(tmp_path, capsys):
    assert run(tmp_path, "--shard", "3") == 0
    (tmp_path / "dataset.json").unlink()
    assert run(tmp_path) == 2
    assert "(shard_scenes was 3, is now 1)" in capsys.readouterr().err


def test_options_that_shards_do_not_tell_are_asked_for(copy, capsys):
    (copy / "dataset.json").unlink()
    for options in (["--set", "damage.probability=0.3"], ["--also", "voc"]):
        assert run(copy, *options) == 2
        error = capsys.readouterr().err
        assert "repeat all options of that run, --shard and --hdri too, to resume" in error


@pytest.mark.parametrize("shard", ["1", "2", "4"])
def test_fewer_images_are_refused_without_dataset_json(tmp_path, capsys, shard):
    assert run(tmp_path, "--shard", shard) == 0
    (tmp_path / "dataset.json").unlink()
    before = content(tmp_path)
    assert run(tmp_path, "--shard", shard, "--images", "3") == 2
    assert "holds more than 3 images" in capsys.readouterr().err
    assert content(tmp_path) == before


@pytest.mark.parametrize("manifest", ["{}", "no json", "[1]", '{"settings": "x"}'])
def test_a_folder_that_only_looks_like_a_dataset_is_left_alone(tmp_path, capsys, manifest):
    (tmp_path / "shards").mkdir()
    (tmp_path / "shards/000000.json").write_text(manifest)
    (tmp_path / "link").symlink_to("nowhere")
    before = content(tmp_path / "shards")
    assert run(tmp_path) == 2
    assert "holds something else" in capsys.readouterr().err
    assert content(tmp_path / "shards") == before


def test_another_order_of_weighted_names_is_another_setting(tmp_path, capsys):
    kinds = {"20": 0.3, "40": 0.25, "40HC": 0.35, "45HC": 0.1}
    for name, order in (("one", kinds), ("other", dict(reversed(kinds.items())))):
        (tmp_path / f"{name}.yaml").write_text(json.dumps({"container": {"kinds": order}}))
    out = tmp_path / "out"
    assert run(out, "--config", str(tmp_path / "one.yaml")) == 0
    before = content(out)
    for lost in (False, True):
        if lost:
            before.pop("dataset.json")
            (out / "dataset.json").unlink()
        assert run(out, "--config", str(tmp_path / "other.yaml")) == 2
        assert content(out) == before
    assert "container.kinds was ['20', '40', " in capsys.readouterr().err


def test_a_changed_manifest_is_made_again(dataset, copy):
    (copy / "dataset.json").unlink()
    shutil.copy(copy / "shards/000002.json", copy / "shards/000001.json")
    path = copy / "shards/000000.json"
    path.write_text(path.read_text().replace('"category_id":1', '"category_id":2'))
    assert run(copy) == 0
    assert content(copy) == content(dataset)


@pytest.mark.parametrize(
    "also", [[], ["--also", "bop,kitti"], ["--format", "webdataset"], ["--format", "parquet"]]
)
def test_verify_reports_only_a_lost_manifest_and_stray_files(tmp_path, capsys, also):
    out = tmp_path / "out"
    assert run(out, *also) == 0
    whole = content(out)
    (out / "shards/000001.json").unlink()
    astray = ["000001_A.jpg", "notes.txt", "shards/000001.txt", "shards/000009.json"]  # sorted
    for name in astray:
        (out / name).write_text("mine")
    capsys.readouterr()
    assert main(["verify", str(out)]) == 1
    faults = [line for line in capsys.readouterr().out.splitlines() if ": " in line]
    assert [line.split(":")[0] for line in faults if "--repair" not in line] == [
        "shards/000001.json", *astray,
    ]  # fmt: skip
    assert main(["verify", str(out), "--repair", "--workers", "1"]) == 0
    assert all((out / name).read_text() == "mine" for name in astray)
    assert whole.items() <= content(out).items()


def test_an_interrupted_repair_can_be_continued(dataset, copy, capsys):
    shutil.rmtree(copy / "images")

    def stop(*_):
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fastgen.dataset.workers.run", stop)
        assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 130
    assert main(["verify", str(copy)]) == 1
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert content(copy) == content(dataset)


@pytest.mark.parametrize("command", [["verify"], ["verify", "--repair", "--workers", "1"]])
def test_a_linked_folder_is_refused_and_left_as_it_is(copy, tmp_path, capsys, command):
    """Files are renamed into place, which fails if the link leads to another disk."""
    shutil.move(copy / "images", tmp_path / "elsewhere")
    (copy / "images").symlink_to(tmp_path / "elsewhere")
    before = content(copy), content(tmp_path / "elsewhere")
    assert main([command[0], str(copy), *command[1:]]) == 2
    assert "images: is a link to a folder" in capsys.readouterr().err
    assert run(copy) == 2
    assert (content(copy), content(tmp_path / "elsewhere")) == before


def test_pipes_and_folders_in_place_of_files_are_reported_and_repaired(dataset, copy, capsys):
    empty = next(path for path in copy.rglob("*") if path.is_file() and not path.stat().st_size)
    image = next(copy.glob("images/*/*.jpg"))
    for path in (empty, image):
        path.unlink()
    os.mkfifo(empty)
    image.mkdir()
    assert main(["verify", str(copy)]) == 1
    said = capsys.readouterr().out
    assert f"{empty}: cannot be read (it is a named pipe, not a regular file)" in said
    assert f"{image.relative_to(copy)}: missing" in said
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert content(copy) == content(dataset)


def test_a_missing_config_key_is_reported_as_a_difference(copy, capsys):
    said = json.loads((copy / "dataset.json").read_text())
    said["config"]["cameras"]["A"].pop("lens")
    (copy / "dataset.json").write_text(json.dumps(said))
    unfinished(copy / "dataset.json")
    shutil.rmtree(copy / "shards")
    assert run(copy) == 2
    assert "(config.cameras.A.lens was missing, is now None)" in capsys.readouterr().err


def test_an_interrupted_extension_is_reported_as_unfinished(dataset, copy, tmp_path, capsys):
    assert main(["generate", str(tmp_path / "more"), *ARGUMENTS[2:], "--images", "8"]) == 0

    def fall(*_):
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fastgen.dataset.workers.run", fall)
        assert run(copy, "--images", "8") == 130
    capsys.readouterr()
    assert main(["verify", str(copy)]) == 1
    assert "dataset.json: the dataset is not finished" in capsys.readouterr().out
    assert main(["stats", str(copy)]) == 2
    written = {path: path.stat().st_mtime_ns for path in copy.glob("images/*/*.jpg")}
    assert run(copy, "--images", "8") == 0
    assert {path: path.stat().st_mtime_ns for path in written} == written
    images = {k: v for k, v in content(tmp_path / "more").items() if k.startswith("images")}
    assert {k: v for k, v in content(copy).items() if k.startswith("images")} == images


def test_verify_reports_a_dangling_link(copy, capsys):
    (copy / "images/link").symlink_to("nowhere")
    assert main(["verify", str(copy)]) == 0
    assert "images/link: not part of the dataset" in capsys.readouterr().out
    assert run(copy) == 0


def test_stats_refuse_a_changed_manifest(copy, capsys):
    path = copy / "shards/000001.json"
    path.write_text(path.read_text().replace('"split":"', '"split":"te'))
    assert main(["stats", str(copy)]) == 2
    assert "is damaged; run fastgen verify" in capsys.readouterr().err


def test_a_file_url_names_a_folder(dataset, tmp_path):
    assert run(f"file://{tmp_path}/out") == 0
    assert content(tmp_path / "out") == content(dataset)
