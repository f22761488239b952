"""The examples: each runs end to end, and their metrics agree with cases made by hand."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import damage
import door
import numpy as np
import pytest
import torch
from common import detector
from common.boxes import generalized_iou, iou
from common.data import Feed, Kept, mirrored, rendered
from common.detection_metrics import (
    class_scores,
    compressed,
    confusion,
    hits,
    operating_point,
    score,
)
from common.detector import STRIDE, Detector, distinct, gaussians
from common.run import Table
from pycocotools import mask as coco_mask

from fastgen.torch import ContainerDataset, ItemSettings, RenderSettings, SceneSettings

ROOT = Path(__file__).parent.parent
NAMES = ("container", "axis", "dented")
SIZE = (200, 100)


def assert_written(folder, name):
    made = json.loads((folder / f"{name}.json").read_text())
    assert (made["example"], made["mode"], made["seed"]) == (name, "smoke", 1)
    assert made["parameters"] > 0
    assert "| --- |" in (folder / f"{name}.md").read_text()
    assert (folder / f"{name}_loss.png").stat().st_size > 1000


@pytest.mark.parametrize("example", ["imdg", "damage", "text", "seal", "imdg --full"])
def test_an_example_runs_and_writes_table_numbers_and_charts(example, tmp_path):
    name, *options = example.split()
    importlib.import_module(name).main(["--smoke", *options, "--results", str(tmp_path)])
    assert_written(tmp_path, name)


def test_an_example_runs_as_a_script(tmp_path):
    command = [sys.executable, "examples/door.py", "--smoke", "--results", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True)
    assert_written(tmp_path, "door")


def labels(*things, masks=None):
    """Return a target from tuples (label, x0, y0, x1, y1), with areas of the masks or the boxes."""
    boxes = torch.tensor([t[1:] for t in things], dtype=torch.float32).reshape(-1, 4)
    target = {"boxes": boxes, "labels": torch.tensor([t[0] for t in things], dtype=torch.int64)}
    target["area"] = (boxes[:, 2:] - boxes[:, :2]).prod(1)
    target["iscrowd"] = torch.zeros_like(target["labels"])
    if masks is not None:
        target |= {"masks": torch.stack(masks), "area": torch.stack(masks).sum((1, 2)).float()}
    return target


def detections(*things, masks=None):
    """Return detections from tuples (score, label, x0, y0, x1, y1)."""
    found = labels(*(t[1:] for t in things), masks=masks)
    return found | {"scores": torch.tensor([t[0] for t in things], dtype=torch.float32)}


def test_average_precision_is_that_of_the_interpolated_curve():
    target = labels((1, 0, 0, 20, 20), (1, 100, 0, 120, 20))
    found = detections((0.9, 1, 0, 0, 20, 20), (0.8, 1, 50, 50, 70, 70), (0.7, 1, 100, 0, 120, 20))
    scores = score([target], [found], NAMES, SIZE)
    # recalls 0, 0.01 ... 0.5 are reached at precision 1, the other fifty at 2/3
    assert scores.class_ap50[0] == pytest.approx(100 * (51 + 50 * 2 / 3) / 101)
    assert scores.counts == [2, 0, 0]
    assert np.isnan(scores.class_ap50[1])
    assert scores.ap50 == pytest.approx(scores.class_ap50[0])


def test_recall_by_size_uses_the_area_of_the_label():
    target = labels((1, 0, 0, 20, 20), (1, 60, 0, 110, 50), (1, 100, 0, 200, 100))
    found = detections((0.9, 1, 60, 0, 110, 50))
    summary = score([target], [found], NAMES, SIZE).summary
    assert [summary[f"AR_{s}"] for s in "SML"] == pytest.approx([0, 100, 0])


def test_a_mask_that_overlaps_by_three_fifths_counts_at_three_of_ten_thresholds():
    whole, part = torch.zeros(100, 200, dtype=torch.uint8), torch.zeros(100, 200, dtype=torch.uint8)
    whole[10:60, 20:40] = 1
    part[10:40, 20:40] = 1  # IoU 0.6
    target = labels((2, 20, 10, 40, 60), masks=[whole])
    found = detections((0.9, 2, 20, 10, 40, 60), masks=[part])
    assert score([target], [found], NAMES, SIZE, masks=True).class_ap[1] == pytest.approx(30)
    assert score([target], [found], NAMES, SIZE).class_ap[1] == pytest.approx(100)


def test_no_detections_is_not_an_error():
    scores = score([labels((1, 0, 0, 20, 20))], [detections()], NAMES, SIZE)
    point = operating_point(scores)
    assert scores.ap == 0
    assert point.mean_recall == 0
    assert np.isnan(point.mean_precision)


def test_operating_point_drops_detections_that_cost_more_precision_than_they_add_recall():
    target = labels((1, 0, 0, 20, 20), (1, 100, 0, 120, 20))
    wrong = [(0.3, 1, 50, y, 60, y + 10) for y in (0, 20, 40, 60, 80)]
    right = [(0.8, 1, 0, 0, 20, 20), (0.7, 1, 100, 0, 120, 20)]
    point = operating_point(score([target], [detections(*right, *wrong)], NAMES, SIZE))
    assert 0.3 < point.score <= 0.7
    assert (point.precision[0], point.recall[0]) == (100, 100)
    assert (point.mean_precision, point.mean_recall) == (100, 100)


def test_each_class_has_a_score_that_keeps_its_right_detections_and_drops_wrong_ones():
    target = labels((1, 0, 0, 20, 20), (2, 100, 0, 120, 20))
    one = (0.8, 1, 0, 0, 20, 20), (0.6, 1, 50, 0, 70, 20)
    two = (0.3, 2, 100, 0, 120, 20), (0.1, 2, 50, 0, 70, 20)
    least = class_scores(score([target], [detections(*one, *two)], NAMES, SIZE))
    assert 0.6 < least[0] <= 0.8
    assert 0.1 < least[1] <= 0.3
    assert hits(target, detections(*one, *two), least).tolist() == [True, True]
    assert hits(target, detections(*one, *two), [0.9, 0.2, 0.2]).tolist() == [False, True]


def test_mirrored_images_and_labels_stay_together():
    image = torch.zeros(3, 4, 10, dtype=torch.uint8)
    image[:, 1:3, 2:5] = 9
    target = labels((2, 2, 1, 5, 3), masks=[image[0] // 9])
    (found,), (one,) = mirrored([image], [target])
    x0, y0, x1, y1 = one["boxes"][0].int().tolist()
    assert (found[:, y0:y1, x0:x1] == 9).all()
    assert int((found > 0).sum()) == 3 * (x1 - x0) * (y1 - y0)
    assert (one["masks"][0] == found[0] // 9).all()
    (again,), (same,) = mirrored([found], [one])
    assert (again == image).all()
    assert (same["boxes"] == target["boxes"]).all()


def test_half_of_the_batches_are_mirrored_in_an_order_that_depends_on_the_pass():
    image = torch.zeros(3, 1, 2, dtype=torch.uint8)
    image[:, :, 0] = 1
    items = [{"jpeg": None, "target": None}] * 40

    class Same(Kept):
        def __getitem__(self, position):
            return image, labels((1, 0, 0, 1, 1))

    def seen(number, mirror=True):
        feed = Feed(Same(items), 1, seed=2, mirror=mirror)
        return [int(images[0][0, 0, 1]) for images, _ in feed.passed(number)]

    assert seen(0) == seen(0)
    assert seen(0) != seen(1)
    assert 8 < sum(seen(0)) < 32
    assert sum(seen(0, mirror=False)) == 0


def test_confusion_counts_the_class_detected_at_each_label_and_missed_labels():
    target = labels((1, 0, 0, 200, 100), (2, 0, 0, 200, 98), (3, 10, 10, 30, 30), (3, 60, 0, 70, 9))
    ends = (0.9, 1, 0, 0, 200, 99), (0.8, 3, 0, 0, 198, 98)
    found = detections(*ends, (0.7, 3, 9, 9, 30, 30), (0.1, 3, 60, 0, 70, 9))
    counts = confusion([target], [found], 3, least_score=0.5)
    assert counts.tolist() == [[1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]


@pytest.mark.parametrize("masks", [False, True])
def test_hits_are_the_labels_that_pycocotools_matches(masks):
    rng = np.random.default_rng(3)
    targets, found = [], []
    for _ in range(12):
        things = [(int(rng.integers(1, 4)), *_box(rng)) for _ in range(6)]
        guesses = [(k, *(v + int(rng.integers(-4, 5)) for v in box)) for k, *box in things * 2]
        guesses = [(float(rng.random()), *g) for g in guesses]
        filled = [_filled(t[1:]) for t in things], [_filled(g[2:]) for g in guesses]
        targets.append(labels(*things, masks=filled[0]))
        found.append(detections(*guesses, masks=filled[1]))
    scored = score(targets, found, NAMES, SIZE, masks).scored
    own = [hits(t, f, [0.0] * 3, masks) for t, f in zip(targets, found, strict=True)]
    for k in range(3):
        of_class = [(t["labels"] == k + 1).numpy() for t in targets]
        ours = sum(int(h[c].sum()) for h, c in zip(own, of_class, strict=True))
        assert 0 < ours == int(scored[k][1].sum())


def _box(rng):
    x, y = int(rng.integers(10, 150)), int(rng.integers(10, 60))
    return x, y, x + int(rng.integers(9, 30)), y + int(rng.integers(9, 30))


def _filled(box):
    mask = torch.zeros(SIZE[1], SIZE[0], dtype=torch.uint8)
    x0, y0, x1, y1 = box
    mask[y0:y1, x0:x1] = 1
    return mask


def test_iou_of_boxes_equals_that_of_pycocotools():
    rng = np.random.default_rng(4)
    a, b = (torch.tensor([_box(rng) for _ in range(n)], dtype=torch.float32) for n in (7, 9))
    theirs = coco_mask.iou(*(_sized(boxes) for boxes in (a, b)), [0] * len(b))
    assert iou(a, b).numpy() == pytest.approx(theirs, abs=1e-6)


def _sized(boxes):
    return torch.cat([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], dim=1).double().numpy()


def test_generalized_iou_falls_below_zero_with_the_gap():
    unit = torch.tensor([0.0, 0, 1, 1])
    for gap in (0.0, 1.0, 5.0):
        apart = unit + torch.tensor([1 + gap, 0, 1 + gap, 0])
        assert float(generalized_iou(unit, apart)) == pytest.approx(-gap / (2 + gap))
    assert float(generalized_iou(unit, unit)) == 1


def perfect_maps(target, classes):
    """Return the maps of an ideal detector for boxes whose centres are cell centres."""
    height, width = SIZE[1] // STRIDE, SIZE[0] // STRIDE
    heat = torch.full((1, classes, height, width), -20.0)
    sides = torch.zeros(1, 2, 4, height, width)
    things = zip(target["labels"].tolist(), target["boxes"].tolist(), strict=True)
    for label, (x0, y0, x1, y1) in things:
        row, column = int((y0 + y1) / 2 / STRIDE), int((x0 + x1) / 2 / STRIDE)
        heat[0, label - 1, row, column] = 20.0
        half = torch.tensor([x1 - x0, y1 - y0, x1 - x0, y1 - y0]) / 2 / STRIDE
        sides[0, int(label > 1), :, row, column] = half.log()
    return heat, sides


def test_detector_reads_boxes_and_classes_from_its_maps(monkeypatch):
    target = labels((1, 2, 4, 194, 96), (3, 90, 40, 114, 68), (2, 26, 14, 34, 22))
    model = Detector(3)
    monkeypatch.setattr(Detector, "forward", lambda self, pixels: perfect_maps(target, 3))
    image = torch.zeros(3, SIZE[1], SIZE[0], dtype=torch.uint8)
    found = model.predict([image])[0]
    order = found["labels"].argsort()
    assert found["labels"][order].tolist() == [1, 2, 3]
    assert found["boxes"][order] == pytest.approx(target["boxes"][[0, 2, 1]], abs=1e-3)


def test_only_the_best_of_overlapping_boxes_of_a_class_is_kept():
    boxes = torch.tensor([[0.0, 0, 10, 10], [1, 0, 11, 10], [0, 0, 10, 10], [5, 0, 15, 10]])
    assert distinct(boxes, torch.tensor([1, 1, 2, 1])).tolist() == [True, False, True, True]


def test_heat_is_one_only_at_the_centre_cell_and_extends_along_the_longer_side():
    bells = gaussians(torch.tensor([[16.0, 40, 176, 60]]), torch.Size((25, 50)))[0]
    assert (bells == 1).nonzero().tolist() == [[12, 24]]
    assert bells[12, 28] > bells[16, 24]


def test_a_detector_trained_on_one_image_finds_its_box():
    torch.manual_seed(0)
    image = torch.full((3, 64, 64), 60, dtype=torch.uint8)
    image[0, 20:44, 12:36] = 250
    mask = torch.zeros(64, 64, dtype=torch.uint8)
    mask[20:44, 12:36] = 1
    target = labels((2, 12, 20, 36, 44), masks=[mask])
    model = Detector(2, width=16, masks=True)
    optimizer = torch.optim.Adam(model.parameters(), 5e-3)
    for _ in range(60):
        optimizer.zero_grad()
        model.loss([image, image], [target, target]).backward()
        optimizer.step()
    best = {name: value[:1] for name, value in model.predict([image, image])[0].items()}
    assert hits(target, best, [0.3] * 2).all()
    assert hits(target, best, [0.3] * 2, masks=True).all()


def test_precision_and_recall_of_doors():
    is_door = torch.tensor([True, True, True, False, False])
    called = torch.tensor([True, True, False, True, False])
    assert door.precision_recall(is_door, called) == pytest.approx((200 / 3, 200 / 3))
    none = torch.zeros(5, dtype=torch.bool)
    assert np.isnan(door.precision_recall(is_door, none)[0])


def test_cached_items_equal_those_of_the_dataset_and_are_read_back(tmp_path):
    config = damage.Config.from_values(damage.MANY_DAMAGES)
    data = ContainerDataset("damage", config, seed=2, length=4, render=RenderSettings((96, 64)))
    first, again = rendered(data, tmp_path), rendered(data, tmp_path)
    assert len(list(tmp_path.iterdir())) == 1
    for i in range(4):
        image, target = data[i]
        kept_image, kept_target = again[i]
        assert (first[i][0] == kept_image).all()
        assert (target["masks"] == kept_target["masks"]).all()
        assert (target["boxes"] == kept_target["boxes"]).all()
        # cached images are JPEGs
        assert (image.float() - kept_image.float()).abs().mean() < 6
    data.close()


def test_cached_pairs_stay_together_in_every_batch(tmp_path):
    config = damage.Config.from_values(damage.MANY_DAMAGES)
    size = RenderSettings((64, 64))
    data = ContainerDataset("damage", config, 2, 3, size, items=ItemSettings(pairs=True))
    made = rendered(data, tmp_path)
    single = rendered(ContainerDataset("damage", config, 2, 3, size), tmp_path)
    assert len(made) == len(single) == 3
    for (images, targets), (image, target) in zip(made, single, strict=True):
        assert (images[0] == image).all()
        assert (targets[0]["masks"] == target["masks"]).all()
        assert targets[1]["labels"].tolist() == [1]
    assert any((images[0] != images[1]).any() for images, _ in made)
    for images, targets in Feed(made, 2, seed=1).passed(0):
        numbers = [target["image_id"] for target in targets]
        assert len(images) == len(targets)
        assert numbers[::2] == numbers[1::2]
        assert all(target["labels"].tolist() == [1] for target in targets[1::2])


def test_compressed_masks_give_the_same_scores():
    y, x = np.mgrid[:100, :200]
    one, other = ((y < 40) & (x > 50), (y > 20) & (x < 160))
    masks = [torch.from_numpy(mask) for mask in (one, other)]
    target = labels((1, 51, 0, 200, 40), (2, 0, 21, 160, 100), masks=masks)
    found = {
        **labels((1, 51, 0, 200, 40), (2, 0, 21, 150, 100)),
        "masks": torch.stack([masks[0], masks[1] & (torch.from_numpy(x) < 150)]),
        "scores": torch.tensor([0.9, 0.8]),
    }
    small = compressed(found)
    plain, same = (score([target], [each], NAMES, SIZE, masks=True) for each in (found, small))
    assert plain.summary == pytest.approx(same.summary, nan_ok=True)
    assert 0 < plain.summary["AP"] < 100
    least = [0.5] * 2
    assert (hits(target, small, least, masks=True) == hits(target, found, least, masks=True)).all()


def test_maps_in_bfloat16_are_close_to_those_in_float32(monkeypatch):
    torch.manual_seed(3)
    model = Detector(5, masks=True).eval()
    pixels = torch.rand(1, 3, 128, 192) * 2 - 1
    maps = {}
    for fast in (False, True):
        monkeypatch.setattr(detector, "_fast_bfloat16", lambda _, fast=fast: fast)
        with torch.no_grad():
            maps[fast] = model(pixels)
    for exact, close in zip(maps[False], maps[True], strict=True):
        assert exact.dtype == close.dtype == torch.float32
        assert 0 < (exact - close).abs().max() < 0.1 * exact.std()


def test_order_of_batches_depends_on_seed_and_pass():
    class Numbers(Kept):
        def __len__(self):
            return 9

        def __getitem__(self, position):
            return position, position

    items = Numbers([])

    def order(seed, number):
        return [k for _, targets in Feed(items, 2, seed).passed(number) for k in targets]

    assert order(1, 0) == order(1, 0)
    assert order(1, 0) != order(1, 1)
    assert sorted(order(1, 1)) == list(range(9))


def test_workers_render_new_texts_for_every_pass():
    scenes = SceneSettings(cameras=("Cr",), all_views=False)
    data = ContainerDataset("text", seed=1, length=4, scenes=scenes)
    feed = Feed(data, 4, seed=1, workers=1)
    passes = [[batch for batch in feed.passed(number)] for number in (0, 1)]
    for images, targets in passes[0] + passes[1]:
        assert len(images) == len(targets) > 0
        assert all(target["parts"] for target in targets)
    first, second = ({target["text"] for target in batches[0][1]} for batches in passes)
    assert first.isdisjoint(second)


def test_table_shows_a_dash_for_missing_values():
    table = Table("T", ["a", "b", "c"], [["x", 3, float("nan")], ["y", 2, 1.25]])
    assert table.markdown().splitlines()[2:] == [
        "| a | b | c |",
        "| --- | --- | --- |",
        "| x | 3 | – |",
        "| y | 2 | 1.2 |",
    ]
