"""Recall of damages by kind, shape, size and change of the image."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from common.detection_metrics import Found, hits
from common.run import Table
from fastgen.classes import SEGMENTATION_CLASSES

SMALL_PX = 32 * 32
"""Visible pixels below which COCO calls an object small."""

THIN = 3.0
"""Smallest length-to-width ratio of a thin damage, from its minimum-area rectangle."""

SIZES_PX = (0, 16, 32, 64)
"""Lower limits of the groups by size, the square root of the visible pixels."""

CHANGES = (0, 8, 16, 32)
"""Lower limits of the groups by change, in 8-bit levels."""

_BLUR_PX = 1.2
_MOST_CHANGED = 90.0


class Outcome(NamedTuple):
    """Labels of one test image and what the detector finds.

    Attributes:
        target: Labels in the loader's detection form, with masks.
        found: Detections.
        undamaged: Detections in the same image without damages.
        change: Change of the image by each labelled object [N], see `changes`.
    """

    target: Mapping[str, Any]
    found: Found
    undamaged: Found
    change: NDArray[np.float64]


def changes(images: Sequence[torch.Tensor], target: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return how much each object changes an image, in 8-bit levels [N].

    A tenth of the object's pixels change by this much or more, in the channel that changes most.
    The images are blurred with a sigma of 1.2 pixels, which removes most of the noise.

    Args:
        images: The image uint8 [3, H, W] with the objects, and its counterpart without them.
        target: Its labels, with masks.
    """
    blurred = (
        cv2.GaussianBlur(image.permute(1, 2, 0).float().numpy(), (0, 0), _BLUR_PX)
        for image in images
    )
    change = np.abs(np.subtract(*blurred)).max(axis=2)
    masks = target["masks"].numpy() > 0
    return np.array([np.percentile(change[mask], _MOST_CHANGED) for mask in masks])


def slenderness(mask: NDArray[np.uint8]) -> float:
    """Return the length-to-width ratio of the minimum-area rectangle around a mask [H, W]."""
    rows, columns = np.nonzero(mask)
    points = np.stack([columns, rows], axis=1).astype(np.float32)
    # plus one, because pixels have a size: a row of n pixels has the ratio n
    sides = np.array(cv2.minAreaRect(points)[1]) + 1
    return float(sides.max() / sides.min())


def recall_tables(outcomes: Sequence[Outcome], least: Sequence[float]) -> list[Table]:
    """Return three tables of the damages found at an IoU of 0.5.

    They list shares by kind and shape, with the detections in undamaged images, and numbers by size
    and by change of the image.

    Args:
        outcomes: Labels and detections by image.
        least: Smallest score of each class that counts.
    """
    labels = _joined(outcomes, lambda each: each.target["labels"].numpy())
    areas = _joined(outcomes, lambda each: each.target["area"].numpy())
    thin = _joined(outcomes, lambda each: _slender(each.target["masks"].numpy()))
    change = _joined(outcomes, lambda each: each.change)
    by_box = _joined(outcomes, lambda each: hits(each.target, each.found, least))
    by_mask = _joined(outcomes, lambda each: hits(each.target, each.found, least, masks=True))
    alarms = _joined(outcomes, lambda each: _counted_labels(each.undamaged, least))
    damages, small = labels > 1, areas < SMALL_PX
    numbers = {name: k for k, name in enumerate(SEGMENTATION_CLASSES, start=1) if k > 1}
    kinds = {"all damages": damages, **{name: labels == k for name, k in numbers.items()}}
    shapes = {"small": small, "larger": ~small, "thin": thin, "not thin": ~thin}
    shapes["small and thin"] = small & thin
    shapes = {name: damages & chosen for name, chosen in shapes.items()}
    rows: list[list[object]] = []
    for name, chosen in {**kinds, **shapes}.items():
        found = [int(chosen.sum()), _percent(by_box[chosen]), _percent(by_mask[chosen])]
        k = numbers.get(name)
        false_alarms = int((alarms == k if k else alarms > 1).sum()) if name in kinds else "–"
        rows.append([name, f"{least[k - 1]:.2f}" if k else "–", *found, false_alarms])
    heads = ["damages", "score", "labels", "by box, %", "by mask, %", "in undamaged images"]
    size_title = "Damages found by box, by size (square root of the visible pixels)"
    return [
        Table("Damages found at an IoU of 0.5", heads, rows),
        _numbers(size_title, kinds, by_box, _Groups(np.sqrt(areas), SIZES_PX, "px")),
        _numbers(
            "Damages found by box, by change of the image (8-bit levels)",
            kinds,
            by_box,
            _Groups(change, CHANGES, "levels"),
        ),
    ]


def _counted_labels(found: Found, least: Sequence[float]) -> NDArray[np.int64]:
    """Return the labels of the detections that count [N]."""
    labels = found["labels"].numpy()
    counted: NDArray[np.int64] = labels[found["scores"].numpy() >= np.asarray(least)[labels - 1]]
    return counted


class _Groups(NamedTuple):
    """Groups of values [N] by their lower limits."""

    values: NDArray[np.floating]
    limits: Sequence[int]
    unit: str


def _numbers(
    title: str, kinds: Mapping[str, NDArray[np.bool_]], hit: NDArray[np.bool_], groups: _Groups
) -> Table:
    """Return how many damages of each kind [N] are found in each group."""
    limits, unit = groups.limits, groups.unit
    group = np.digitize(groups.values, limits) - 1
    inner = [f"{low} to {high}" for low, high in itertools.pairwise(limits[1:])]
    heads = [f"below {limits[1]} {unit}", *inner, f"{limits[-1]} {unit} or more"]
    rows: list[list[object]] = []
    for name, kind in kinds.items():
        chosen = [kind & (group == k) for k in range(len(limits))]
        rows.append([name, *(f"{hit[part].sum()} of {part.sum()}" for part in chosen)])
    return Table(title, ["damages", *heads], rows)


def _joined(outcomes: Sequence[Outcome], of: Callable[[Outcome], NDArray[Any]]) -> NDArray[Any]:
    return np.concatenate([of(each) for each in outcomes])


def _slender(masks: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.array([slenderness(mask) >= THIN for mask in masks], bool)


def _percent(hit: NDArray[np.bool_]) -> float:
    return 100 * float(hit.mean()) if len(hit) else float("nan")
