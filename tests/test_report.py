"""`fastgen report`: its numbers, and its page read by another parser."""

import json
from collections import Counter

import cv2
import fsspec
import numpy as np
import pytest

from fastgen.classes import ALL_DETECTION_CLASSES
from fastgen.cli.main import main
from fastgen.dataset.finished import open_finished
from fastgen.report import content as content_module
from fastgen.report.advice import advice_on
from fastgen.report.content import report_content
from fastgen.report.labels import GRID, SIZE_EDGES_PX, label_table
from fastgen.report.looks import Look, near_duplicates
from fastgen.report.origin import nearest_preset, origins
from fastgen.report.page import write_report
from fastgen.report.views import Place, chosen_places
from tests.report_makers import Reader, make_dataset

pytestmark = pytest.mark.usefixtures("no_workers")


@pytest.fixture(scope="module")
def dataset(report_dataset):
    return report_dataset


@pytest.fixture(scope="module")
def found(dataset):
    return report_content(str(dataset))


def coco_boxes(folder, task):
    """Yield split, class name, image id and box of each label in a dataset's COCO files."""
    for split in ("train", "val", "test"):
        file = json.loads((folder / task / f"coco_{split}.json").read_text())
        names = {each["id"]: each["name"] for each in file["categories"]}
        for each in file["annotations"]:
            if not each["iscrowd"]:
                yield split, names[each["category_id"]], each["image_id"], each["bbox"]


def test_class_balance_equals_the_coco_files(dataset, found):
    for task in ("damage", "imdg"):
        wanted = Counter((split, name) for split, name, *_ in coco_boxes(dataset, task))
        assert wanted
        shown = {
            (split, each["name"]): number
            for each, row in zip(found["classes"], found["counts"], strict=True)
            for split, number in zip(found["splits"], row, strict=True)
            if each["task"] == task and number
        }
        assert shown == wanted


def test_images_with_damage_equal_the_coco_files(dataset, found):
    damaged = {
        (split, image)
        for split, name, image, _ in coco_boxes(dataset, "damage")
        if name != "container"
    }
    assert damaged
    assert sum(found["damaged"]["with"]) == len(damaged)
    assert sum(found["damaged"]["with"]) + sum(found["damaged"]["without"]) == 8


def test_occurrence_maps_equal_painted_boxes(dataset, found):
    painted = {}
    for _, name, _, (x, y, width, height) in coco_boxes(dataset, "imdg"):
        canvas = np.zeros((GRID, GRID), int)
        for row in range(GRID):
            for column in range(GRID):
                # in units of 1 / GRID pixel, which are whole
                left, top = column * 320, row * 320
                across = left < (x + width) * GRID and x * GRID < left + 320
                canvas[row, column] = across and (
                    top < (y + height) * GRID and y * GRID < top + 320
                )
        painted[name] = painted.get(name, 0) + canvas
    assert painted["container"].max() > 2
    for index, cells in found["maps"]["all"].items():
        if found["classes"][index]["task"] == "imdg":
            name = found["classes"][index]["name"]
            np.testing.assert_array_equal(np.reshape(cells, (GRID, GRID)), painted[name])
    of_cameras = {}
    for index, _, cells in found["maps"]["cells"]:
        of_cameras[index] = of_cameras.get(index, 0) + np.array(cells)
    for index, cells in found["maps"]["all"].items():
        np.testing.assert_array_equal(of_cameras[index], cells)


def test_box_sizes_are_in_the_bins_of_their_pixels(dataset, found):
    sizes = found["sizes"]
    wanted = Counter()
    for _, name, _, (_, _, width, height) in coco_boxes(dataset, "imdg"):
        at = (max(i for i, edge in enumerate(SIZE_EDGES_PX) if edge <= v) for v in (width, height))
        wanted[name, *at] += 1
    shown = Counter(
        {
            (found["classes"][index]["name"], wide, tall): number
            for index, cells in sizes["bins"].items()
            for wide, tall, number in cells
            if found["classes"][index]["task"] == "imdg"
        }
    )
    assert shown == wanted


def test_classes_that_appear_together_are_counted_by_image(dataset, found):
    shown = {}
    for _, name, image, _ in coco_boxes(dataset, "imdg"):
        shown.setdefault(name, set()).add(image)
    index = {each["name"]: i for i, each in enumerate(found["classes"]) if each["task"] == "imdg"}
    assert len(shown) > 3
    for name, images in shown.items():
        for other, others in shown.items():
            assert found["together"][index[name]][index[other]] == len(images & others)


