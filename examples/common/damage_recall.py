"""Which damages a detector finds: by kind, size, shape and change of the image."""

from collections.abc import Mapping, Sequence
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
        target: Labels in the loader's detection form.
        found: Detections.
        change: Change of the image by each labelled object [N], see `changes`.
    """

    target: Mapping[str, Any]
    found: Found
    change: NDArray[np.float64]


def changes(images: Sequence[torch.Tensor], target: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return how much each object changes an image, in 8-bit levels [N].

    A tenth of the object's pixels change by this much or more. The images are blurred with a sigma
    of 1.2 pixels, which removes most of the noise.

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


def recall_tables(tested: Sequence[Outcome], least: float) -> list[Table]:
    """Return how many damages are found at an IoU of 0.5: by kind, by shape, size and change.

    Args:
        tested: Labels and detections by image.
        least: Smallest score that counts.
    """
    tally: dict[str, Any] = {}
    for each in tested:
        by_box = hits(each.target, each.found, least)
        by_mask = hits(each.target, each.found, least, masks=True)
        for name, chosen in _groups_of(each.target).items():
            counted = np.array([chosen.sum(), by_box[chosen].sum(), by_mask[chosen].sum()])
            tally[name] = tally.get(name, 0) + counted
    rows = [
        [name, int(n), _percent(box, n), _percent(mask, n)]
        for name, (n, box, mask) in tally.items()
    ]
    title = f"Damages found at an IoU of 0.5 and a score of {least:.2f}, %"
    heads = ["damages", "labels", "by box", "by mask"]
    return [Table(title, heads, rows), *_visibility_tables(tested, least)]


def _visibility_tables(tested: Sequence[Outcome], least: float) -> list[Table]:
    """Return how many damages of each kind are found by box, by their size and by their change."""
    labels = np.concatenate([each.target["labels"].numpy() for each in tested])
    sizes = np.concatenate([np.sqrt(each.target["area"].numpy()) for each in tested])
    change = np.concatenate([each.change for each in tested])
    hit = np.concatenate([hits(each.target, each.found, least) for each in tested])
    tables = []
    for title, unit, limits, values in (
        ("size, the square root of its visible pixels", "px", SIZES_PX, sizes),
        ("change of the image, in 8-bit levels", "levels", CHANGES, change),
    ):
        groups = np.digitize(values, limits) - 1
        heads = [_range(limits, k, unit) for k in range(len(limits))]
        rows: list[list[object]] = []
        for number, name in enumerate(("all damages", *SEGMENTATION_CLASSES[1:]), start=1):
            kind = labels == number if number > 1 else labels > 1
            chosen = [kind & (groups == k) for k in range(len(limits))]
            rows.append([name, *(f"{hit[part].sum()} of {part.sum()}" for part in chosen)])
        tables.append(Table(f"Damages found by {title}", ["damages", *heads], rows))
    return tables


def _groups_of(target: Mapping[str, Any]) -> dict[str, NDArray[np.bool_]]:
    """Return for each kind of damage which labels of an image belong to it, bool [N] by name."""
    labels = target["labels"].numpy()
    damages = labels > 1
    small = damages & (target["area"].numpy() < SMALL_PX)
    slender = np.array([slenderness(mask) >= THIN for mask in target["masks"].numpy()], bool)
    kinds = {name: labels == k for k, name in enumerate(SEGMENTATION_CLASSES, start=1) if k > 1}
    thin = damages & slender
    sorts = {"small": small, "larger": damages & ~small, "thin": thin, "not thin": damages & ~thin}
    return {"all damages": damages, **kinds, **sorts, "small and thin": small & thin}


def _percent(part: int, whole: int) -> float:
    return 100 * part / whole if whole else float("nan")


def _range(limits: Sequence[int], k: int, unit: str) -> str:
    """Return the name of group k."""
    if k == 0:
        return f"below {limits[1]} {unit}"
    if k == len(limits) - 1:
        return f"{limits[k]} {unit} or more"
    return f"{limits[k]} to {limits[k + 1]}"
