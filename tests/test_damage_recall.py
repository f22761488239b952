"""Recall of damages by shape, size and change, against cases made by hand."""

import numpy as np
import pytest
import torch
from common.damage_recall import Outcome, changes, recall_tables, slenderness

SIDE = 200


def square(left, side):
    mask = np.zeros((SIDE, SIDE), np.uint8)
    mask[10 : 10 + side, left : left + side] = 1
    return mask


def labelled(*things):
    """Return the target of tuples (label, mask)."""
    masks = np.array([mask for _, mask in things])
    places = [np.nonzero(mask) for mask in masks]
    boxes = [(x.min(), y.min(), x.max() + 1, y.max() + 1) for y, x in places]
    return {
        "labels": torch.tensor([label for label, _ in things]),
        "masks": torch.from_numpy(masks),
        "boxes": torch.tensor(boxes, dtype=torch.float32),
        "area": torch.from_numpy(masks.sum((1, 2)).astype(np.float32)),
        "iscrowd": torch.zeros(len(things), dtype=torch.int64),
    }


def found(target, *numbers):
    """Return detections that equal some of the labels."""
    chosen = torch.tensor(numbers)
    parts = {name: target[name][chosen] for name in ("boxes", "labels")}
    return {**parts, "masks": target["masks"][chosen] > 0, "scores": torch.ones(len(numbers))}


def test_slenderness_of_a_tilted_bar_is_its_length_over_its_width():
    y, x = np.mgrid[:200, :200] - 100.0
    along, across = 0.8 * x + 0.6 * y, 0.8 * y - 0.6 * x
    bar = (abs(along) < 60) & (abs(across) < 10)
    assert slenderness(bar) == pytest.approx(6, rel=0.05)
    square = np.zeros((9, 9), np.uint8)
    square[2:6, 3:7] = 1
    assert slenderness(square) == pytest.approx(1)


def test_change_hardly_counts_single_pixels():
    target = labelled((2, square(20, 100)))
    whole = torch.full((3, SIDE, SIDE), 100, dtype=torch.uint8)
    noisy = whole.clone()
    noisy[:, ::2, ::2] = 160
    assert changes([noisy, whole], target) == pytest.approx([15], abs=2)


@pytest.mark.parametrize(("share", "expected"), [(0.05, 0), (0.2, 60), (1.0, 60)])
def test_change_is_that_of_the_tenth_that_changes_most(share, expected):
    target = labelled((2, square(20, 100)))
    whole = torch.full((3, SIDE, SIDE), 100, dtype=torch.uint8)
    damaged = whole.clone()
    damaged[1, 10:110, 20 : 20 + round(100 * share)] = 160
    assert changes([damaged, whole], target) == pytest.approx([expected], abs=2)


def test_damages_are_counted_by_kind_size_and_change():
    container = (1, np.ones((SIDE, SIDE), np.uint8))
    bar = np.zeros((SIDE, SIDE), np.uint8)
    bar[150:160, 5:17] = bar[150, 5:66] = 1
    first = labelled(container, (2, square(5, 10)), (2, square(30, 40)), (5, square(80, 100)))
    second = labelled(container, (2, bar))
    detected = found(first, 0, 1, 3)
    detected["masks"][2] = False  # the right box with another mask
    detected["scores"][2] = 0.4
    alarms = {**found(first, 0, 1, 3), "scores": torch.tensor([1.0, 0.6, 0.2])}
    tested = [
        Outcome(first, detected, alarms, np.array([99.0, 5.0, 10.0, 40.0])),
        Outcome(second, found(second, 0), found(second, 0), np.array([99.0, 31.9])),
    ]
    usual, by_size, by_change = recall_tables(tested, [0.5, 0.5, 0.5, 0.5, 0.3])
    shares = {row[0]: row[1:] for row in usual.rows}
    assert shares["all damages"] == ["–", 4, 50.0, 25.0, 1]
    assert shares["axis"] == ["0.50", 3, pytest.approx(100 / 3), pytest.approx(100 / 3), 1]
    assert shares["perforation"] == ["0.30", 1, 100.0, 0.0, 0]
    assert shares["small"] == ["–", 2, 50.0, 50.0, "–"]
    assert shares["larger"] == ["–", 2, 50.0, 0.0, "–"]
    assert shares["thin"] == shares["small and thin"] == ["–", 1, 0.0, 0.0, "–"]
    assert shares["not thin"] == ["–", 3, pytest.approx(200 / 3), pytest.approx(100 / 3), "–"]
    assert np.isnan(shares["dented"][2])
    _, by_size_strict, _ = recall_tables(tested, [0.5] * 5)
    assert by_size_strict.rows[0][1:] == ["1 of 2", "0 of 0", "0 of 1", "0 of 1"]
    assert by_size.heads == ["damages", "below 16 px", "16 to 32", "32 to 64", "64 px or more"]
    sizes = {row[0]: row[1:] for row in by_size.rows}
    assert sizes["all damages"] == ["1 of 2", "0 of 0", "0 of 1", "1 of 1"]
    assert sizes["axis"] == ["1 of 2", "0 of 0", "0 of 1", "0 of 0"]
    assert sizes["perforation"] == ["0 of 0", "0 of 0", "0 of 0", "1 of 1"]
    levels = {row[0]: row[1:] for row in by_change.rows}
    assert levels["all damages"] == ["1 of 1", "0 of 1", "0 of 1", "1 of 1"]
