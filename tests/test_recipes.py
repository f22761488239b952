"""The recipes of docs/recipes.md, run as printed, and their results compared with other files."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from pycocotools import mask as coco_mask

from fastgen.cli.main import main

pytestmark = pytest.mark.usefixtures("no_workers")

PAGE = (Path(__file__).parents[1] / "docs/recipes.md").read_text()
SIZE = (320, 240)
ARGUMENTS = ["--images", "8", "--size", "320x240", "--seed", "5", "--split", "0.5,0.5,0"]


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """The dataset in each layout, by the name that the page gives its folder."""
    folder = tmp_path_factory.mktemp("recipes")
    made = {"OUT": ["--also", "obb,coco,hub,semantic,voc"]}
    made["OUT_TARS"] = ["--format", "webdataset", "--also", "ids"]
    made["OUT_PARQUET"] = ["--format", "parquet", "--also", "ids"]
    for name, more in made.items():
        out = folder / name.lower()
        fast = ["--quality", "draft", "--workers", "1"]
        assert main(["generate", str(out), *ARGUMENTS, *fast, *more]) == 0
        made[name] = out
    return made


@pytest.fixture
def recipe(places, monkeypatch, tmp_path):
    """A function that runs the code below a heading and returns its names."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_DATASETS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("datasets.config.HF_DATASETS_CACHE", tmp_path / "cache")

    def run(heading):
        section = PAGE.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
        blocks = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
        assert blocks
        names: dict = {}
        for code in blocks:
            for name in sorted(places, key=len, reverse=True):
                code = re.sub(rf"\b{name}\b", str(places[name]), code)
            exec(code, names)
        return names

    return run


@pytest.fixture(scope="module")
def scenes(places):
    """Content of the scene files of the split `train` by stem."""
    paths = places["OUT"].glob("scenes/train/*.json")
    found = {path.stem: json.loads(path.read_text()) for path in paths}
    assert found
    return found


def boxes(scene):
    """Return the boxes of everything that the marker task labels."""
    classes = re.compile(r"container|text|C\d\.\d")
    return sorted(
        tuple(thing["bbox"])
        for thing in scene["objects"]
        if thing["bbox"] and not thing["ignored"] and classes.fullmatch(thing["class_name"])
    )


def rounded(corners):
    return sorted(tuple(box) for box in np.rint(corners).astype(int).tolist())


def damage_mask(places, stem):
    return cv2.imread(str(places["OUT"] / f"damage/masks/train/{stem}.png"), -1)


def test_pycocotools(recipe, places):
    names = recipe("pycocotools")
    assert names["masks"]
    assert all(Path(path).is_file() for path in names["paths"])
    stems = {i["id"]: Path(i["file_name"]).stem for i in names["data"].dataset["images"]}
    for annotation, mask in zip(names["annotations"], names["masks"], strict=True):
        assert isinstance(annotation["segmentation"], list)  # many readers stop at run lengths
        truth = damage_mask(places, stems[annotation["image_id"]])
        category = annotation["category_id"]
        assert annotation["area"] == mask.sum()
        own = truth > 0 if category == 1 else truth // 100 == category
        assert not (mask.astype(bool) & ~own).any()
        if category == 1:
            assert (mask == own).all()


def test_supervision(recipe, scenes):
    names = recipe("supervision")
    assert {Path(path).stem for path in names["markers"].image_paths} == scenes.keys()
    for path, _, found in names["markers"]:
        assert rounded(found.xyxy) == boxes(scenes[Path(path).stem])
    labels = 0
    for path, _, found in names["damage"]:
        text = Path(path.replace("/images/", "/labels/")).with_suffix(".txt").read_text()
        labels += len(text.splitlines())
        assert len(found) == len(text.splitlines())
        assert all(mask.any() for mask in found.mask)
    assert labels >= len(scenes)
    seen = 0
    for path, _, found in names["prints"]:
        quads = [
            np.reshape(thing["quad"], (4, 2))
            for thing in scenes[Path(path).stem]["objects"]
            if thing["quad"] and thing["bbox"] and not thing["ignored"]
        ]
        assert len(found) == len(quads)
        inside = [quad for quad in quads if (quad >= 0).all() and (quad <= SIZE).all()]
        for quad in inside:
            off = np.abs(found.data["xyxyxyxy"] - quad).max(axis=(1, 2))
            assert off.min() < 0.01
        seen += len(inside)
    assert seen
    for path, _, found in names["voc"]:
        if Path(path).stem in scenes:
            wide = [b for b in boxes(scenes[Path(path).stem]) if b[2] - b[0] > 1 < b[3] - b[1]]
            # its corners count from 1, and difficult objects are listed too
            assert set(wide) <= set(rounded(found.xyxy))


def test_globox(recipe, scenes):
    names = recipe("globox")
    assert len(names["voc"]) == 8
    assert {Path(each.image_id).stem for each in names["yolo"]} == scenes.keys()
    for each in names["yolo"]:
        found = [(box.xmin, box.ymin, box.xmax, box.ymax) for box in each.boxes]
        assert rounded(found) == boxes(scenes[Path(each.image_id).stem])


def test_transformers(recipe):
    names = recipe("Transformers")
    (labels,) = names["inputs"]["labels"]
    wanted = [each for each in names["target"]["annotations"] if not each["iscrowd"]]
    assert len(labels["masks"]) == len(labels["boxes"]) == len(wanted) > 0
    scale = labels["size"].prod() / np.prod(SIZE)
    areas = [float(mask.sum() / scale) for mask in labels["masks"]]
    assert areas == pytest.approx([each["area"] for each in wanted], rel=0.02)


