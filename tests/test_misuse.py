"""Command line under misuse: odd folders, damaged files and closed pipes."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pycocotools.coco import COCO

import fastgen
from fastgen.classes import SEGMENTATION_CLASSES
from fastgen.cli.main import main
from fastgen.dataset.contact_sheet import contact_sheet
from fastgen.errors import OutputError
from fastgen.formats.registry import SEAFRONT, formats_of
from fastgen.light.hdri import bundled_hdris
from tests.folders import content

pytestmark = pytest.mark.usefixtures("no_workers")

ARGUMENTS = ["--images", "6", "--size", "64x64", "--cameras", "A,Cr", "--seed", "3"]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "dataset"
    assert main(["generate", str(out), *ARGUMENTS, "--workers", "1"]) == 0
    return out


def flip(path):
    """Change one byte of a file without changing its name or size."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.unlink()
    path.write_bytes(data)


@pytest.mark.parametrize(
    "name",
    ["images/*/*.jpg", "shards/000000.json", "damage/coco_train.json", "scenes/*/*.json"],
)
def test_repair_restores_damage_that_resuming_cannot_see(dataset, copy, capsys, name):
    flip(sorted(copy.glob(name))[0])
    assert main(["generate", str(copy), *ARGUMENTS, "--workers", "1"]) == 0
    if "coco" not in name and "shards" not in name:  # every run rewrites these
        capsys.readouterr()
        assert main(["verify", str(copy)]) == 1
        assert f"fastgen verify {copy} --repair" in capsys.readouterr().out
    broken = name.startswith(("images", "scenes"))
    capsys.readouterr()
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert ("repaired: " in capsys.readouterr().out) == broken
    assert content(copy) == content(dataset)


@pytest.mark.parametrize(
    ("target", "fault"),
    [
        (".", "cannot be read (Is a directory)"),  # unreadable even for root
        ("nowhere", "missing"),
    ],
)
def test_verify_continues_after_an_unreadable_file(copy, capsys, target, fault):
    unreadable = copy / "shards" / "000000.json"
    unreadable.unlink()
    unreadable.symlink_to(target)
    (copy / "stray.txt").write_text("?")
    assert main(["verify", str(copy)]) == 1
    said = capsys.readouterr().out
    assert f"shards/000000.json: {fault}" in said
    assert "stray.txt: not part of the dataset" in said


def test_repair_keeps_unknown_files_and_refuses_a_changed_manifest(copy, capsys):
    (copy / "images/notes.txt").write_text("mine")
    assert main(["verify", str(copy), "--repair"]) == 0
    assert "images/notes.txt: not part of the dataset" in capsys.readouterr().out
    assert (copy / "images/notes.txt").read_text() == "mine"
    path = copy / "dataset.json"
    path.write_text(path.read_text().replace('"seed": 3', '"seed": 4'))
    assert main(["verify", str(copy), "--repair"]) == 2
    assert "dataset.json: was changed after it was written" in capsys.readouterr().err


@pytest.mark.parametrize("others", ["lights", "workers"])
def test_a_refused_repair_removes_nothing(copy, tmp_path, others):
    flip(next(copy.glob("images/*/*.jpg")))
    flip(next(copy.glob("scenes/*/*.json")))
    arguments = ["verify", str(copy), "--repair", "--workers", "1"]
    if others == "lights":  # the dataset was made without --hdri
        shutil.copy(bundled_hdris()["sky"], tmp_path / "mine.exr")
        arguments += ["--hdri", str(tmp_path)]
    else:
        arguments[-1] = "0"
    before = content(copy)
    assert main(arguments) == 2
    assert content(copy) == before


def test_repair_refuses_zero_workers_even_with_nothing_to_repair(dataset, capsys):
    assert main(["verify", str(dataset), "--repair", "--workers", "0"]) == 2
    assert capsys.readouterr().err == "fastgen: workers: 0 is out of range; give 1 to 1000000000\n"


def test_strange_files_among_the_images_do_not_stop_a_run(copy):
    for name in ("stray.jpg", "more_A.jpg", "Thumbs.db"):
        (copy / "images/train" / name).write_bytes(b"no image")
    next(copy.glob("images/*/s3_000000_A.jpg")).unlink()
    assert main(["generate", str(copy), *ARGUMENTS, "--workers", "1"]) == 0