def test_boxes_and_visible_fractions_are_those_of_the_scene_files(dataset, found):
    visible = Counter()
    by_stem = {image["stem"]: image for image in found["sheet"]}
    assert len(by_stem) == 8
    for path in dataset.glob("scenes/*/*.json"):
        objects = [each for each in json.loads(path.read_text())["objects"] if each["bbox"]]
        visible.update(each["class_name"] for each in objects)
        boxes = by_stem[path.stem]["boxes"]
        assert [(box["name"], list(box["box"]), box["text"]) for box in boxes] == [
            (each["class_name"], each["bbox"], each["text"]) for each in objects
        ]
    assert {name: sum(bins) for name, bins in found["visible"].items()} == visible


def test_exposure_is_that_of_the_images(dataset, found):
    for row in found["exposure"]["cameras"]:
        stops = []
        for path in dataset.glob(f"images/*/*_{row['name']}.jpg"):
            code = cv2.imread(str(path))[..., ::-1] / 255
            light = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
            luminance = light.reshape(-1, 3).mean(axis=0) @ (0.2126, 0.7152, 0.0722)
            stops.append(np.log2(luminance / 0.18))
        assert len(stops) == row["images"] == 4
        # two JPEG decoders differ by a code value here and there
        np.testing.assert_allclose(row["stops"][2], np.median(stops), atol=0.02)


def test_text_crops_come_with_their_texts(dataset, found):
    lines = [
        line.split("\t")[1]
        for path in dataset.glob("text/*/labels.txt")
        for line in path.read_text().splitlines()
    ]
    assert lines
    assert {crop["text"] for crop in found["crops"]} <= set(lines)
    assert found["crops"]


def test_all_layouts_give_the_same_report(found, tmp_path):
    for layout in ("webdataset", "parquet"):
        options = ("--format", layout, "--shard", "2")
        other = report_content(str(make_dataset(tmp_path / layout, *options)))
        for key in set(found) - {"title", "origins"}:
            assert other[key] == found[key], key


def test_object_stores_are_read_like_folders(found, tmp_path):
    folder = make_dataset(tmp_path / "tars", "--format", "webdataset", "--shard", "2")
    fsspec.filesystem("memory").put(str(folder), "/report", recursive=True)
    path, _ = write_report("memory://report", tmp_path / "page.html")
    content = json.loads(Reader(path.read_text()).scripts[0][1])
    assert content["sheet"] == json.loads(json.dumps(found["sheet"]))


def test_large_datasets_are_sampled(found, monkeypatch, tmp_path):
    monkeypatch.setattr(content_module, "MOST_RECORDS", 4)
    monkeypatch.setattr(content_module, "MOST_VIEWS", 2)
    sampled = report_content(str(make_dataset(tmp_path / "many", "--shard", "1")))
    assert sampled["scope"] == {"images": 8, "counted": 4, "opened": 2}
    assert sampled["images"] == found["images"]


def test_datasets_without_classes_have_a_report(tmp_path):
    options = ("--tasks", "door")
    found = report_content(str(make_dataset(tmp_path / "doors", *options, images=2)))
    assert found["tasks"] == []
    assert found["damaged"] is None
    assert len(found["sheet"]) == 2


def test_places_are_spread_over_cameras_and_archives():
    places = [
        Place(shard, "train", f"{shard * 4 + i // 4:06d}_{'ABCD'[i % 4]}", (64, 64), ())
        for shard in range(100)
        for i in range(16)
    ]
    chosen = chosen_places(places, 40, False)
    assert Counter(place.camera for place in chosen) == dict.fromkeys("ABCD", 10)
    assert max(place.shard for place in chosen) > 85
    archived = chosen_places(places, 96, True)
    assert len({place.shard for place in archived}) == 24
    assert Counter(place.camera for place in archived) == dict.fromkeys("ABCD", 24)


def look(stem, pixels):
    place = Place(0, "train", stem, (64, 64), ())
    return Look(place, "sky", 0.0, 0.0, 0.0, pixels.astype(np.float32))


def test_only_images_that_look_alike_are_near_duplicates():
    rng = np.random.default_rng(1)
    first, second = rng.uniform(0, 255, (2, 768))
    looks = [
        look("000000_A", first),
        look("000001_A", second),
        look("000002_A", first + rng.uniform(-2, 2, 768)),
        look("000003_B", first),
    ]
    assert near_duplicates(looks) == [("000000_A", "000002_A")]