def test_segformer_and_mmsegmentation(recipe, places, scenes):
    names = recipe("SegFormer and mmsegmentation")
    assert len(names["masks"]) == len(scenes)
    listed = (places["OUT"] / "semantic/classes.txt").read_text().splitlines()
    assert list(names["names"].values()) == listed
    assert listed[:2] == ["background", "container"]
    for stem, mask in zip(sorted(scenes), names["masks"], strict=True):
        truth = damage_mask(places, stem) // 100
        assert mask.dtype == np.uint8
        sure = mask != 255
        own = truth > 0
        np.testing.assert_array_equal(mask[sure & own], truth[sure & own])
        assert mask[own & sure].max() < len(listed)
        assert set(np.unique(mask[~own])) <= {0, 1, 255}  # containers of the background
        assert (places["OUT"] / f"semantic/images/train/{stem}.jpg").is_file()


def test_datasets(recipe, scenes, places):
    names = recipe("datasets of Hugging Face")
    assert len(names["whole"]) == len(names["table"]) == len(scenes)
    stems = [Path(row["file_name"]).stem for row in metadata(places)]
    for stem, row in zip(stems, names["whole"], strict=True):
        assert row["image"].size == SIZE
        assert not set(boxes(scenes[stem])) - {corners(box) for box in row["imdg"]["bbox"]}
    assert {row["label"] for row in names["door"]} == {0, 1}
    for row in names["table"]:
        scene = scenes[row["stem"]]
        assert json.loads(row["scene"])["objects"] == scene["objects"]
        assert not set(boxes(scene)) - {corners(box) for box in row["imdg"]["bbox"]}
        kinds = names["table"].features["imdg"]["category"].feature
        named = {kinds.int2str(each) for each in row["imdg"]["category"]}
        assert "container" in named
        assert named <= {thing["class_name"] for thing in scene["objects"]}
        truth = damage_mask(places, row["stem"])
        np.testing.assert_array_equal(np.array(row["damage_png"]), truth)
        assert row["image"].size == SIZE
    streamed = {row["__key__"]: row for row in names["stream"]}
    assert streamed.keys() == scenes.keys()
    for stem, row in streamed.items():
        np.testing.assert_array_equal(np.array(row["damage.png"]), damage_mask(places, stem))
        assert row["imdg.txt"] == (places["OUT"] / f"imdg/labels/train/{stem}.txt").read_text()


def metadata(places):
    lines = (places["OUT"] / "images/train/metadata.jsonl").read_text().splitlines()
    return sorted(map(json.loads, lines), key=lambda row: row["file_name"])


def corners(box):
    x, y, width, height = box
    return int(x), int(y), int(x + width), int(y + height)


def test_webdataset(recipe, scenes):
    samples = list(recipe("webdataset")["samples"])
    assert {each["__key__"] for each in samples} == scenes.keys()
    members = {frozenset(each) for each in samples}
    assert len(members) == 1  # the loader of Hugging Face refuses other samples
    assert {"jpg", "json", "damage.png", "imdg.txt", "text.txt"} <= next(iter(members))


@pytest.mark.parametrize("task", ["imdg", "damage", "container"])
def test_folders_of_coco_name_images_beside_their_annotations(places, task):
    start = "person_keypoints" if task == "container" else "instances"
    folder = places["OUT"] / task
    content = json.loads((folder / f"annotations/{start}_train.json").read_text())
    plain = json.loads((folder / "coco_train.json").read_text())
    assert content["annotations"] == plain["annotations"]
    assert content["annotations"]
    for image in content["images"]:
        assert (folder / "images/train" / image["file_name"]).is_file()
    assert not list(folder.glob("annotations/*test*"))
    for each in content["annotations"]:
        mask = each["segmentation"]
        if not isinstance(mask, dict):
            mask = coco_mask.merge(coco_mask.frPyObjects(mask, *SIZE[::-1]))
            assert coco_mask.area(mask) == each["area"]


def test_pose_labels_are_the_keypoints_of_the_scene_files(places, scenes):
    seen = 0
    for stem, scene in scenes.items():
        text = (places["OUT"] / f"container/labels/train/{stem}.txt").read_text()
        rows = [np.array(line.split(), float) for line in text.splitlines()]
        own = [t for t in scene["objects"] if t["keypoints"] and t["class_name"] == "container"]
        own = [t for t in own if t["bbox"] and not t["ignored"]]
        assert len(rows) == len(own)
        for row, thing in zip(rows, own, strict=True):
            points = row[5:].reshape(8, 3) * (*SIZE, 1)
            np.testing.assert_allclose(points, thing["keypoints"], atol=1e-3)
            seen += 1
    assert seen


def test_mirrored_castings_change_sides():
    from fastgen.formats.container import _MIRRORED
    from fastgen.labels.objects import CASTINGS

    for number, other in enumerate(_MIRRORED):
        swapped = {"front": "back", "back": "front"}
        words = re.split(r"_(?=front|back|bottom|top)", CASTINGS[number])
        assert CASTINGS[other] == "_".join(swapped.get(word, word) for word in words)


def test_every_row_of_the_table_has_a_recipe_and_a_test():
    rows = [line.split(" | ") for line in PAGE.splitlines() if line.startswith("| ")][2:]
    assert len(rows) > 10
    headings = {
        "Pillow, for SegFormer and mmsegmentation": "SegFormer and mmsegmentation",
        "datasets": "datasets of Hugging Face",
        "datumaro": "datumaro, CVAT and FiftyOne",
    }
    for row in rows:
        reader, checked = row[0].removeprefix("| "), row[-1].removesuffix(" |")
        heading = headings.get(reader, reader)
        assert f"\n## {heading}\n" in PAGE
        test = f"test_{heading.lower().replace(' of hugging face', '').replace(' ', '_')}"
        assert (test in globals()) == (checked == "test"), reader
