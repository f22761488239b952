"""The recipes of docs/recipes.md, run as printed, and their results compared with other files."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from pycocotools import mask as coco_mask

from fastgen.cli.main import main
from fastgen.dataset.job import LAYOUTS
from fastgen.formats.registry import known_formats

pytestmark = pytest.mark.usefixtures("no_workers")

PAGE = (Path(__file__).parents[1] / "docs/recipes.md").read_text()
SIZE = (320, 240)
ARGUMENTS = ["--images", "8", "--size", "320x240", "--seed", "5", "--split", "0.5,0.5,0"]


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """The dataset in each layout, by the name that the page gives its folder."""
    folder = tmp_path_factory.mktemp("recipes")
    made = {"OUT": ["--also", "obb,coco,hub,semantic,voc,kitti,bop,depth,ids,normals"]}
    made["OUT_TARS"] = ["--format", "webdataset", "--also", "ids"]
    made["OUT_PARQUET"] = ["--format", "parquet", "--also", "ids"]
    for name, more in made.items():
        out = folder / name.lower()
        fast = ["--quality", "draft", "--workers", "1"]
        assert main(["generate", str(out), *ARGUMENTS, *fast, *more]) == 0
        made[name] = out
    return made


@pytest.fixture(scope="module")
def crops(tmp_path_factory):
    """A dataset with crops of texts and seals, which need more pixels."""
    out = tmp_path_factory.mktemp("crops") / "out"
    options = ["--images", "4", "--size", "720x540", "--seed", "5", "--cameras", "Cr"]
    options += ["--tasks", "text", "--also", "text_parts,seal", "--split", "train"]
    options += ["--set", "seals.probability=0.8", "--quality", "draft", "--workers", "1"]
    assert main(["generate", str(out), *options]) == 0
    return out


@pytest.fixture
def recipe(places, monkeypatch, tmp_path):
    """A function that runs the code below a heading and returns its names."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_DATASETS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("datasets.config.HF_DATASETS_CACHE", tmp_path / "cache")

    def run(heading, **others):
        """Run a section; `others` has folders that take the place of those with the same name."""
        section = PAGE.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
        blocks = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
        assert blocks
        names: dict = {}
        for code in blocks:
            for name, place in {**places, **others}.items():
                code = re.sub(rf"\b{name}\b", str(place), code)
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
    for path, _, found in names["decals"]:
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


def test_labelformat(recipe, scenes):
    labels = recipe("labelformat")["labels"]
    assert {Path(each.image.filename).stem for each in labels} == scenes.keys()
    for each in labels:
        assert (each.image.width, each.image.height) == SIZE
        found = [thing.box for thing in each.objects if thing.category.name != "DontCare"]
        sides = [(box.xmin, box.ymin, box.xmax, box.ymax) for box in found]
        assert rounded(sides) == boxes(scenes[Path(each.image.filename).stem])


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


def test_crops(recipe, crops):
    names = recipe("Crops of texts and seals", OUT=crops)
    things = {
        (path.stem, thing["instance"]): thing
        for path in crops.glob("scenes/train/*.json")
        for thing in json.loads(path.read_text())["objects"]
        if thing["class_name"] == "text"
    }
    assert names["texts"]
    for name, picture, (text,) in names["texts"]:
        stem, instance = name.removesuffix(".png").rsplit("_", 1)
        thing = things[stem, int(instance)]
        assert text == thing["text"]
        x0, y0, x1, y1 = thing["bbox"]
        assert x1 - x0 <= picture.width <= x1 - x0 + 10
        assert y1 - y0 <= picture.height <= y1 - y0 + 10
    assert names["parts"]
    for name, picture, (role, text) in names["parts"]:
        stem, instance, named = name.removesuffix(".png").rsplit("_", 2)
        (part,) = (p for p in things[stem, int(instance)]["parts"] if p["role"] == role)
        assert (named, text) == (role, part["text"])
        assert picture.width > picture.height or role == "check"
    kinds = names["seals"].features["label"]
    assert kinds.names == ["open", "sealed"]
    assert [kinds.int2str(each) for each in names["seals"]["label"]] == [
        path.parent.name for path in sorted(crops.glob("seal/train/*/*.png"))
    ]


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


def test_opencv(recipe, scenes):
    names = recipe("OpenCV")
    assert {Path(name).stem for name in names["names"]} == scenes.keys()
    seen = 0
    for at, name in enumerate(names["names"]):
        scene, ids = scenes[Path(name).stem], names["ids"][at]
        damage, depth = names["damage"][at], names["depth_mm"][at]
        assert (ids.dtype, damage.dtype, depth.dtype) == (np.uint16,) * 3
        for thing in scene["objects"]:
            if thing["id"] < 100_000 and thing["bbox"] and thing["class_name"] != "container":
                image = damage if 200 <= thing["id"] < 600 else ids
                assert (image == thing["id"]).sum() == thing["area"]
                seen += 1
        container = damage > 0
        assert container.sum() == scene["objects"][0]["area"]
        view = {key: np.array(value) for key, value in scene["view"].items()}
        outer = np.array(np.meshgrid((-6900, 6900), (-1300, 1300), (0, 2950))).reshape(3, -1)
        z = (view["rotation"] @ outer + view["translation_mm"][:, None])[2]
        assert z.min() < depth[container].min() <= depth[container].max() < z.max()
        assert (depth[ids == 0] == 0).all()
        normals = names["normals"][at][container]
        lengths = np.linalg.norm(normals, axis=1)
        assert np.median(lengths) == pytest.approx(1, abs=0.02)
        assert (normals[:, 2] < 0.3).mean() > 0.99  # they face the camera
    assert seen > len(scenes)


def test_trimesh(recipe, places, scenes):
    outlines = recipe("trimesh")["outlines"]
    manifests = map(json.loads, map(Path.read_text, places["OUT"].glob("shards/*.json")))
    stems = {r["number"]: r["stem"] for manifest in manifests for r in manifest["records"]}
    assert {stems[image] for image, _ in outlines} == scenes.keys()
    for (image, _), pixels in outlines.items():
        box = scenes[stems[image]]["objects"][0]["amodal_bbox"]
        # centres of pixels are at whole numbers; wall profiles vary by some millimetres
        found = (*pixels.min(axis=0) + 0.5, *pixels.max(axis=0) + 0.5)
        np.testing.assert_allclose(found, box, atol=1.0)


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


def test_every_output_has_a_row_and_every_row_a_test():
    rows = [line.strip("|").split(" | ") for line in PAGE.splitlines() if line.startswith("| ")][2:]
    files = set(re.findall(r"\w+", " ".join(row[3] for row in rows)))
    assert {*known_formats(), *LAYOUTS} - {"seafront"} <= files
    sections = PAGE.split("\n## ")[1:]
    for reader, *_, checked in rows:
        if checked.strip() == "by hand":
            assert any(each.startswith(reader.strip()) for each in sections), reader
        else:
            assert callable(globals()[checked.strip(" `")])
    run = set(re.findall(r'recipe\("(.*?)"', Path(__file__).read_text()))
    assert run == {each.partition("\n")[0] for each in sections if "```python" in each}
