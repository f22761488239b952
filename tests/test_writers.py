"""Encoders and label formats, read back with third-party readers."""

import io
import json

import cv2
import numpy as np
import pytest
import simplejpeg
from PIL import Image
from pycocotools import mask as coco_mask

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.config.config import Config, LabelConfig
from fastgen.files import images as encode
from fastgen.formats import coco, damage, outlines, yolo
from fastgen.formats.format import assemble
from fastgen.formats.item import Item
from fastgen.formats.registry import known_formats
from fastgen.generator import Generator
from fastgen.labels.visibility import mask_box, window
from fastgen.sample import Object
from fastgen.scene import Camera


def masks():
    rng = np.random.default_rng(0)
    yield np.zeros((7, 5), bool)
    yield np.ones((7, 5), bool)
    for _ in range(20):
        yield rng.random((37, 23)) < rng.random()
    big = np.zeros((700, 900), bool)
    big[100:650, 50:880] = True
    yield big


def test_run_lengths_decode_in_pycocotools_to_the_same_mask():
    for mask in masks():
        made = coco.rle(mask, (0, 0), mask.shape[::-1])
        box = mask_box(mask) or (0, 0, 1, 1)
        assert coco.rle(window(mask, box), box[:2], mask.shape[::-1]) == made
        packed = {"size": made["size"], "counts": made["counts"].encode()}
        np.testing.assert_array_equal(coco_mask.decode(packed).astype(bool), mask)
        assert coco_mask.area(packed) == mask.sum()
        reference = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
        assert reference["counts"].decode() == made["counts"]


def packed_of(annotation, width, height):
    """Return the run lengths that pycocotools makes of an annotation's mask."""
    if "polygons" in annotation:
        polygons = json.loads(annotation["polygons"])
        return coco_mask.merge(coco_mask.frPyObjects(polygons, height, width))
    mask = annotation["segmentation"]
    return {"size": mask["size"], "counts": mask["counts"].encode()}


def test_polygons_decode_in_pycocotools_to_the_same_mask():
    for mask in masks():
        height, width = mask.shape
        found = outlines.polygons(mask)
        assert bool(found) == mask.any()
        box = mask_box(mask)
        for crowd in (False, True) if box else ():
            made = coco.annotation(1, box, window(mask, box), (width, height), crowd, True)
            assert ("segmentation" in made) == crowd
            packed = packed_of(made, width, height)
            np.testing.assert_array_equal(coco_mask.decode(packed).astype(bool), mask)
        # the area inside by the shoelace formula, with holes counted against it
        area = 0.0
        for points in found:
            (x, y), (ahead_x, ahead_y) = points.T, np.roll(points, -1, axis=0).T
            area += (x * ahead_y - y * ahead_x).sum() / 2
        assert abs(area) == mask.sum()


@pytest.mark.parametrize("values", [[0, 101, 501, 65535], np.array([0, 7, 255], np.uint8)])
@pytest.mark.parametrize("size", [(33, 21), (1, 1), (300, 2)])
def test_masks_survive_png_in_their_depth(tmp_path, values, size):
    mask = np.random.default_rng(1).choice(np.array(values), size)
    mask = mask.astype(np.uint16 if mask.dtype != np.uint8 else np.uint8)
    encode.write(tmp_path / "mask.png", encode.png(mask))
    read = cv2.imread(str(tmp_path / "mask.png"), cv2.IMREAD_UNCHANGED)
    assert read.dtype == mask.dtype
    np.testing.assert_array_equal(read, mask)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "mask.png")), mask)


@pytest.mark.parametrize("shape", [(33, 21, 3), (1, 1, 3), (300, 2, 4)])
def test_pictures_survive_png_with_their_alpha(shape):
    picture = np.random.default_rng(1).integers(0, 255, shape, np.uint8, endpoint=True)
    for each in (picture, picture[::-1], np.asfortranarray(picture)):
        read = np.asarray(Image.open(io.BytesIO(encode.png(each))))
        np.testing.assert_array_equal(read, each)


def test_images_keep_their_colour_order():
    image = np.zeros((64, 64, 3), np.uint8)
    image[:, :32] = (200, 30, 20)
    image[:, 32:] = (10, 60, 220)
    for decoded in (
        simplejpeg.decode_jpeg(encode.jpeg(image)),
        cv2.cvtColor(
            cv2.imdecode(np.frombuffer(encode.png(image), np.uint8), 1), cv2.COLOR_BGR2RGB
        ),
    ):
        assert np.abs(decoded[10, 5].astype(int) - image[10, 5]).max() < 6
        assert np.abs(decoded[10, 60].astype(int) - image[10, 60]).max() < 6


def test_writing_leaves_no_temporary_files(tmp_path):
    encode.write(tmp_path / "a.txt", "one")
    encode.write(tmp_path / "a.txt", "two")
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "two"


def item(name, bbox, ignored=False):
    return Object(2, name, 1, bbox, None, 1000, 1.0, False, ignored=ignored)


def test_yolo_boxes_are_centres_and_sizes_and_never_exceed_one():
    text = yolo.detection_lines([item("C9.1", (0, 0, 100, 50)), item("text", None)], (100, 50))
    assert text == f"{DETECTION_CLASSES.index('C9.1')} 0.500000 0.500000 1.000000 1.000000\n"
    for width in (3, 7, 97, 1333):
        boxes = [item("text", (0, 0, w, 1)) for w in range(1, width + 1)]
        lines = yolo.detection_lines(boxes, (width, 1)).splitlines()
        numbers = [[float(v) for v in line.split()[1:]] for line in lines]
        assert all(0 <= v <= 1 for row in numbers for v in row)
        assert all(row[0] + row[2] / 2 <= 1 + 1e-6 for row in numbers)


