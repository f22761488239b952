"""COCO masks and annotations. Format: cocodataset.org, 'Data format', and its mask API's notes."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import SEGMENTATION_CLASSES
from fastgen.sample import Box, Sample


def rle(mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Compressed run-length encoding of a mask [H, W]: {'size': [H, W], 'counts': text}.

    Runs go down the columns and begin with zeros.
    """
    flat = np.asarray(mask, bool).ravel(order="F")
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    edges = np.concatenate([[0], changes, [flat.size]])
    counts = np.diff(edges)
    if flat.size and flat[0]:
        counts = np.concatenate([[0], counts])
    return {"size": [int(mask.shape[0]), int(mask.shape[1])], "counts": _packed(counts)}


def _packed(counts: NDArray[np.int64]) -> str:
    """Run lengths as text: from the fourth on as differences to the one two before, then signed
    groups of 5 bits, lowest first, 0x20 marking that more follow, offset by 48."""
    rest = counts.astype(np.int64)
    rest[3:] -= counts[1:-2]
    columns, used = [], []
    open_ = np.ones(len(rest), bool)
    while open_.any():
        group = rest & 0x1F
        rest = rest >> 5
        more = np.where(group & 0x10, rest != -1, rest != 0)
        columns.append(group + np.where(more, 0x20, 0) + 48)
        used.append(open_)
        open_ = open_ & more
    text = np.stack(columns, axis=1)[np.stack(used, axis=1)]
    return text.astype(np.uint8).tobytes().decode("ascii")


def instances(sample: Sample) -> Iterator[tuple[int, Box, NDArray[np.bool_]]]:
    """Category, tight box and mask [H, W] of the container and of each visible damage.

    The container's mask spans its damages: they are part of it.
    """
    for value in (0, *np.unique(sample.damage[sample.damage >= 200]).tolist()):
        mask = sample.damage == value if value else sample.damage > 0
        columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
        if not rows.size:
            continue
        box = (int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
        yield int(value) // 100 if value else 1, box, mask


def annotations(sample: Sample) -> list[dict[str, Any]]:
    """Each of `instances` as COCO tells it: category, box (x, y, width, height), area and mask."""
    return [
        {
            "category_id": category,
            "bbox": [x0, y0, x1 - x0, y1 - y0],
            "area": int(np.count_nonzero(mask)),
            "segmentation": rle(mask),
            "iscrowd": 0,
        }
        for category, (x0, y0, x1, y1), mask in instances(sample)
    ]


def categories() -> list[dict[str, Any]]:
    """The five categories of the damage task."""
    return [
        {"id": i + 1, "name": name, "supercategory": "damage" if i else "container"}
        for i, name in enumerate(SEGMENTATION_CLASSES)
    ]
