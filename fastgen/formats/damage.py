"""Damage detection and segmentation: 16-bit masks, COCO, and YOLO outlines."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DAMAGE_VALUES, SEGMENTATION_CLASSES
from fastgen.files.images import png
from fastgen.formats import DatasetFiles, Files, Format, Item, Records, coco
from fastgen.formats.yolo import line, outline
from fastgen.labels.visibility import mask_box, window
from fastgen.sample import Box, Sample

CATEGORIES = [
    {"id": i + 1, "name": name, "supercategory": "damage" if i else "container"}
    for i, name in enumerate(SEGMENTATION_CLASSES)
]
"""The five categories of the task."""


def instances(sample: Sample) -> Iterator[tuple[int, Box, NDArray[np.bool_], bool]]:
    """Category, tight box, mask [H, W] and whether it is ignored, of the container and each damage
    that is seen. The container's mask spans its damages: they are part of it."""
    own = [thing for thing in sample.objects if thing.class_name in SEGMENTATION_CLASSES]
    ignored = {thing.id: thing.ignored for thing in own}
    damaged = sample.damage.ravel()[np.flatnonzero(sample.damage >= DAMAGE_VALUES.start)]
    for value in (0, *np.unique(damaged).tolist()):
        mask = sample.damage == value if value else sample.damage > 0
        box = mask_box(mask)
        if box is not None:
            yield int(value) // 100 if value else 1, box, mask, ignored.get(value or 1, False)


class _Damage(Format):
    name = "damage"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        found = list(instances(item.sample))
        height, width = item.sample.damage.shape
        lines = []
        for category, box, mask, ignored in found:
            polygon = outline(window(mask, box))
            if len(polygon) > 2 and not ignored:
                points = (polygon + box[:2]) / (width, height)
                lines.append(line(category - 1, points.ravel().tolist()))
        files: Files = {
            f"damage/masks/{item.split}/{item.stem}.png": png(item.sample.damage),
            f"damage/yolo/{item.split}/{item.stem}.txt": "".join(lines).encode(),
        }
        return files, [
            item.container_annotation
            if category == 1
            else coco.annotation(category, box, window(mask, box), (width, height), ignored)
            for category, box, mask, ignored in found
        ]

    def folders(self, split: str) -> Sequence[str]:
        return (f"damage/masks/{split}", f"damage/yolo/{split}")

    def dataset_files(self, split: str, records: Records) -> DatasetFiles:
        words = "Synthetic shipping containers with damage masks"
        text = coco.file_text(words, CATEGORIES, records, self.name)
        yield f"damage/coco_{split}.json", text


FORMAT = _Damage()
