"""Is a dataset whole, and do its files agree with each other?"""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.errors import FastgenError, OutputError
from fastgen.records import from_plain
from fastgen.sampling import SPLITS
from fastgen.scene import Scene
from fastgen.writers import coco
from fastgen.writers.seafront import dataset_files, sample_files

Record = dict[str, Any]
"""What a scene file holds."""


def verify(out: Path) -> list[str]:
    """Every fault found, one line each; empty when all is well.

    Raises OutputError when `out` is no dataset at all.
    """
    try:
        manifest = json.loads((out / "dataset.json").read_text(encoding="utf-8"))
        least_px = manifest["config"]["labels"]["min_visible_px"]
    except (OSError, ValueError, KeyError, TypeError):
        raise OutputError(f"{out}: no readable dataset.json; give a dataset's folder") from None
    faults: list[str] = []
    if "counts" not in manifest:
        faults.append("dataset.json: the dataset is not finished; run generate again")
    wanted = {"dataset.json", "contact_sheet.png", *dataset_files()}
    present = {path.relative_to(out).as_posix() for path in out.rglob("*") if not path.is_dir()}
    records: dict[str, dict[str, Record]] = {}
    for split in SPLITS:
        stems = sorted(path.stem for path in (out / "scenes" / split).glob("*.json"))
        counted = manifest.get("counts", {}).get(split, {}).get("images", len(stems))
        if counted != len(stems):
            faults.append(f"scenes/{split}: {len(stems)} samples, dataset.json says {counted}")
        records[split] = {}
        for stem in stems:
            wanted.update(sample_files(split, stem))
            record = _record(out, split, stem, faults)
            if record is not None:
                records[split][stem] = record
                wanted.update(f"text/{split}/{crop['file']}" for crop in record["crops"])
    faults += [f"{name}: missing" for name in sorted(wanted - present)]
    faults += [f"{name}: does not belong here" for name in sorted(present - wanted)]
    for split in SPLITS:
        annotations = _annotations(out, split, records[split], faults)
        faults += _text_labels(out, split, records[split])
        for stem, record in records[split].items():
            if present.issuperset(sample_files(split, stem)):
                faults += _sample(out, split, stem, record, least_px)
                faults += _damage(out, split, stem, record, annotations)
    return faults


def _record(out: Path, split: str, stem: str, faults: list[str]) -> Record | None:
    """A scene file's content, or None and a fault when it is damaged."""
    name = f"scenes/{split}/{stem}.json"
    try:
        record: Record = json.loads((out / name).read_text(encoding="utf-8"))
        from_plain(Scene, record["scene"], "scene")
        width, height = record["size"]
        held = (record["stem"], record["split"], int(width) > 0, int(height) > 0)
        if held != (stem, split, True, True):
            raise ValueError(f"is of {held[1]}/{held[0]}, {width}x{height}")
        for item in record["objects"]:
            _ = item["class_name"], item["bbox"], item["area"]
        for crop in record["crops"]:
            _ = crop["file"], crop["text"]
    except (OSError, ValueError, KeyError, TypeError, FastgenError) as error:
        faults.append(f"{name}: cannot be read ({error!r})")
        return None
    return record


def _annotations(
    out: Path, split: str, records: dict[str, Record], faults: list[str]
) -> dict[str, list[dict[str, Any]]] | None:
    """COCO annotations by stem; None and a fault when they cannot be read."""
    name = f"damage/coco_{split}.json"
    try:
        data = json.loads((out / name).read_text(encoding="utf-8"))
        stems = {image["id"]: Path(image["file_name"]).stem for image in data["images"]}
        sizes = {stems[image["id"]]: [image["width"], image["height"]] for image in data["images"]}
        found: dict[str, list[dict[str, Any]]] = {stem: [] for stem in stems.values()}
        for item in data["annotations"]:
            _ = item["category_id"], item["area"], item["bbox"], item["segmentation"]["counts"]
            found[stems[item["image_id"]]].append(item)
    except FileNotFoundError:
        return None  # reported as missing
    except (OSError, ValueError, KeyError, TypeError) as error:
        faults.append(f"{name}: cannot be read ({error!r})")
        return None
    for stem, record in records.items():
        if sizes.get(stem) != record["size"]:
            faults.append(f"{name}: {stem}: size {sizes.get(stem)}, scene file {record['size']}")
    return found


def _text_labels(out: Path, split: str, records: dict[str, Record]) -> list[str]:
    name = f"text/{split}/labels.txt"
    crops = [crop for record in records.values() for crop in record["crops"]]
    faults = []
    for crop in crops:
        path = out / "text" / split / crop["file"]
        if path.is_file() and cv2.imread(str(path)) is None:
            faults.append(f"text/{split}/{crop['file']}: not a whole PNG")
    wanted = "".join(f"{crop['file']}\t{crop['text']}\n" for crop in crops)
    if (out / name).is_file() and (out / name).read_bytes() != wanted.encode():
        faults.append(f"{name}: differs from the crops that the scene files list")
    return faults


