"""The detector of containers of the comparison with real pictures: its files, images and scores."""

import json
from types import SimpleNamespace

import box_detector
import cv2
import numpy as np
import pytest
import torch
from box_detector import Detections, ap50, counts
from box_variation import CANVAS_PX, fitted, varied
from common.detection_metrics import score
from common.detector import STRIDE, Detector
from gap_renders import Effort
from gap_sections import Trial, containers
from real_crops import BoxedImage, load_real
from real_gap import merged
from rendered_boxes import PRESETS, boxed_renders

from fastgen.errors import ConfigError

SIZE = (CANVAS_PX, CANVAS_PX)


def coco(**changed):
    """Return a COCO file with two images; the second one has no boxes."""
    return {
        "images": [{"id": 4, "file_name": "look/a.png"}, {"id": 9, "file_name": "look/b.png"}],
        "annotations": [
            {"image_id": 4, "category_id": 2, "bbox": [2, 3, 10, 4]},
            {"image_id": 4, "category_id": 2, "bbox": [20, 10, 40, 5], "iscrowd": 1},
            {"image_id": 4, "category_id": 1, "bbox": [0, 0, 5, 5]},
        ],
        "categories": [{"id": 1, "name": "truck"}, {"id": 2, "name": "container"}],
        **changed,
    }


def written(folder, values):
    (folder / "look").mkdir()
    for name in ("a", "b"):
        cv2.imwrite(str(folder / f"look/{name}.png"), np.full((20, 30, 3), 90, np.uint8))
    (folder / "containers.json").write_text(
        values if isinstance(values, str) else json.dumps(values)
    )
    return folder


