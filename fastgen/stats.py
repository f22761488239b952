"""What a dataset holds: the paper's Tables 1 to 3 and the sizes of its Fig. 8, from the files."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from fastgen.classes import DAMAGE_CLASSES, DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.errors import OutputError
from fastgen.sampling import SPLITS

_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def report(out: Path) -> str:
    """Tables as text. Raises OutputError when `out` is no finished dataset."""
    if not (out / "dataset.json").is_file():
        raise OutputError(f"{out}: no dataset.json; give a folder that `fastgen generate` made")
    try:
        damage = {split: _coco(out, split) for split in SPLITS}
    except (OSError, ValueError) as error:
        raise OutputError(f"{out}: not finished or damaged ({error}); run generate again") from None
    markers = {split: _boxes(out, split) for split in SPLITS}
    images = sum(len(damage[split]["images"]) for split in SPLITS)
    boxes = [box for split in SPLITS for box in markers[split]]
    visible = Counter(DETECTION_CLASSES[int(box[0])] for box in boxes)
    per_image = (sum(visible.values()) - visible["container"] - visible["text"]) / max(images, 1)
    parts = [
        "Table 1: images without and with visible damage",
        _table(SPLITS, {"No damage": _undamaged(damage, 0), "Damaged": _undamaged(damage, 1)}),
        "Table 2: instances in the damage task",
        _table(SPLITS, {name: _instances(damage, name) for name in SEGMENTATION_CLASSES}),
        "Table 3: instances in the marker task",
        _table(SPLITS, {name: _labels(markers, name) for name in DETECTION_CLASSES}),
        f"Per image: {per_image:.2f} markers, {visible['text'] / max(images, 1):.2f} texts",
        "Fig. 8: box width and height as shares of the image, at quantiles "
        + ", ".join(f"{q:g}" for q in _QUANTILES),
        _sizes("damage", _damage_sizes(damage)),
        _sizes("markers", np.array([box[3:] for box in boxes if box[0] >= 2]).reshape(-1, 2)),
    ]
    return "\n\n".join(parts)


def _coco(out: Path, split: str) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((out / f"damage/coco_{split}.json").read_text("utf-8"))
    return data


def _boxes(out: Path, split: str) -> list[list[float]]:
    lines = []
    for path in sorted((out / "imdg/labels" / split).glob("*.txt")):
        lines += path.read_text(encoding="utf-8").splitlines()
    return [[float(v) for v in line.split()] for line in lines]


def _undamaged(damage: dict[str, Any], wanted: int) -> list[int]:
    counts = []
    for data in damage.values():
        hit = {item["image_id"] for item in data["annotations"] if item["category_id"] > 1}
        counts.append(len(hit) if wanted else len(data["images"]) - len(hit))
    return counts


def _instances(damage: dict[str, Any], name: str) -> list[int]:
    number = SEGMENTATION_CLASSES.index(name) + 1
    return [
        sum(item["category_id"] == number for item in data["annotations"])
        for data in damage.values()
    ]


def _labels(markers: dict[str, list[list[float]]], name: str) -> list[int]:
    number = DETECTION_CLASSES.index(name)
    return [sum(int(box[0]) == number for box in boxes) for boxes in markers.values()]


def _damage_sizes(damage: dict[str, Any]) -> np.ndarray:
    shares = []
    for data in damage.values():
        sizes = {image["id"]: (image["width"], image["height"]) for image in data["images"]}
        for item in data["annotations"]:
            if item["category_id"] <= len(DAMAGE_CLASSES) + 1 and item["category_id"] > 1:
                width, height = sizes[item["image_id"]]
                shares.append((item["bbox"][2] / width, item["bbox"][3] / height))
    return np.array(shares).reshape(-1, 2)


def _table(columns: tuple[str, ...], rows: dict[str, list[int]]) -> str:
    head = f"{'':14}" + "".join(f"{name:>9}" for name in columns)
    body = [f"{name:14}" + "".join(f"{v:9d}" for v in values) for name, values in rows.items()]
    return "\n".join([head, *body])


def _sizes(name: str, shares: np.ndarray) -> str:
    if not len(shares):
        return f"{name:10} none"
    lines = []
    for axis, values in (("width", shares[:, 0]), ("height", shares[:, 1])):
        at = np.quantile(values, _QUANTILES)
        lines.append(f"{name:10} {axis:8}" + "".join(f"{v:8.4f}" for v in at))
    return "\n".join(lines)