def test_a_refused_device_changes_nothing(copy, tmp_path, capsys):
    before = content(copy)
    more = [*ARGUMENTS[2:], "--device-index", "99"]
    assert main(["generate", str(copy), "--images", "10", *more]) == 2
    assert "no device 99 among" in capsys.readouterr().err
    assert content(copy) == before
    next(copy.glob("images/*/s3_000000_A.jpg")).unlink()
    assert main(["verify", str(copy), "--repair", "--device-index", "99"]) == 2
    capsys.readouterr()
    assert main(["verify", str(copy)]) == 1
    report = capsys.readouterr().out
    assert "s3_000000_A.jpg: missing" in report
    assert "not finished" not in report
    assert main(["generate", str(tmp_path / "new"), "--images", "2", *more]) == 2
    assert content(tmp_path / "new") == {}


def test_resuming_with_a_folder_of_the_shipped_hdris_is_refused(copy, tmp_path, capsys):
    """HDRIs from a folder are drawn with equal weights, the shipped ones are not."""
    (tmp_path / "hdri").mkdir()
    for path in bundled_hdris().values():
        (tmp_path / "hdri" / path.name).symlink_to(path)
    command = ["generate", str(copy), "--images", "10", *ARGUMENTS[2:]]
    assert main([*command, "--hdri", str(tmp_path / "hdri")]) == 2
    error = capsys.readouterr().err
    assert re.search(r"made with other settings \(environments\.\w+\.weight was ", error)
    assert "to resume, repeat the old --hdri," in error


@pytest.mark.parametrize("line", ["-1 0.1 0.1 0.2 0.2 0.1 0.2", "1 nan 0.1 0.2 0.2 0.1 0.2", "9 x"])
def test_labels_that_the_contact_sheet_cannot_read_are_reported(copy, line):
    images = [(path.parent.name, path.stem) for path in copy.glob("images/*/*.jpg")]
    contact_sheet(copy, images, formats_of(SEAFRONT))
    next(copy.glob("damage/yolo/*/*.txt")).write_text(line)
    with pytest.raises(OutputError, match=f"label files is damaged; run fastgen verify {copy} --r"):
        contact_sheet(copy, images, formats_of(SEAFRONT))


def test_a_damaged_image_of_the_contact_sheet_is_named(copy, capsys):
    for path in copy.glob("images/*/*_A.jpg"):
        path.write_bytes(bytes(path.stat().st_size))
    assert main(["generate", str(copy), *ARGUMENTS, "--workers", "1"]) == 2
    error = capsys.readouterr().err
    assert "_A.jpg: the image or one of its label files is damaged; run fastgen verify" in error


def test_changed_settings_are_reported_with_both_values(copy, tmp_path, capsys):
    (tmp_path / "port.yaml").write_text("damage: {probability: 0.5}")
    for more, words in (
        (["--seed", "4"], "seed was 3, is now 4"),
        (["--also", "ids"], "formats was ["),
        (
            ["--config", str(tmp_path / "port.yaml")],
            "config.damage.probability was 0.4, is now 0.5",
        ),
    ):
        assert main(["generate", f"{copy}/", *ARGUMENTS, *more]) == 2
        error = capsys.readouterr().err
        assert f"fastgen: {copy}: was made with other settings ({words}" in error


def test_all_changed_settings_are_reported_with_their_options(copy, capsys):
    more = ["--seed", "4", "--quality", "draft", "--also", "ids", "--shard", "3", "--split", "val"]
    more += ["--set", "weather={fog_probability: 1, rain_probability: 1, wetness: 0.8}"]
    assert main(["generate", str(copy), *ARGUMENTS, *more, "--size", "80x64"]) == 2
    error = capsys.readouterr().err
    parts = error.partition("(")[2].partition("); to resume, repeat the old ")
    assert [each.split(" was ")[0] for each in parts[0].split("; ")] == [
        *("formats", "seed", "size", "quality", "shard_scenes"),
        *(f"config.split.{split}" for split in ("test", "train", "val")),
        *("config.weather.fog_probability", "config.weather.rain_probability"),
        "and 1 more",  # config.weather.wetness
    ]
    options = "--tasks, --also, --seed, --size, --quality, --shard, --split, --config, --set"
    assert parts[2].startswith(options)


