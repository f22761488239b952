"""Statistics of a dataset: Tables 1 to 3 of the SeaFront paper and the box sizes of its Fig. 8.

Labels are counted from the records in the shards' manifests, so this works for every layout and
storage.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fastgen.classes import ALL_DAMAGE_CLASSES, MARK_CLASSES, MARKER_CLASSES
from fastgen.dataset.finished import open_finished
from fastgen.formats.format import Format, Record
from fastgen.formats.registry import formats_of
from fastgen.sampling.scene import SPLITS

_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass
class _Labels:
    """Labels of one task in one split.

    Attributes:
        by_class: Number of labels by class name.
        sizes: Width and height of each box of a damage or marker, as shares of the image.
        images: Number of images that have such a box.
    """

    by_class: Counter[str] = field(default_factory=Counter)
    sizes: list[tuple[float, float]] = field(default_factory=list)
    images: int = 0

    def add(self, task: Format, record: Record) -> None:
        """Count the labels of one image."""
        image_width, image_height = record["size"]
        before = len(self.sizes)
        for name, (_, _, width, height) in task.labels(record["facts"].get(task.name, ())):
            self.by_class[name] += 1
            if name in ALL_DAMAGE_CLASSES or name in MARKER_CLASSES:
                self.sizes.append((width / image_width, height / image_height))
        self.images += len(self.sizes) > before


def report(out: str | Path) -> str:
    """Return the tables of the dataset in a folder or at an address, as text.

    Raises:
        OutputError: `out` is not a finished dataset.
    """
    return "\n\n".join(_tables(str(out)))


def _tables(out: str) -> Iterator[str]:
    dataset = open_finished(out)
    written = dataset.manifest["formats"]
    damage, imdg = formats_of(("damage", "imdg"))
    images = dict.fromkeys(SPLITS, 0)
    damages = {split: _Labels() for split in SPLITS}
    markers = {split: _Labels() for split in SPLITS}
    for record in (each for shard in dataset.shards for each in dataset.records(shard)):
        split = record["split"]
        images[split] += 1
        damages[split].add(damage, record)
        markers[split].add(imdg, record)
    count = max(sum(images.values()), 1)
    marker_sizes = [size for each in markers.values() for size in each.sizes]
    texts = sum(each.by_class["text"] for each in markers.values())
    undamaged = [images[split] - damages[split].images for split in SPLITS]
    damaged = [each.images for each in damages.values()]
    sizes = []
    if damage.name in written:
        yield "Table 1: images without and with visible damage"
        yield _table({"No damage": undamaged, "Damaged": damaged})
        yield "Table 2: instances in the damage task"
        yield _class_table(damage, damages)
        sizes.append(_sizes("damage", [size for each in damages.values() for size in each.sizes]))
    else:
        yield "Images"
        yield _table({"All": [*images.values()]})
    if imdg.name in written:
        yield "Table 3: instances in the marker task"
        yield _class_table(imdg, markers)
        yield f"Per image: {len(marker_sizes) / count:.2f} markers, {texts / count:.2f} texts"
        sizes.append(_sizes("markers", marker_sizes))
    if sizes:
        quantiles = ", ".join(f"{q:g}" for q in _QUANTILES)
        yield f"Fig. 8: box width and height as shares of the image, at quantiles {quantiles}"
        yield from sizes


def _class_table(task: Format, found: dict[str, _Labels]) -> str:
    rows = {name: [each.by_class[name] for each in found.values()] for name in task.classes}
    # most datasets have neither marks nor scrapes
    optional = (*MARK_CLASSES, "scrape")
    return _table({n: row for n, row in rows.items() if n not in optional or any(row)})


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