def test_ignored_objects_and_damage_stay_out_of_the_marker_labels():
    things = [item("C1.1", (0, 0, 3, 3), ignored=True), item("axis", (0, 0, 30, 30))]
    assert yolo.detection_lines(things, (100, 100)) == ""


@pytest.fixture(scope="module")
def samples():
    with Generator(seed=2, size=(320, 320)) as generator:
        damaged = [i for i in range(30) if generator.scene(i).damages][:4]
        views = [(i, c) for i in damaged for c in ("A", "Cl", "Cr")]
        return [generator.render(index=i, camera=c, normals=True) for i, c in views]


def item_of(sample):
    return Item(sample, "train", f"000000_{sample.camera.name}", 0, LabelConfig())


def test_coco_annotations_equal_the_mask(samples):
    for sample in samples:
        _, facts = damage.FORMAT.sample_files(item_of(sample))
        found = [each for each in facts if not each.get("background")]
        for annotation in found:
            packed = packed_of(annotation, 320, 320)
            mask = coco_mask.decode(packed).astype(bool)
            category = annotation["category_id"]
            allowed = sample.damage > 0 if category == 1 else sample.damage // 100 == category
            assert not (mask & ~allowed).any()
            assert annotation["area"] == mask.sum() == coco_mask.area(packed)
            assert annotation["bbox"] == coco_mask.toBbox(packed).astype(int).tolist()
        seen = {v for v in np.unique(sample.damage) if v >= 200}
        assert len(found) == len(seen) + 1


def test_yolo_outlines_are_the_borders_of_their_masks(samples):
    seen = 0
    for sample in samples:
        files, found = damage.FORMAT.sample_files(item_of(sample))
        text = files[f"damage/labels/train/000000_{sample.camera.name}.txt"].decode()
        wanted = [annotation for annotation in found if not annotation["iscrowd"]]
        lines = text.splitlines()
        assert len(lines) == len(wanted)
        for line, annotation in zip(lines, wanted, strict=True):
            index, *numbers = line.split()
            assert int(index) == annotation["category_id"] - 1
            points = np.array(numbers, float) * 320
            x, y, width, height = annotation["bbox"]
            corners = points.reshape(-1, 2)
            assert np.abs(corners.min(axis=0) - (x, y)).max() < 0.51
            assert np.abs(corners.max(axis=0) - (x + width, y + height)).max() < 0.51
            drawn = coco_mask.decode(coco_mask.frPyObjects([points.tolist()], 320, 320))[..., 0]
            mask = coco_mask.decode(packed_of(annotation, 320, 320))
            union = (drawn | mask).sum()
            # outlines fill holes, and slanted borders cut half pixels off corners
            assert (drawn & mask).sum() / union > (0.95 if mask.sum() > 2000 else 0.6)
            seen += mask.sum() <= 2000
    assert seen


def test_an_empty_image_has_files_but_no_annotations(generators):
    away = Camera("A", (0.0, -8000.0, 1000.0), (0.0, -20000.0, 1000.0), 14.5)
    generator = generators(seed=2, size=(64, 64))
    sample = generator.render(index=0, camera=away, normals=True)
    assert not sample.damage.any()
    files, record = assemble(item_of(sample), list(known_formats().values()))
    assert files["imdg/labels/train/000000_A.txt"] == b""
    assert b"<object>" not in files["voc/Annotations/000000_A.xml"]
    assert {name: bool(facts) for name, facts in record["facts"].items()} == {
        name: name == "bop" for name in known_formats()
    }
    assert record["facts"]["bop"]["gt"] == []


@pytest.mark.parametrize("extra", ["scrape", "limited_quantity"])
def test_categories_include_those_of_scenes_that_the_configuration_does_not_draw(generators, extra):
    """Scenes keep their scrapes or marks when another generator draws them."""
    values = {
        "scrape": {"damage": {"probability": 1, "count": 9, "kinds": ["scrape"]}},
        "limited_quantity": {"markings": {"marks": {"limited_quantity": 1}}},
    }[extra]
    scene = Generator(Config.from_values(values), seed=5).scene(0)
    usual = Config()
    generator = generators(usual, seed=2, size=(320, 320))
    samples = [generator.render(scene=scene, camera=name) for name in ("A", "B")]
    name = "damage" if extra == "scrape" else "imdg"
    form = known_formats()[name]
    records = [assemble(item_of(sample), [form])[1] for sample in samples]

    def categories(records):
        files = dict(form.dataset_files("train", lambda: iter(records), usual))
        return json.loads("".join(files[f"{name}/coco_train.json"]))["categories"]

    used = {item["category_id"] for record in records for item in record["facts"][name]}
    assert form.classes.index(extra) + 1 in used
    listed = categories(records)
    assert [each["id"] for each in listed] == list(range(1, len(form.classes) + 1))
    assert [each["name"] for each in listed] == list(form.classes)
    plain = SEGMENTATION_CLASSES if extra == "scrape" else DETECTION_CLASSES
    assert [each["name"] for each in categories([])] == list(plain)


def test_records_survive_json(samples):
    files, record = assemble(item_of(samples[0]), list(known_formats().values()))
    assert json.loads(json.dumps(record)) == record
    assert json.loads(files["scenes/train/000000_A.json"])["objects"]
