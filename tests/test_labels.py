"""Object labels compared with brute force over the id image."""

import numpy as np
import pytest

from fastgen.classes import MARKER_CLASSES
from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.labels.objects import labelled_decals
from fastgen.labels.visibility import mask_box, value_boxes
from tests import oracle


@pytest.fixture(scope="module")
def samples():
    config = Config.from_values({"spreader": {"probability": 0}, "labels": {"background": "none"}})
    with Generator(config, seed=11, size=(480, 360)) as generator:
        return [
            generator.render(index=i, camera=c) for i in range(4) for c in ("A", "B", "Cl", "Cr")
        ]


def test_boxes_and_areas_equal_brute_force_over_pixels(samples):
    for sample in samples:
        for item in sample.objects:
            mask = sample.ids > 0 if item.class_name == "container" else sample.ids == item.id
            assert item.bbox == oracle.box_of(mask)
            assert item.area == mask.sum()


def test_every_id_in_the_image_has_an_object_and_ids_are_unique(samples):
    for sample in samples:
        ids = [item.id for item in sample.objects]
        assert len(ids) == len(set(ids))
        assert set(np.unique(sample.ids)) - {0} <= set(ids)


def test_objects_carry_class_text_and_running_instance(samples):
    for sample in samples:
        seen: dict[str, list[int]] = {}
        for item in sample.objects[1:]:
            decal = labelled_decals(sample.scene)[item.id]
            assert item.class_name == decal.class_name
            assert item.text == " ".join(decal.lines)
            assert item.class_name in (*MARKER_CLASSES, "text")
            seen.setdefault(item.class_name, []).append(item.instance)
        assert all(numbers == list(range(1, len(numbers) + 1)) for numbers in seen.values())


def test_visible_boxes_lie_in_amodal_boxes(samples):
    for sample in samples:
        for item in sample.objects:
            if item.bbox is None or item.amodal_bbox is None:
                continue
            x0, y0, x1, y1 = item.bbox
            ax0, ay0, ax1, ay1 = item.amodal_bbox
            assert x0 >= ax0 - 1
            assert y0 >= ay0 - 1
            assert x1 <= ax1 + 1
            assert y1 <= ay1 + 1


def test_truncated_means_the_amodal_box_leaves_the_image(samples):
    found = {True: 0, False: 0}
    for sample in samples:
        for item in sample.objects:
            if not item.area or item.amodal_bbox is None:
                continue
            x0, y0, x1, y1 = item.amodal_bbox
            leaves = x0 < 0 or y0 < 0 or x1 > 480 or y1 > 360
            assert item.truncated == leaves
            found[leaves] += 1
    assert all(found.values())


def test_unoccluded_markers_are_nearly_fully_visible(samples):
    fractions = [
        item.visible_fraction
        for sample in samples
        for item in sample.objects
        if item.class_name.startswith("C") and item.area > 400 and not item.truncated
    ]
    assert fractions
    assert np.median(fractions) > 0.85


def test_boxes_of_random_ids_equal_brute_force():
    ids = np.random.default_rng(0).choice([0, 1, 2, 5, 9], size=(37, 53)).astype(np.uint16)
    ids[20:24] = 5  # a run that continues from each row's end into the next row
    boxes, areas = value_boxes(ids, 2, 10)
    for value in range(2, 10):
        assert boxes[value - 2] == oracle.box_of(ids == value)
        assert areas[value - 2] == (ids == value).sum()
    none, areas = value_boxes(ids[:0], 2, 10)
    assert none == [None] * 8
    assert not areas.any()


def test_the_box_of_a_mask_equals_brute_force():
    mask = np.zeros((37, 53), bool)
    assert mask_box(mask) is None
    mask[5, 50] = mask[31, 7] = True
    assert mask_box(mask) == oracle.box_of(mask) == (7, 5, 51, 32)
