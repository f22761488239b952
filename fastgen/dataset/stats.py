"""Statistics of a dataset: Tables 1 to 3 of the SeaFront paper and the box sizes of its Fig. 8.

Labels are counted from the records in the shards' manifests, so this works for every layout and
storage.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fastgen.classes import ALL_SEGMENTATION_CLASSES, MARK_CLASSES, SEGMENTATION_CLASSES
from fastgen.dataset.finished import open_finished
from fastgen.formats import coco
from fastgen.formats.format import Record
from fastgen.formats.registry import formats_for
from fastgen.sampling.scene import SPLITS

_TITLES = {
    "damage": "Table 2: instances in the damage task",
    "imdg": "Table 3: instances in the marker task",
}

NOT_MEASURED = ("container", "text", *MARK_CLASSES)
"""Classes that are neither damages nor dangerous-goods markers."""

_NAMES = {"damage": "damage", "imdg": "markers"}

RARE = (*MARK_CLASSES, *ALL_SEGMENTATION_CLASSES[len(SEGMENTATION_CLASSES) :])
"""Classes that most datasets of versions without class lists do not have."""

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass
class _Labels:
    """Labels of one task in one split.

    Attributes:
        task: Name of the task.
        classes: Class names in the order of the categories.
        by_class: Number of labels by class name.
        sizes: Width and height of each box of a damage, marker or labelled sticker, as shares of
            the image.
        images: Number of images.
        images_with: Number of images that have such a box.
    """

    task: str
    classes: Sequence[str]
    by_class: Counter[str] = field(default_factory=Counter)
    sizes: list[tuple[float, float]] = field(default_factory=list)
    images: int = 0
    images_with: int = 0

    def add(self, record: Record) -> None:
        """Count the labels of one image."""
        image_width, image_height = record["size"]
        before = len(self.sizes)
        labels = coco.labels(record["facts"].get(self.task, ()), self.classes)
        for name, (_, _, width, height) in labels:
            self.by_class[name] += 1
            if name not in NOT_MEASURED:
                self.sizes.append((width / image_width, height / image_height))
        self.images += 1
        self.images_with += len(self.sizes) > before


def report(out: str | Path) -> str:
    """Return `statistics` as tables for people."""
    return _tables(statistics(out))


def statistics(out: str | Path) -> dict[str, Any]:
    """Return the statistics of the dataset in a folder or at an address, as JSON values.

    Returns:
        images: Number of images by split.
        damaged_images: Number of images with visible damage by split.
        damage, imdg: Number of labels of the task by class name and split.
        markers_per_image, texts_per_image: Means over all images.
        box_sizes: Quantiles of the width and height of boxes as shares of the image: `quantiles`
            lists which, and `damage` and `imdg` have `width` and `height`; empty without boxes.

        What counts labels of a task that the dataset does not have is missing.

    Raises:
        OutputError: `out` is not a finished dataset.
    """
    dataset = open_finished(out)
    listed = dataset.manifest.get("classes", {})
    written = dataset.manifest["formats"]
    tasks = formats_for([task for task in _TITLES if task in written], listed)
    found = {
        task.name: {split: _Labels(task.name, task.classes) for split in SPLITS} for task in tasks
    }
    images = dict.fromkeys(SPLITS, 0)
    for record in (each for shard in dataset.shards for each in dataset.records(shard)):
        images[record["split"]] += 1
        for labels in found.values():
            try:
                labels[record["split"]].add(record)
            except IndexError:  # a label with a class that dataset.json does not list
                raise dataset.damaged() from None
    count = max(sum(images.values()), 1)
    statistics: dict[str, Any] = {"images": images}
    if damage := found.get("damage"):
        statistics["damaged_images"] = {split: each.images_with for split, each in damage.items()}
    for task, labels in found.items():
        rows = {
            name: {split: each.by_class[name] for split, each in labels.items()}
            for name in labels[SPLITS[0]].classes
        }
        usual = listed.get(task, [name for name in rows if name not in RARE])
        statistics[task] = {n: row for n, row in rows.items() if n in usual or any(row.values())}
    if imdg := found.get("imdg"):
        markers = sum(len(each.sizes) for each in imdg.values())
        statistics["markers_per_image"] = markers / count
        texts = sum(each.by_class["text"] for each in imdg.values())
        statistics["texts_per_image"] = texts / count
    sizes = {task: _quantiles(labels) for task, labels in found.items()}
    return {**statistics, "box_sizes": {"quantiles": list(QUANTILES), **sizes}}


def _tables(found: dict[str, Any]) -> str:
    parts = ["Images", _table({"All": found["images"]})]
    if damaged := found.get("damaged_images"):
        undamaged = {split: count - damaged[split] for split, count in found["images"].items()}
        parts = ["Table 1: images without and with visible damage"]
        parts.append(_table({"No damage": undamaged, "Damaged": damaged}))
    tasks = [task for task in _TITLES if task in found]
    for task in tasks:
        parts += [_TITLES[task], _table(found[task])]
    if "markers_per_image" in found:
        markers, texts = found["markers_per_image"], found["texts_per_image"]
        parts.append(f"Per image: {markers:.2f} markers, {texts:.2f} texts")
    if tasks:
        quantiles = ", ".join(f"{q:g}" for q in found["box_sizes"]["quantiles"])
        parts.append(
            f"Fig. 8: box width and height as shares of the image, at quantiles {quantiles}"
        )
        parts += [_sizes(_NAMES[task], found["box_sizes"][task]) for task in tasks]
    return "\n\n".join(parts)


def _quantiles(labels: dict[str, _Labels]) -> dict[str, list[float]]:
    shares = [size for each in labels.values() for size in each.sizes]
    if not shares:
        return {}
    return {
        axis: np.quantile(values, QUANTILES).tolist()
        for axis, values in zip(("width", "height"), np.array(shares).T, strict=True)
    }


def _table(rows: dict[str, dict[str, int]]) -> str:
    wide = max(14, *(len(name) + 1 for name in rows))
    head = " " * wide + "".join(f"{name:>9}" for name in SPLITS)
    body = [
        f"{name:{wide}}" + "".join(f"{values[split]:9d}" for split in SPLITS)
        for name, values in rows.items()
    ]
    return "\n".join([head, *body])


def _sizes(name: str, sizes: dict[str, list[float]]) -> str:
    if not sizes:
        return f"{name:10} none"
    return "\n".join(
        f"{name:10} {axis:8}" + "".join(f"{value:8.4f}" for value in values)
        for axis, values in sizes.items()
    )