def _sample(out: Path, split: str, stem: str, record: Record, least_px: int) -> list[str]:
    """Image, its second names and the marker labels of one sample."""
    width, height = record["size"]
    image_name = f"images/{split}/{stem}.jpg"
    data = (out / image_name).read_bytes()
    faults = []
    try:
        # strict: a file cut short is otherwise filled up with grey
        whole = simplejpeg.decode_jpeg(data, strict=True).shape == (height, width, 3)
    except ValueError:
        whole = False
    if not whole:
        faults.append(f"{image_name}: not a whole JPEG of {width}x{height}")
    for other in sample_files(split, stem):
        if other.endswith(".jpg") and (out / other).read_bytes() != data:
            faults.append(f"{other}: differs from {image_name}")
    boxes = f"imdg/labels/{split}/{stem}.txt"
    return [*faults, *(f"{boxes}: {fault}" for fault in _boxes(out / boxes, record, least_px))]


def _damage(
    out: Path,
    split: str,
    stem: str,
    record: Record,
    annotations: dict[str, list[dict[str, Any]]] | None,
) -> list[str]:
    """Mask, outlines and COCO annotations of one sample."""
    outlines, mask_name = f"damage/yolo/{split}/{stem}.txt", f"damage/masks/{split}/{stem}.png"
    faults = [f"{outlines}: {fault}" for fault in _outlines(out / outlines)]
    width, height = record["size"]
    mask = cv2.imread(str(out / mask_name), cv2.IMREAD_UNCHANGED)
    if mask is None or mask.shape != (height, width) or mask.dtype != np.uint16:
        faults.append(f"{mask_name}: not a whole 16-bit PNG of {width}x{height}")
    elif annotations is not None and not _equals_mask(mask, annotations.get(stem, [])):
        faults.append(f"damage/coco_{split}.json: {stem}: differs from {mask_name}")
    return faults


def _equals_mask(mask: NDArray[Any], annotations: list[dict[str, Any]]) -> bool:
    """Category, area, box and run lengths of every annotation, derived again from the mask."""
    parts = [(1, mask > 0)] if mask.any() else []
    parts += [(int(v) // 100, mask == v) for v in np.unique(mask[mask >= 200])]
    seen = []
    for category, part in parts:
        rows, columns = np.nonzero(part)
        x, y = int(columns.min()), int(rows.min())
        box = [x, y, int(columns.max()) + 1 - x, int(rows.max()) + 1 - y]
        seen.append((category, int(rows.size), box, coco.rle(part)["counts"]))
    held = [
        (item["category_id"], item["area"], item["bbox"], item["segmentation"]["counts"])
        for item in annotations
    ]
    return sorted(seen, key=repr) == sorted(held, key=repr)


def _rows(path: Path) -> list[tuple[int, list[float]]] | None:
    """Lines of a YOLO file as class and numbers; None when it is something else."""
    try:
        lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
        return [(int(index), [float(v) for v in values]) for index, *values in lines]
    except ValueError:
        return None


def _boxes(path: Path, record: Record, least_px: int) -> list[str]:
    """The marker labels are the visible boxes of the scene file's objects, to 0.1 pixel."""
    rows = _rows(path)
    if rows is None or any(len(v) != 4 or not 0 <= i < len(DETECTION_CLASSES) for i, v in rows):
        return ["cannot be read"]
    width, height = record["size"]
    held = []
    for index, (x, y, w, h) in rows:
        edges = ((x - w / 2) * width, (y - h / 2) * height, (x + w / 2) * width)
        held.append((index, [round(v, 1) for v in (*edges, (y + h / 2) * height)]))
    wanted = [
        (DETECTION_CLASSES.index(item["class_name"]), item["bbox"])
        for item in record["objects"]
        if item["class_name"] in DETECTION_CLASSES and item["bbox"] and not item["ignored"]
    ]
    return [] if sorted(held) == sorted(wanted) else ["differs from the scene file's objects"]


def _outlines(path: Path) -> list[str]:
    rows = _rows(path)
    if rows is None:
        return ["cannot be read"]
    faults = []
    for index, values in rows:
        if not 0 <= index < len(SEGMENTATION_CLASSES) or len(values) < 6 or len(values) % 2:
            faults.append(f"class {index} with {len(values)} numbers cannot be")
        elif not (min(values) >= 0 and max(values) <= 1):
            faults.append("a value lies outside 0..1")
    return faults