def advice_text(manifest, records, looks=()):
    base = {"formats": ["damage", "imdg"], "failed": [], "counts": {}}
    table = label_table({**base, **manifest}, records)
    return [" ".join(each) for each in advice_on({**base, **manifest}, table, looks, 1.0)]


def record(number, split, imdg):
    boxes = [{"category_id": i, "bbox": list(box), "iscrowd": 0} for i, box in imdg]
    facts = {"damage": [], "imdg": boxes}
    return {"stem": f"{number:06d}_A", "split": split, "size": [200, 200], "facts": facts}


def test_advice_names_empty_splits_failures_and_classes():
    counts = {"train": {"images": 60}, "val": {"images": 0}, "test": {"images": 3}}
    failed = [{"scene": 4, "seed": 0, "error": "x"}]
    usual = [(i, (0, 0, 40, 40)) for i in range(3, 28)]
    records = [record(i, "train", usual) for i in range(60)]
    records[0]["facts"]["imdg"].append({"category_id": 28, "bbox": [0, 0, 5, 90], "iscrowd": 0})
    words = advice_text({"counts": counts, "failed": failed}, records)
    assert any("No image is in val." in each for each in words)
    assert any("1 scenes could not be rendered: 4." in each for each in words)
    rare = ALL_DETECTION_CLASSES[27]
    assert any(f"few training labels of {rare} (1)" in each for each in words)
    assert any(f"narrower than 8 pixels: {rare} (100%)" in each for each in words)
    assert any("damage: no label at all of axis" in each for each in words)
    assert sum("raise markings.marked_containers." in each for each in words) == 1


def test_advice_does_not_raise_a_share_that_is_1():
    config = {"markings": {"marked_containers": 1.0}, "damage": {"probability": 1.0}}
    words = " ".join(advice_text({"config": config}, [record(0, "train", [(3, (0, 0, 40, 40))])]))
    assert "raise markings.markers_per_face (markings.marked_containers is 1 already)" in words
    assert "raise damage.count (damage.probability is 1 already)" in words
    assert "raise markings.marked_containers" not in words


def test_a_balanced_dataset_gets_no_advice():
    counts = {split: {"images": 60} for split in ("train", "val", "test")}
    records = [record(i, "train", [(c, (0, 0, 40, 40)) for c in range(1, 29)]) for i in range(60)]
    for each in records:
        each["facts"]["damage"] = [
            {"category_id": c, "bbox": [0, 0, 40, 40], "iscrowd": 0} for c in range(1, 6)
        ]
    assert advice_text({"counts": counts}, records) == []


def test_the_configuration_is_compared_with_the_nearest_preset(dataset):
    config = open_finished(dataset).manifest["config"]
    preset, rows = nearest_preset(config)
    assert preset == "seafront"
    keys = {key: new for key, _, new in rows}
    assert keys["cameras.A.distance_mm"] == [3000, 4000]
    assert keys["cameras.Cl"] == "not set"
    assert nearest_preset({})[1]


def test_merged_datasets_have_an_origin_for_each_part(dataset):
    manifest = open_finished(dataset).manifest
    parts = [{**manifest, "seed": seed} for seed in (5, 6)]
    assert len(origins(manifest)) == 1
    merged = origins({**manifest, "merged_from": parts})
    assert [dict(each["facts"])["seed"] for each in merged] == ["5", "6"]


def test_the_page_is_one_file_without_addresses(dataset, tmp_path, found):
    path, advice = write_report(str(dataset), tmp_path / "page.html")
    reader = Reader(path.read_text())
    assert advice == len(found["advice"])
    assert path.stat().st_size < 10_000_000
    policy = next(a["content"] for _, a in reader.elements if "http-equiv" in a)
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert not [a for _, a in reader.elements if {"src", "href", "srcset"} & set(a)]
    (data, script) = reader.scripts
    assert data[0] == {"type": "application/json", "id": "content"}
    assert json.loads(data[1]) == json.loads(json.dumps(found))
    assert script[0] == {}


def test_the_report_is_beside_the_dataset_and_never_inside(copy, capsys):
    assert main(["report", str(copy)]) == 0
    assert (copy.parent / "out.report.html").exists()
    assert "open it in a browser" in capsys.readouterr().out
    for place, words in (
        (copy / "page.html", "is inside of the dataset"),
        (copy.parent / "page.txt", "ends in .html"),
    ):
        assert main(["report", str(copy), "-o", str(place)]) == 2
        assert words in capsys.readouterr().err
        assert not place.exists()
    assert main(["report", "memory://out"]) == 2
    assert main(["report", str(copy.parent)]) == 2
    assert main(["verify", str(copy)]) == 0
