"""What a dataset holds: the paper's Tables 1 to 3 and the sizes of its Fig. 8.

Counted from the records in the shards' manifests, which the label files are made of, so that it
works for every format and place.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.dataset.dataset_json import MANIFEST, read_manifest, told_by, without_manifest
from fastgen.dataset.storage import storage_of
from fastgen.errors import OutputError
from fastgen.formats import Record
from fastgen.formats.coco import trained_on
from fastgen.sampling.scene import SPLITS

_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_FIRST_MARKER = DETECTION_CLASSES.index("text") + 1


@dataclass
class _Counts:
    """Of one split. damages and markers: labels by class; the sizes are shares of the image."""

    images: int = 0
    damaged: int = 0
    damages: Counter[str] = field(default_factory=Counter)
    markers: Counter[str] = field(default_factory=Counter)
    damage_sizes: list[tuple[float, float]] = field(default_factory=list)
    marker_sizes: list[tuple[float, float]] = field(default_factory=list)

    def add(self, record: Record) -> None:
        """Count one image."""
        image_width, image_height = record["size"]
        damages, markers = (trained_on(record["facts"][task]) for task in ("damage", "imdg"))
        self.images += 1
        self.damaged += any(item["category_id"] > 1 for item in damages)
        for item in damages:
            self.damages[SEGMENTATION_CLASSES[item["category_id"] - 1]] += 1
            if item["category_id"] > 1:
                _, _, width, height = item["bbox"]
                self.damage_sizes.append((width / image_width, height / image_height))
        for item in markers:
            number = item["category_id"] - 1
            self.markers[DETECTION_CLASSES[number]] += 1
            if number >= _FIRST_MARKER:
                _, _, width, height = item["bbox"]
                self.marker_sizes.append((width / image_width, height / image_height))


def report(out: str | Path) -> str:
    """Tables as text, of the dataset in a folder or at an address.

    Raises OutputError when `out` is no finished dataset.
    """
    counts = {split: _Counts() for split in SPLITS}
    for record in _records(str(out)):
        counts[record["split"]].add(record)
    images = sum(each.images for each in counts.values())
    visible = sum((each.markers for each in counts.values()), Counter())
    per_image = (visible.total() - visible["container"] - visible["text"]) / max(images, 1)
    tables = (
        ("damage", SEGMENTATION_CLASSES, [each.damages for each in counts.values()]),
        ("marker", DETECTION_CLASSES, [each.markers for each in counts.values()]),
    )
    sound = [each.images - each.damaged for each in counts.values()]
    parts = [
        "Table 1: images without and with visible damage",
        _table({"No damage": sound, "Damaged": [each.damaged for each in counts.values()]}),
    ]
    for number, (task, classes, found) in enumerate(tables, start=2):
        parts.append(f"Table {number}: instances in the {task} task")
        parts.append(_table({name: [each[name] for each in found] for name in classes}))
    damage_sizes = [size for each in counts.values() for size in each.damage_sizes]
    marker_sizes = [size for each in counts.values() for size in each.marker_sizes]
    parts += [
        f"Per image: {per_image:.2f} markers, {visible['text'] / max(images, 1):.2f} texts",
        "Fig. 8: box width and height as shares of the image, at quantiles "
        + ", ".join(f"{q:g}" for q in _QUANTILES),
        _sizes("damage", damage_sizes),
        _sizes("markers", marker_sizes),
    ]
    return "\n\n".join(parts)


def _records(out: str) -> Iterator[Record]:
    """One of each image, shard by shard."""
    storage = storage_of(out)
    try:
        told = told_by(storage.read(MANIFEST))
    except FileNotFoundError:
        raise without_manifest(storage, out) from None
    damaged = OutputError(f"{out}: is damaged; run fastgen verify {out}")
    if told is None:
        raise damaged
    if "digest" not in told:
        raise OutputError(f"{out}: the dataset is not finished; run generate again")
    for number in told["shards"]:
        manifest = read_manifest(storage, int(number))
        if manifest is None:
            raise damaged
        yield from manifest["records"]


def _table(rows: dict[str, list[int]]) -> str:
    head = f"{'':14}" + "".join(f"{name:>9}" for name in SPLITS)
    body = [f"{name:14}" + "".join(f"{v:9d}" for v in values) for name, values in rows.items()]
    return "\n".join([head, *body])


def _sizes(name: str, shares: list[tuple[float, float]]) -> str:
    if not shares:
        return f"{name:10} none"
    lines = []
    for axis, values in zip(("width", "height"), np.array(shares).T, strict=True):
        at = np.quantile(values, _QUANTILES)
        lines.append(f"{name:10} {axis:8}" + "".join(f"{v:8.4f}" for v in at))
    return "\n".join(lines)