def test_resuming_another_versions_dataset_names_that_version(copy, monkeypatch, capsys):
    words = f"install fastgen {fastgen.__version__} to resume, or give another folder"
    monkeypatch.setattr(fastgen, "__version__", "99.1.0")
    assert main(["generate", str(copy), *ARGUMENTS, "--seed", "4"]) == 2
    assert words in capsys.readouterr().err


def test_other_hdris_are_reported_with_their_option(copy, tmp_path, capsys):
    (tmp_path / "lights").mkdir()
    shutil.copy(bundled_hdris()["dawn"], tmp_path / "lights/mine.exr")
    assert main(["generate", str(copy), *ARGUMENTS, "--hdri", str(tmp_path / "lights")]) == 2
    error = capsys.readouterr().err
    assert "environments.city was {'sha256'" in error
    assert " more); to resume, repeat the old --hdri," in error


def test_reordered_formats_resume_and_other_formats_are_listed_in_full(tmp_path, capsys):
    run = ["generate", str(tmp_path / "out"), *ARGUMENTS, "--workers", "1", "--images", "1"]
    assert main([*run, "--also", "ids,depth"]) == 0
    assert main([*run, "--also", "depth,ids"]) == 0
    assert main([*run, "--also", "depth,ids,voc"]) == 2
    assert "'depth', 'ids'], is now" in (error := capsys.readouterr().err)
    assert "'depth', 'ids', 'voc'])" in error


@pytest.mark.parametrize("names", ["", "A,", "A,A"])
def test_empty_or_repeated_camera_names_are_refused(tmp_path, capsys, names):
    out = tmp_path / "out"
    assert main(["generate", str(out), "--images", "1", "--cameras", names]) == 2
    assert capsys.readouterr().err.startswith("fastgen: cameras: ")
    assert not out.exists()


def test_stats_equal_counts_from_pycocotools(dataset, capsys):
    assert main(["stats", str(dataset)]) == 0
    lines = capsys.readouterr().out.splitlines()
    table = lines[lines.index("Table 2: instances in the damage task") :]
    for number, name in enumerate(SEGMENTATION_CLASSES, start=1):
        row = next(line for line in table if line.startswith(name))
        held = [COCO(str(dataset / f"damage/coco_{s}.json")) for s in ("train", "val", "test")]
        assert row.split()[1:] == [
            str(len(each.getAnnIds(catIds=number, iscrowd=False))) for each in held
        ]


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda p: (p / "dataset.json").unlink(), "no readable dataset.json"),
        (lambda p: (p / "dataset.json").write_text("{}"), "the dataset is not finished"),
        (lambda p: (p / "dataset.json").write_text("{"), "is damaged; run fastgen verify"),
        (lambda p: (p / "shards/000000.json").unlink(), "is damaged; run fastgen verify"),
        (lambda p: (p / "shards/000000.json").write_text("[]"), "is damaged; run fastgen verify"),
    ],
)
def test_stats_of_an_incomplete_dataset_say_what_to_do(copy, capsys, spoil, words):
    spoil(copy)
    assert main(["stats", str(copy)]) == 2
    assert words in capsys.readouterr().err


def lock_is_a_folder(path):
    (path / ".lock").mkdir(parents=True)


def images_are_a_file(path):
    assert main(["generate", str(path), *ARGUMENTS, "--workers", "1"]) == 0
    shutil.rmtree(path / "images")
    (path / "images").write_text("")


def manifest_is_a_folder(path):
    (path / "dataset.json").mkdir(parents=True)


