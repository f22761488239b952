"""Statistics of a dataset: Tables 1 to 3 of the SeaFront paper and the box sizes of its Fig. 8.

Labels are counted from the records in the shards' manifests, so this works for every layout and
storage.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fastgen.classes import MARK_CLASSES
from fastgen.dataset.dataset_json import MANIFEST, parsed, read_manifest, without_manifest
from fastgen.dataset.storage import Storage, storage_of
from fastgen.errors import OutputError
from fastgen.formats import coco
from fastgen.formats.format import Record
from fastgen.formats.registry import known_formats
from fastgen.sampling.scene import SPLITS

_TITLES = {
    "damage": "Table 2: instances in the damage task",
    "imdg": "Table 3: instances in the marker task",
}

_NOT_MEASURED = ("container", "text", *MARK_CLASSES)
"""Classes that are neither damages nor dangerous-goods markers."""

_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass
class _Labels:
    """Labels of one task in one split.

    Attributes:
        task: Name of the task.
        classes: Class names in the order of the categories.
        by_class: Number of labels by class name.
        sizes: Width and height of each box of a damage or marker, as shares of the image.
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
        for name, (_, _, width, height) in coco.labels(record["facts"][self.task], self.classes):
            self.by_class[name] += 1
            if name not in _NOT_MEASURED:
                self.sizes.append((width / image_width, height / image_height))
        self.images += 1
        self.images_with += len(self.sizes) > before


def report(out: str | Path) -> str:
    """Return `statistics` as tables for people."""
    return _tables(statistics(out))


def statistics(out: str | Path) -> dict[str, Any]:
    """Return the statistics of the dataset in a folder or at an address, as JSON values.

    Returns:
        images, damaged_images: Number of images by split, all and with visible damage.
        damage, imdg: Number of labels of the task by class name and split.
        markers_per_image, texts_per_image: Means over all images.
        box_sizes: Quantiles of the width and height of boxes as shares of the image: `quantiles`
            lists which, and `damage` and `markers` have `width` and `height`; empty without boxes.

    Raises:
        OutputError: `out` is not a finished dataset.
    """
    storage = storage_of(out)
    manifest = _manifest(storage, str(out))
    # datasets of older versions do not list their classes
    classes = {
        task: manifest.get("classes", {}).get(task, known_formats()[task].classes)
        for task in _TITLES
    }
    found = {task: {split: _Labels(task, classes[task]) for split in SPLITS} for task in _TITLES}
    for record in _records(storage, manifest, str(out)):
        for task in _TITLES:
            try:
                found[task][record["split"]].add(record)
            except IndexError:  # a label with a class that dataset.json does not list
                raise _damaged(str(out)) from None
    damage, imdg = found["damage"], found["imdg"]
    images = {split: each.images for split, each in damage.items()}
    count = max(sum(images.values()), 1)
    return {
        "images": images,
        "damaged_images": {split: each.images_with for split, each in damage.items()},
        **{
            task: {
                name: {split: each.by_class[name] for split, each in labels.items()}
                for name in classes[task]
            }
            for task, labels in found.items()
        },
        "markers_per_image": sum(len(each.sizes) for each in imdg.values()) / count,
        "texts_per_image": sum(each.by_class["text"] for each in imdg.values()) / count,
        "box_sizes": {
            "quantiles": list(_QUANTILES),
            "damage": _quantiles(damage),
            "markers": _quantiles(imdg),
        },
    }


def _tables(found: dict[str, Any]) -> str:
    damaged, sizes = found["damaged_images"], found["box_sizes"]
    undamaged = {split: count - damaged[split] for split, count in found["images"].items()}
    per_image = f"{found['markers_per_image']:.2f} markers, {found['texts_per_image']:.2f} texts"
    return "\n\n".join(
        [
            "Table 1: images without and with visible damage",
            _table({"No damage": undamaged, "Damaged": damaged}),
            *(part for task, title in _TITLES.items() for part in (title, _table(found[task]))),
            f"Per image: {per_image}",
            "Fig. 8: box width and height as shares of the image, at quantiles "
            + ", ".join(f"{q:g}" for q in sizes["quantiles"]),
            _sizes("damage", sizes["damage"]),
            _sizes("markers", sizes["markers"]),
        ]
    )


def _manifest(storage: Storage, out: str) -> dict[str, Any]:
    try:
        manifest = parsed(storage.read(MANIFEST))
    except FileNotFoundError:
        raise without_manifest(storage, out) from None
    if manifest is None:
        raise _damaged(out)
    if "digest" not in manifest:
        raise OutputError(f"{out}: the dataset is not finished; run generate again")
    return manifest


def _records(storage: Storage, manifest: dict[str, Any], out: str) -> Iterator[Record]:
    for number in manifest["shards"]:
        shard = read_manifest(storage, int(number))
        if shard is None:
            raise _damaged(out)
        yield from shard["records"]


def _damaged(out: str) -> OutputError:
    return OutputError(f"{out}: is damaged; run fastgen verify {out}")


def _quantiles(labels: dict[str, _Labels]) -> dict[str, list[float]]:
    shares = [size for each in labels.values() for size in each.sizes]
    if not shares:
        return {}
    return {
        axis: np.quantile(values, _QUANTILES).tolist()
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