def test_boxes_of_containers_are_read_from_a_coco_file(tmp_path):
    first, second = load_real(written(tmp_path, coco())).boxed
    assert first.pixels.shape == (20, 30, 3)
    assert first.boxes.tolist() == [[2, 3, 12, 7], [20, 10, 30, 15]]
    assert first.ignored.tolist() == [False, True]
    assert second.boxes.shape == (0, 4)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ("{", "Invalid JSON"),
        ({"images": [], "categories": []}, "annotations: Field required"),
        (coco(annotations=[{"image_id": 4, "category_id": 2}]), r"annotations\.0\.bbox"),
        (coco(categories=[{"id": 2, "name": "box"}]), "no category named 'container'"),
        (coco(images=[{"id": 4, "file_name": "c.png"}]), r"image 4: .*c\.png.* missing"),
        (
            coco(annotations=[{"image_id": 9, "category_id": 2, "bbox": [30, 0, 9, 9]}]),
            r"image 9: bbox .* no area inside look/b\.png",
        ),
        (
            coco(annotations=[{"image_id": 5, "category_id": 2, "bbox": [3, 0, 9, 9]}]),
            r"annotations\.0\.image_id: no image has the id 5",
        ),
        (coco(images=[], annotations=[]), "images: is empty"),
    ],
)
def test_a_wrong_coco_file_is_refused_by_file_and_place(tmp_path, values, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_real(written(tmp_path, values))
    assert "containers.json" in str(caught.value)


def bright(box, size=(160, 120), ignored=False):
    """Return a dark image whose box is white."""
    pixels = np.zeros((size[1], size[0], 3), np.uint8)
    x0, y0, x1, y1 = box
    pixels[y0:y1, x0:x1] = 255
    return BoxedImage(pixels, np.array([box], float), np.array([ignored]))


def white_box(pixels):
    """Return the box of the white pixels of an image uint8 [3, H, W]."""
    rows, columns = (pixels[0] > 185).nonzero(as_tuple=True)
    low = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    return [int(value) for value in low]


@pytest.mark.parametrize("size", [(160, 120), (120, 200), (900, 500)])
def test_a_whole_image_keeps_its_shape_and_its_box(size):
    image = bright((30, 20, 90, 70), size)
    pixels, target = fitted(image)
    assert pixels.shape == (3, CANVAS_PX, CANVAS_PX)
    assert target["boxes"][0].tolist() == pytest.approx(white_box(pixels), abs=1.5)
    x0, y0, x1, y1 = target["boxes"][0].tolist()
    assert (x1 - x0) / (y1 - y0) == pytest.approx(60 / 50, rel=0.02)
    margin = int((pixels[0] == 114).sum())
    assert margin == pytest.approx(CANVAS_PX**2 * (1 - min(size) / max(size)), rel=0.02)


def test_boxes_follow_the_picture_through_random_crops():
    rng = np.random.default_rng(5)
    image = bright((40, 30, 110, 60))
    lefts, widths = [], []
    for _ in range(60):
        pixels, target = varied(image, rng)
        assert target["boxes"][0].tolist() == pytest.approx(white_box(pixels), abs=2)
        lefts.append(float(target["boxes"][0, 0]))
        widths.append(float(target["boxes"][0, 2]) - lefts[-1])
    whole = 70 * CANVAS_PX / 160
    assert min(widths) < 0.65 * whole
    assert max(widths) > 1.3 * whole
    assert np.std(lefts) > 30


def test_some_crops_are_mirrored_and_few_are_grey():
    rng = np.random.default_rng(1)
    pixels = np.zeros((120, 160, 3), np.uint8)
    pixels[:, :80, 0], pixels[:, 80:, 1] = 200, 200
    image = BoxedImage(pixels, np.empty((0, 4)), np.empty(0, bool))
    mirrored, grey = 0, 0
    for _ in range(200):
        crop, target = varied(image, rng)
        assert target["boxes"].shape == (0, 4)
        red, green = ((crop[k] == 200).nonzero()[:, 1].float() for k in (0, 1))
        grey += not len(red)
        mirrored += bool(len(red) and red.mean() > green.mean())
    assert 60 < mirrored < 120
    assert 8 < grey < 35


def test_boxes_that_are_tiny_or_mostly_outside_are_ignored():
    tiny, marked = [0, 0, 100, 3], [50, 50, 100, 90]
    image = BoxedImage(
        np.zeros((400, 800, 3), np.uint8), np.array([tiny, marked], float), np.array([False, True])
    )
    assert fitted(image)[1]["iscrowd"].tolist() == [1, 1]
    # an image of 576x432 pixels of which the right lower part is seen, from x = 192
    largest = SimpleNamespace(
        uniform=lambda low, high: high,
        standard_normal=lambda: 0.0,
        integers=lambda low, high: low,
        random=lambda: 0.9,
    )
    boxes = np.array([[0, 40, right, 80] for right in (80, 56, 50)], float)
    image = BoxedImage(np.zeros((120, 160, 3), np.uint8), boxes, np.zeros(3, bool))
    target = varied(image, largest)[1]
    assert target["iscrowd"].tolist() == [0, 1]
    assert target["boxes"][:, 2].tolist() == pytest.approx([96, 9.6], abs=1e-3)


def labelled(boxes, ignored=()):
    """Return a target of one class."""
    every = torch.tensor([*boxes, *ignored], dtype=torch.float32).reshape(-1, 4)
    return {
        "boxes": every,
        "labels": torch.ones(len(every), dtype=torch.int64),
        "area": (every[:, 2:] - every[:, :2]).prod(1),
        "iscrowd": torch.tensor([0] * len(boxes) + [1] * len(ignored)),
    }


def detections(*things):
    """Return detections of one class from tuples (score, x0, y0, x1, y1)."""
    return {
        "boxes": torch.tensor([t[1:] for t in things], dtype=torch.float32).reshape(-1, 4),
        "labels": torch.ones(len(things), dtype=torch.int64),
        "scores": torch.tensor([t[0] for t in things], dtype=torch.float32),
    }


def seen(*pairs):
    blank = torch.zeros(3, CANVAS_PX, CANVAS_PX, dtype=torch.uint8)
    return Detections([(blank, target) for target, _ in pairs], [found for _, found in pairs])


def test_detections_in_ignored_regions_are_neither_right_nor_wrong():
    target = labelled([[0, 0, 100, 100]], [[200, 200, 380, 300]])
    found = detections((0.9, 210, 210, 250, 250), (0.8, 0, 0, 100, 100), (0.7, 260, 210, 300, 250))
    scores = score([target], [found], ("container",), SIZE)
    assert scores.ap50 == pytest.approx(100)
    assert scores.counts == [1]
    assert counts(seen((target, found)), 0.5) == (1, 1, 1)
    plain = {**target, "iscrowd": torch.zeros(2, dtype=torch.int64)}
    assert score([plain], [found], ("container",), SIZE).ap50 < 30
    assert counts(seen((plain, found)), 0.75) == (1, 2, 2)


def test_the_interval_covers_what_pycocotools_gives_for_resampled_images(monkeypatch):
    monkeypatch.setattr(box_detector, "_REPLICATES", 30)
    a, b = [0, 0, 100, 100], [150, 20, 300, 200]
    cases = seen(
        (labelled([a, b]), detections((0.9, *a), (0.3, 1, 2, 30, 40))),
        (labelled([b], [a]), detections((0.8, *a), (0.7, 0, 300, 50, 380))),
        (labelled([a]), detections((0.6, *a), (0.95, 200, 200, 250, 260))),
        (labelled([]), detections((0.5, *b))),
    )
    value, low, high = ap50(cases, seed=3)
    assert value == pytest.approx(score(cases.targets, cases.found, ("c",), SIZE).ap50 / 100)
    rng = np.random.default_rng(3)
    drawn = []
    for _ in range(30):
        chosen = rng.integers(4, size=4).tolist()
        targets, found = ([each[k] for k in chosen] for each in (cases.targets, cases.found))
        drawn.append(score(targets, found, ("c",), SIZE).ap50 / 100)
    assert (low, high) == pytest.approx(tuple(np.nanpercentile(drawn, (2.5, 97.5))))
    assert low < value < high


def test_heat_in_ignored_regions_is_not_punished(monkeypatch):
    torch.manual_seed(0)
    model = Detector(1)
    image = torch.zeros(3, 64, 64, dtype=torch.uint8)
    cells = 64 // STRIDE
    maps = {}

    def loss(ignored, hot, centre=-4.0):
        heat = torch.full((1, 1, cells, cells), -4.0)
        heat[:, :, 8:12, 4:10] = hot
        heat[:, :, 3, 3] = centre
        maps["now"] = heat, torch.zeros(1, 2, 4, cells, cells)
        return float(model.loss([image], [labelled([[0, 0, 24, 24]], ignored)]))

    monkeypatch.setattr(Detector, "forward", lambda self, pixels: maps["now"])
    region = [[4 * STRIDE, 8 * STRIDE, 10 * STRIDE, 12 * STRIDE]]
    assert loss(region, 3.0) == pytest.approx(loss(region, -4.0))
    assert loss([], 3.0) > loss([], -4.0) + 1
    # a label inside an ignored region is still learned
    assert loss([[0, 0, 64, 64]], 0.0) > 0.1
    assert loss([[0, 0, 64, 64]], 0.0) > loss([[0, 0, 64, 64]], 0.0, centre=4.0) + 1


def test_renders_have_boxes_of_all_presets_and_regions_to_ignore():
    images = boxed_renders(seed=3, scenes=range(2), workers=1)
    assert {image.preset for image in images} == set(PRESETS)
    assert len(images) == 8
    for image in images:
        assert len(image.boxes) == len(image.ignored)
        height, width = image.pixels.shape[:2]
        assert (image.boxes >= 0).all()
        assert (image.boxes <= [width, height, width, height]).all()
        assert (image.boxes[:, :2] < image.boxes[:, 2:]).all()
    assert any(not image.ignored.all() for image in images)
    assert any(image.ignored.any() for image in images)


def test_the_section_has_figures_of_each_preset_and_of_photographs():
    rng = np.random.default_rng(2)
    made = []
    for preset in (*PRESETS, *PRESETS):
        x, y = rng.integers(0, 60, 2).tolist()
        image = bright((x, y, x + 80, y + 50))
        made.append(BoxedImage(image.pixels, image.boxes, image.ignored, preset))
    renders = SimpleNamespace(boxed=lambda seed: made, held_out_boxed=made[:2])
    real = SimpleNamespace(boxed=(bright((10, 10, 90, 90), (200, 100)),))
    figures = containers(Trial(real, renders, 1, Effort(box_steps=3)))
    for group in ("ours, held out", "ours, held out, gate", "ours, held out, yard", "theirs"):
        assert 0 <= figures[f"{group}, AP50"].value <= 1
    assert figures["theirs, recall"].total == 1
    assert figures["ours, held out, recall"].total == 2


def test_a_run_of_one_section_keeps_the_stored_figures_of_others():
    before = {
        "origin": {"markers": {"fastgen": "1"}, "ocr": {"fastgen": "1"}},
        "sections": {"markers": {"a": 1}, "ocr": {"b": 2}},
        "confused": {"x as y": 3},
    }
    after = merged(before, {"ocr": {"b": 5}, "damage": {"c": 4}}, {}, {"fastgen": "2"})
    assert after["sections"] == {"markers": {"a": 1}, "ocr": {"b": 5}, "damage": {"c": 4}}
    assert [after["origin"][name]["fastgen"] for name in ("markers", "ocr", "damage")] == list(
        "122"
    )
    assert after["confused"] == {"x as y": 3}
    assert merged(before, {"markers": {"a": 2}}, {}, {"fastgen": "2"})["confused"] == {}
