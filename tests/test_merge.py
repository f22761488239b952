"""`fastgen merge`: merged datasets are complete, consistent and readable by foreign readers."""

import hashlib
import io
import json
import re
import shutil
import signal
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest
import webdataset
import yaml
from PIL import Image
from pycocotools.coco import COCO

from fastgen.cli.main import main
from fastgen.dataset.merge import merge
from fastgen.dataset.seal import seal
from fastgen.dataset.storage import Folder
from fastgen.formats.format import Format
from fastgen.formats.registry import known_formats
from tests.folders import content

pytestmark = pytest.mark.usefixtures("no_workers")

SPLITS = ("train", "val", "test")
ALSO = ["--also", "voc,text_parts,kitti"]
COUNTS = {1: 6, 2: 9}
"""Number of images by seed."""


def generate(out, seed, *more):
    command = ["generate", str(out), "--images", str(COUNTS.get(seed, 4)), "--seed", str(seed)]
    assert main([*command, "--workers", "1", *more]) == 0
    return out


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Two datasets with the same classes and different configurations.

    The names of the first lack the seed.
    """
    folder = tmp_path_factory.mktemp("sources")
    (folder / "damaged.yaml").write_text("damage: {probability: 1.0}\n")
    size = ["--size", "640x480"]
    first = generate(folder / "first", 1, *ALSO, *size, "--stems", "short")
    second = generate(folder / "second", 2, *ALSO, "--config", str(folder / "damaged.yaml"), *size)
    return first, second


@pytest.fixture(scope="module")
def merged(sources, tmp_path_factory):
    out = tmp_path_factory.mktemp("merged") / "out"
    before = [content(each) for each in sources]
    assert main(["merge", *map(str, sources), str(out)]) == 0
    assert [content(each) for each in sources] == before
    return out


@pytest.fixture(scope="module")
def tars(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tars")
    options = ["--size", "96x80", "--format", "webdataset", "--shard", "1"]
    stems = {1: ("--stems", "short"), 2: ()}
    return [generate(folder / str(seed), seed, *options, *stems[seed]) for seed in COUNTS]


def pixels(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_merged_dataset_passes_verify(merged, capsys):
    assert main(["verify", str(merged)]) == 0
    assert capsys.readouterr().out == f"{merged}: whole and consistent\n"


def test_no_image_is_lost_and_names_begin_with_the_seed(sources, merged):
    images = {
        path.relative_to(merged).as_posix(): pixels(path) for path in merged.glob("images/*/*")
    }
    theirs = [pixels(path) for each in sources for path in each.glob("images/*/*")]
    assert sorted(images.values()) == sorted(theirs)
    stems = Counter(re.match(r"s(\d+)_\d{6}_[A-Za-z]+\.jpg", Path(path).name)[1] for path in images)
    assert stems == {str(seed): count for seed, count in COUNTS.items()}
    for folder in ("scenes", "imdg/labels", "imdg/images", "damage/masks", "kitti/*/label_2"):
        found = [path.stem for path in merged.glob(f"{folder}/**/*") if path.is_file()]
        found = found or [path.stem for path in merged.glob(f"{folder}/*")]
        assert sorted(found) == sorted(Path(path).stem for path in images), folder


def test_files_share_their_disk_space_with_the_sources(sources, merged):
    inodes = {path.stat().st_ino for each in sources for path in each.glob("images/*/*")}
    assert {path.stat().st_ino for path in merged.glob("images/*/*")} == inodes


def test_label_files_name_the_renamed_image(merged):
    for path in merged.glob("scenes/*/*.json"):
        assert json.loads(path.read_text())["stem"] == path.stem
    annotations = list(merged.glob("voc/Annotations/*.xml"))
    assert len(annotations) == sum(COUNTS.values())
    for path in annotations:
        assert ElementTree.parse(path).findtext("filename") == f"{path.stem}.jpg"


@pytest.mark.parametrize("task", ["damage", "imdg", "container"])
def test_coco_files_have_unique_ids_and_the_annotations_of_the_sources(sources, merged, task):
    def annotations(root):
        """Return the annotations of each image by its content, as pycocotools finds them."""
        found = {}
        for split in SPLITS:
            coco = COCO(str(root / task / f"coco_{split}.json"))
            data = coco.dataset
            for kind in ("images", "annotations"):
                ids = [each["id"] for each in data[kind]]
                assert len(set(ids)) == len(ids)
            for number, image in coco.imgs.items():
                listed = [
                    {key: value for key, value in each.items() if key not in ("id", "image_id")}
                    for each in coco.loadAnns(coco.getAnnIds(number))
                ]
                found[split, pixels(root / image["file_name"])] = listed
        return found

    one, two = map(annotations, sources)
    assert len(one) + len(two) == sum(COUNTS.values())
    assert annotations(merged) == one | two
    assert sum(map(len, one.values())) > 0 < sum(map(len, two.values()))


def test_yolo_labels_are_found_as_trainers_find_them(sources, merged):
    data = yaml.safe_load((merged / "imdg/data.yaml").read_text())
    one, two = (yaml.safe_load((each / "imdg/data.yaml").read_text()) for each in sources)
    assert data["names"] == one["names"]
    assert {key for key, folder in data.items() if folder == f"images/{key}"} == {
        key for each in (one, two) for key, folder in each.items() if folder == f"images/{key}"
    }
    labels = {
        pixels(path): (each / "imdg/labels" / path.parent.name / f"{path.stem}.txt").read_text()
        for each in sources
        for path in each.glob("imdg/images/*/*.jpg")
    }
    for split in SPLITS:
        folder = data.get(split, f"images/{split}")
        for image in (merged / "imdg" / folder).resolve().glob("*.jpg"):
            head, tail = str(image).rsplit("/images/", 1)
            label = Path(f"{head}/labels/{tail}").with_suffix(".txt")
            assert label.read_text() == labels.pop(pixels(image))
    assert not labels


@pytest.mark.parametrize("task", ["text", "text_parts"])
def test_crops_keep_their_texts(sources, merged, task):
    def texts(root):
        return Counter(
            (split, pixels(root / task / split / name), *words)
            for split in SPLITS
            for line in (root / task / split / "labels.txt").read_text().splitlines()
            for name, *words in [line.split("\t")]
        )

    assert texts(merged) == texts(sources[0]) + texts(sources[1])
    assert texts(merged)
    listed = [name for each in merged.glob(f"{task}/*/labels.txt") for name in each.open()]
    assert len(list(merged.glob(f"{task}/*/*.png"))) == len(listed)


def test_stats_of_a_merged_dataset_are_the_sums(sources, merged, capsys):
    def numbers(root):
        assert main(["stats", str(root), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    one, two, both = (numbers(root) for root in (*sources, merged))

    def total(key, *names):
        parts = [each[key] for each in (one, two)]
        for name in names:
            parts = [part[name] for part in parts]
        return {split: parts[0][split] + parts[1][split] for split in SPLITS}

    assert both["images"] == total("images")
    assert both["damaged_images"] == total("damaged_images")
    for task in ("damage", "imdg"):
        assert list(both[task]) == list(one[task])
        for name, counts in both[task].items():
            assert counts == total(task, name)
    count = sum(both["images"].values())
    texts = sum(both["imdg"]["text"].values())
    assert both["texts_per_image"] == pytest.approx(texts / count)
    assert main(["stats", str(merged)]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["container", *(str(both["damage"]["container"][split]) for split in SPLITS)] in rows
    shown = next(row for row in rows if row[:2] == ["markers", "width"])[2:]
    assert [float(v) for v in shown] == pytest.approx(both["box_sizes"]["imdg"]["width"], abs=1e-4)


def test_dataset_json_says_what_was_merged(sources, merged):
    manifests = [json.loads((each / "dataset.json").read_text()) for each in (*sources, merged)]
    *theirs, ours = manifests
    assert [each["seed"] for each in ours["merged_from"]] == [1, 2]
    for made_with, manifest in zip(ours["merged_from"], theirs, strict=True):
        for key in ("config", "version", "size", "quality", "cameras", "images"):
            assert made_with[key] == manifest[key]
    assert "seed" not in ours
    assert ours["images"] == sum(COUNTS.values())


def test_a_merged_dataset_can_be_merged_again(merged, tmp_path):
    third = generate(tmp_path / "third", 3, *ALSO, "--size", "160x120")
    assert main(["merge", str(merged), str(third), str(tmp_path / "out")]) == 0
    assert main(["verify", str(tmp_path / "out")]) == 0
    stems = {path.stem for path in (tmp_path / "out").glob("images/*/*")}
    assert stems > {path.stem for path in merged.glob("images/*/*")}
    assert len(stems) == sum(COUNTS.values()) + 4
    made_with = json.loads((tmp_path / "out/dataset.json").read_text())["merged_from"]
    assert [each["seed"] for each in made_with] == [1, 2, 3]


def test_webdataset_shards_are_merged(tars, tmp_path):
    def samples(root):
        """Return the files of each sample without its name, as webdataset reads them."""
        found = {}
        for path in sorted(root.glob("*.tar")):
            for sample in webdataset.WebDataset(str(path), shardshuffle=False):
                stem = sample["__key__"]
                scene = json.loads(sample.pop("json"))
                assert scene.pop("stem") == stem
                Image.open(io.BytesIO(sample["jpg"])).verify()
                files = {key: sample[key] for key in sample if not key.startswith("__")}
                assert stem not in found
                found[stem] = {**files, "json": json.dumps(scene)}
        return found

    out = tmp_path / "out"
    assert main(["merge", *map(str, tars), str(out)]) == 0
    assert main(["verify", str(out)]) == 0
    ours, theirs = samples(out), [each for root in tars for each in samples(root).values()]
    assert len(ours) == sum(COUNTS.values())
    assert sorted(ours.values(), key=repr) == sorted(theirs, key=repr)
    assert {stem.split("_")[0] for stem in ours} == {"s1", "s2"}


def changed(copy, **values):
    """Replace values in a dataset.json."""
    path = copy / "dataset.json"
    manifest = {**json.loads(path.read_bytes()), **values}
    del manifest["digest"]
    path.write_bytes(seal(json.dumps(manifest, indent=1).encode()))


def other_classes(copy):
    classes = json.loads((copy / "dataset.json").read_bytes())["classes"]
    changed(copy, classes={**classes, "imdg": [*classes["imdg"], "lithium_battery"]})


def flipped(copy):
    path = next(copy.glob("damage/masks/*/*.png"))
    path.write_bytes(path.read_bytes()[:-1] + b"x")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda c: changed(c, seed=2), "{other} and {copy}: both contain s2_000000_A; both have"),
        (other_classes, r"{copy}: its classes of the imdg task .* {other} \(lithium_battery\)"),
        (lambda c: changed(c, formats=["damage", "imdg"]), "{copy}: has the formats damage, imdg,"),
        (lambda c: changed(c, format="webdataset"), "{copy}: has the format webdataset, {other}"),
        (lambda c: (c / "dataset.json").unlink(), "{copy}: no readable dataset.json"),
        (
            lambda c: (c / "dataset.json").write_text("{"),
            "{copy}: is damaged; run fastgen verify",
        ),
        (lambda c: (c / "dataset.json").write_text("{}"), "{copy}: the dataset is not finished"),
        (lambda c: next(c.glob("images/*/*")).unlink(), "{copy}: images/.* is missing or was chan"),
        (
            lambda c: (c / "shards/000000.json").write_text("{}"),
            "{copy}: shards/000000.json is mis",
        ),
        (flipped, "{copy}: damage/masks/.* run fastgen verify {copy} --repair"),
    ],
)
def test_datasets_that_do_not_fit_are_refused_and_nothing_is_left(
    sources, tmp_path, capsys, spoil, words
):
    other, copy = sources[1], tmp_path / "copy"
    shutil.copytree(sources[0], copy)
    spoil(copy)
    assert main(["merge", str(other), str(copy), str(tmp_path / "out")]) == 2
    assert re.match("fastgen: " + words.format(copy=copy, other=other), capsys.readouterr().err)
    assert [path.name for path in tmp_path.iterdir()] == ["copy"]


def test_bad_places_are_refused(sources, tmp_path, capsys):
    first, second = map(str, sources)
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine").write_text("x")
    (tmp_path / "file").write_text("x")
    for arguments, words in [
        ([first, str(tmp_path / "out")], "is only one dataset"),
        ([first, first, str(tmp_path / "out")], "is given twice"),
        ([first, second, str(full)], "is not empty"),
        ([first, second, str(tmp_path / "file")], "is not a folder"),
        ([first, second, f"{first}/images/new"], f"is inside {first}"),
        ([first, "s3://bucket/x", str(tmp_path / "out")], "is an address"),
        ([first, second, "s3://bucket/x"], "is an address"),
    ]:
        assert main(["merge", *arguments]) == 2
        assert words in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "full"]


def test_names_without_an_image_that_occur_twice_are_refused(tmp_path, capsys, monkeypatch):
    # a format that names files by number, and does not say how numbers change
    monkeypatch.setattr(type(known_formats()["bop"]), "renumbered", Format.renumbered)
    options = ["--size", "64x64", "--cameras", "A", "--also", "bop"]
    made = [generate(tmp_path / str(seed), seed, *options) for seed in (5, 6)]
    assert main(["merge", *map(str, made), str(tmp_path / "out")]) == 2
    assert re.search("5 and .*6: both contain bop/.*generate both without", capsys.readouterr().err)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_a_merge_that_stops_leaves_nothing(sources, tmp_path, monkeypatch, stop):
    calls = []
    adopt = Folder.adopt

    def adopt_some(*arguments):
        calls.append(arguments)
        if len(calls) == 40:
            raise stop
        adopt(*arguments)

    monkeypatch.setattr(Folder, "adopt", adopt_some)
    assert main(["merge", *map(str, sources), str(tmp_path / "out")]) in (2, 128 + signal.SIGINT)
    assert len(calls) == 40
    assert not list(tmp_path.iterdir())


def test_what_a_killed_merge_left_does_not_get_into_the_next(sources, merged, tmp_path):
    left = tmp_path / ".out.merging"
    (left / "images/train").mkdir(parents=True)
    (left / "images/train/s9_000000_A.jpg").write_bytes(b"x")
    (left / "dataset.json").write_text("{}")
    merge([str(each) for each in sources], str(tmp_path / "out"))
    assert content(tmp_path / "out") == content(merged)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_generate_and_repair_refuse_a_merged_dataset(sources, tmp_path, capsys):
    out = tmp_path / "out"
    merge([str(each) for each in sources], str(out))
    assert main(["generate", str(out), "--images", "20", "--seed", "1"]) == 2
    assert "was merged from other datasets" in capsys.readouterr().err
    next(out.glob("images/*/*.jpg")).unlink()
    assert main(["verify", str(out), "--repair"]) == 2
    assert "repair the datasets it was merged from" in capsys.readouterr().err
