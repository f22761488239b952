"""Is a dataset whole, and do its files agree with each other?"""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.errors import FastgenError, OutputError
from fastgen.records import from_plain
from fastgen.sampling import SPLITS
from fastgen.scene import Scene

_TOP = {
    *("dataset.json", "contact_sheet.png", "images", "damage", "imdg", "text", "door", "scenes"),
}


def verify(out: Path) -> list[str]:
    """Every fault found, one line each; empty when all is well.

    Raises OutputError when `out` is no dataset at all.
    """
    try:
        manifest = json.loads((out / "dataset.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise OutputError(f"{out}: no readable dataset.json; give a dataset's folder") from None
    faults = [f"{p.name}: does not belong here" for p in out.iterdir() if p.name not in _TOP]
    if "counts" not in manifest:
        faults.append("dataset.json: the dataset is not finished; run generate again")
    for split in SPLITS:
        stems = {path.stem for path in (out / "scenes" / split).glob("*.json")}
        counted = manifest.get("counts", {}).get(split, {}).get("images", len(stems))
        if counted != len(stems):
            faults.append(f"scenes/{split}: {len(stems)} samples, dataset.json says {counted}")
        faults += _extra(out, split, stems)
        coco = _annotations(out, split, faults)
        for stem in sorted(stems):
            faults += _sample(out, split, stem, coco.get(stem, []))
    return faults


def _extra(out: Path, split: str, stems: set[str]) -> list[str]:
    faults = []
    for folder in ("images", "damage/masks", "damage/yolo", "imdg/labels"):
        found = {path.stem for path in (out / folder / split).iterdir()}
        faults += [f"{folder}/{split}/{name}: extra" for name in sorted(found - stems)]
        faults += [f"{folder}/{split}/{name}: missing" for name in sorted(stems - found)]
    return faults


def _annotations(out: Path, split: str, faults: list[str]) -> dict[str, list[dict[str, Any]]]:
    try:
        data = json.loads((out / f"damage/coco_{split}.json").read_text(encoding="utf-8"))
        stems = {image["id"]: Path(image["file_name"]).stem for image in data["images"]}
        found: dict[str, list[dict[str, Any]]] = {stem: [] for stem in stems.values()}
        for item in data["annotations"]:
            found[stems[item["image_id"]]].append(item)
    except (OSError, ValueError, KeyError) as error:
        faults.append(f"damage/coco_{split}.json: cannot be read ({error!r})")
        return {}
    return found


def _sample(out: Path, split: str, stem: str, annotations: list[dict[str, Any]]) -> list[str]:
    name = f"{split}/{stem}"
    try:
        record = json.loads((out / f"scenes/{name}.json").read_text(encoding="utf-8"))
        from_plain(Scene, record["scene"], "scene")
        width, height = record["size"]
    except (OSError, ValueError, KeyError, FastgenError) as error:
        return [f"scenes/{name}.json: cannot be read ({error})"]
    image = cv2.imread(str(out / f"images/{name}.jpg"))
    mask = cv2.imread(str(out / f"damage/masks/{name}.png"), cv2.IMREAD_UNCHANGED)
    faults = []
    if image is None or image.shape != (height, width, 3):
        faults.append(f"images/{name}.jpg: not a whole JPEG of {width}x{height}")
    if mask is None or mask.shape != (height, width) or mask.dtype != np.uint16:
        return [*faults, f"damage/masks/{name}.png: not a whole 16-bit PNG of {width}x{height}"]
    faults += [f"damage/coco_{split}.json: {stem}: {f}" for f in _against_mask(mask, annotations)]
    faults += [f"imdg/labels/{name}.txt: {f}" for f in _yolo(out / f"imdg/labels/{name}.txt", 28)]
    outlines = out / f"damage/yolo/{name}.txt"
    faults += [f"damage/yolo/{name}.txt: {f}" for f in _yolo(outlines, len(SEGMENTATION_CLASSES))]
    for crop in record["crops"]:
        if cv2.imread(str(out / "text" / split / crop["file"])) is None:
            faults.append(f"text/{split}/{crop['file']}: missing or broken")
    return faults


def _against_mask(mask: np.ndarray, annotations: list[dict[str, Any]]) -> list[str]:
    """Each category's area and box, seen again in the mask."""
    faults = []
    wanted: list[tuple[int, np.ndarray]] = [(1, mask > 0)] if mask.any() else []
    wanted += [(int(v) // 100, mask == v) for v in np.unique(mask[mask >= 200])]
    found = sorted((item["category_id"], item["area"], tuple(item["bbox"])) for item in annotations)
    seen = []
    for category, part in wanted:
        rows, columns = np.nonzero(part)
        x, y = int(columns.min()), int(rows.min())
        box = (x, y, int(columns.max()) + 1 - x, int(rows.max()) + 1 - y)
        seen.append((category, int(rows.size), box))
    if sorted(seen) != found:
        faults.append("category, area or box differs from the mask")
    return faults


def _yolo(path: Path, classes: int) -> list[str]:
    assert classes <= len(DETECTION_CLASSES)
    try:
        lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
        rows = [(int(index), [float(v) for v in values]) for index, *values in lines]
    except (OSError, ValueError):
        return ["cannot be read"]
    for index, values in rows:
        if not 0 <= index < classes or len(values) < 4:
            return [f"class {index} with {len(values)} numbers cannot be"]
        if min(values) < 0 or max(values) > 1:
            return ["a value lies outside 0..1"]
    return []