@pytest.mark.parametrize("spoil", [lock_is_a_folder, images_are_a_file, manifest_is_a_folder])
def test_an_unwritable_path_is_named_in_one_line(tmp_path, capsys, spoil):
    spoil(tmp_path / "out")
    capsys.readouterr()
    assert main(["generate", str(tmp_path / "out"), *ARGUMENTS, "--workers", "1"]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith(f"fastgen: {tmp_path / 'out'}")
    assert "cannot be" in error


@pytest.mark.parametrize("below", [".", "deeper/still"])
def test_a_dangling_link_is_reported(tmp_path, capsys, below):
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "unmounted")
    assert main(["generate", str(link / below), *ARGUMENTS, "--workers", "1"]) == 2
    error = capsys.readouterr().err
    words = f"fastgen: {link}: is a link to {tmp_path / 'unmounted'}, which does not exist"
    assert error.startswith(words)
    assert not (tmp_path / "unmounted").exists()


@pytest.mark.parametrize("arguments", [["stats", "{}"], ["verify", "{}"], ["generate", "--help"]])
def test_a_closed_pipe_is_no_error(dataset, arguments):
    filled = [each.format(dataset) for each in arguments]
    command = [sys.executable, "-m", "fastgen", *filled]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() in (0, 141)  # --help exits with 0


@pytest.mark.parametrize("arguments", [["stats", "{}"], ["config"]])
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_standard_output_is_reported(dataset, arguments, unbuffered):
    command = [sys.executable, "-m", "fastgen", *(each.format(dataset) for each in arguments)]
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            command,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        )
    assert done.returncode == 2
    assert done.stderr == "fastgen: standard output: No space left on device\n"


def test_closed_output_streams_do_not_stop_a_run(tmp_path):
    out = tmp_path / "out"
    run = ["generate", str(out), "--images", "1", "--size", "64x64", "--workers", "1"]
    command = ["sh", "-c", 'exec "$@" >&- 2>&-', "sh", sys.executable, "-m", "fastgen", *run]
    assert subprocess.run(command, check=False).returncode == 0
    assert main(["verify", str(out)]) == 0


def test_a_folder_may_have_a_name_that_is_not_utf_8(tmp_path):
    out = os.fsencode(tmp_path) + b"/caf\xe9"
    run = [b"generate", out, b"--images", b"1", b"--size", b"64x64", b"--workers", b"1"]
    for arguments, words in ((run, b"1 images in "), ([b"verify", out], b"whole and consistent")):
        command = [os.fsencode(sys.executable), b"-m", b"fastgen", *arguments]
        done = subprocess.run(command, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
        assert words in done.stdout
        assert b"caf\\udce9" in done.stdout


def test_show_takes_the_first_camera_of_a_rig(tmp_path):
    rig = {"gate": {"face": "door", "focal_mm": 40, "distance_mm": 6000}}
    (tmp_path / "port.yaml").write_text(json.dumps({"cameras": rig}))
    shown = ["--config", str(tmp_path / "port.yaml"), "--size", "64x64", "--index", "0"]
    assert main(["show", *shown, "-o", str(tmp_path / "gate.png")]) == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[]", "holds []; give keys with their values"),
        ("a text", "holds 'a text'; give keys"),
        ("3", "holds 3; give keys"),
        ("a: [1", "sequence (line 1, column 4): expected ',' or ']', but got '<stream end>' ("),
        ("a: \0", "special characters are not allowed at position 3"),
        ("surface: {rust_coverage: '1e-2'}", "write 0.01"),
        ("day: 2026-99-99", "'2026-99-99' is not of the type timestamp (line 1, column 6)"),
        ("a: &a [*a]", "a: unknown key"),
    ],
)
def test_malformed_config_files_are_named(tmp_path, capsys, text, words):
    path = tmp_path / "port.yaml"
    path.write_text(text)
    arguments = ["--config", str(path), "--index", "0", "-o", str(tmp_path / "x.png")]
    assert main(["show", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"fastgen: {path}: ")
    assert words in error
    assert "<unicode string>" not in error


@pytest.mark.parametrize("command", ["generate", "show", "export", "stats", "verify", "merge"])
def test_the_page_on_commands_mentions_every_option(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    words = (Path(__file__).parent.parent / "docs" / "commands.md").read_text()
    for option in set(re.findall(r"--[a-z-]+", capsys.readouterr().out)) - {"--help"}:
        assert option in words, option
