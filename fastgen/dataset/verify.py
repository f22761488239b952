"""`fastgen verify`: every file of a dataset present, unchanged, and consistent with its labels."""

import json
import re
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fastgen.classes import DAMAGE_VALUES, DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.dataset.dataset_json import MANIFEST, without_manifest
from fastgen.dataset.seal import digest, is_sealed
from fastgen.dataset.shards import manifest_path
from fastgen.dataset.storage import Folder, Remote, storage_of
from fastgen.errors import FastgenError, OutputError
from fastgen.formats import Record, coco
from fastgen.formats.yolo import pixel_box, rows
from fastgen.sampling.scene import SPLITS
from fastgen.scene import Scene
from fastgen.validation import from_plain

Place = Folder | Remote


@dataclass(frozen=True)
class Findings:
    """faults: a line each that names a file. broken: paths of files that are not as they were
    written, or missing. manifest: what dataset.json says, {} where it cannot be trusted; without a
    "digest" where the dataset is not finished."""

    faults: list[str]
    broken: set[str] = field(default_factory=set)
    manifest: dict[str, Any] = field(default_factory=dict)


def examine(out: str) -> Findings:
    """What is wrong with the dataset at `out`, and what a repair of it needs to know.

    Raises OutputError when `out` is no dataset.
    """
    storage = storage_of(out)
    try:
        text = storage.read(MANIFEST)
        manifest = json.loads(text)
        manifest["config"], manifest["shard_scenes"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise without_manifest(storage, out) from None
    if "digest" not in manifest:
        unfinished = f"{MANIFEST}: the dataset is not finished; run generate again"
        return Findings([unfinished], manifest=manifest)
    if not is_sealed(text):
        again = "run generate again with the same settings"
        return Findings([f"{MANIFEST}: was changed after it was written; {again}"])
    faults = [
        f"scene {each['scene']} is missing: it failed ({each['error']})"
        for each in manifest["failed"]
    ]
    present = dict(storage.sizes())
    present.pop(MANIFEST, None)
    shards = []
    untold: set[int] = set()  # shards whose files nothing lists
    for number, hashed in manifest["shards"].items():
        data = _intact(storage, present, manifest_path(int(number)), None, hashed, faults)
        if data is None:
            untold.add(int(number))
        else:
            shards.append(json.loads(data))
    broken = {manifest_path(number) for number in untold}
    listed = [manifest["files"], *(shard["files"] for shard in shards)]
    for path, (size, hashed) in (entry for files in listed for entry in files.items()):
        if _intact(storage, present, path, size, hashed, faults) is None:
            broken.add(path)
    astray = (path for path in sorted(present) if _shard_by_name(path, manifest) not in untold)
    faults += [f"{path}: does not belong here" for path in astray]
    if manifest["format"] == "seafront":
        records = [record for shard in shards for record in shard["records"]]
        faults += _samples(storage, records, broken)
        if not untold:
            faults += _lists(storage, records, broken)
    return Findings(faults, broken, manifest)


def _intact(
    storage: Place,
    present: dict[str, int],
    path: str,
    size: int | None,
    hashed: str,
    faults: list[str],
) -> bytes | None:
    """A file's content where it is as it was written, else None and a fault. Ticks it off."""
    if path not in present:
        faults.append(f"{path}: missing")
        return None
    found = present.pop(path)
    if size is not None and found != size:
        faults.append(f"{path}: changed ({found} bytes, {size} were written)")
        return None
    try:
        data = storage.read(path)
    except OutputError as error:  # one that cannot be read must not hide other faults
        faults.append(str(error))
        return None
    except FileNotFoundError:  # a link to nowhere
        faults.append(f"{path}: missing")
        return None
    if digest(data) != hashed:
        faults.append(f"{path}: changed")
        return None
    return data


def _shard_by_name(path: str, manifest: dict[str, Any]) -> int | None:
    """Which shard a sample's file is of, None where its name tells of none."""
    scenes: int = manifest["shard_scenes"]
    cameras = manifest["cameras"]
    if manifest["format"] == "webdataset":
        pattern, numbered = rf"(?:{'|'.join(SPLITS)})-(\d{{6,}})\.tar", 1
    elif path.startswith("bop/"):
        pattern, numbered = r"bop/.*/(\d{6,})(?:_\d+)?\.\w+", scenes * len(cameras)
    else:
        names = "|".join(map(re.escape, cameras))
        pattern, numbered = rf".*/(\d{{6,}})_(?:{names})(?:_\d+)?\.\w+", scenes
    found = re.fullmatch(pattern, path)
    return None if found is None else int(found[1]) // numbered


def _samples(storage: Place, records: list[Record], broken: set[str]) -> list[str]:
    """Whether a sample's labels agree with one another, among files that are as they were
    written."""
    faults = []
    for record in records:
        split, stem = record["split"], record["stem"]
        names = {
            "image": f"images/{split}/{stem}.jpg",
            "scene": f"scenes/{split}/{stem}.json",
            "mask": f"damage/masks/{split}/{stem}.png",
            "outlines": f"damage/yolo/{split}/{stem}.txt",
            "boxes": f"imdg/labels/{split}/{stem}.txt",
        }
        if broken.isdisjoint(names.values()):
            data = {key: storage.read(path) for key, path in names.items()}
            faults += [f"{names[key]}: {fault}" for key, fault in _sample(data, record)]
    return faults


def _lists(storage: Place, records: list[Record], broken: set[str]) -> list[str]:
    """Whether the COCO files say what the records of all shards say."""
    faults = []
    for split in SPLITS:
        name = f"damage/coco_{split}.json"
        wanted = [
            item for record in records if record["split"] == split
            for item in record["facts"]["damage"]
        ]  # fmt: skip
        if name not in broken and not _annotates(storage.read(name), wanted):
            faults.append(f"{name}: differs from the shards' records")
    return faults


def _annotates(text: bytes, wanted: list[dict[str, Any]]) -> bool:
    found = json.loads(text)["annotations"]
    return [{k: v for k, v in item.items() if k not in ("id", "image_id")} for item in found] == (
        wanted
    )


def _sample(data: dict[str, bytes], record: Record) -> list[tuple[str, str]]:
    """Which of one sample's files says what it should not, and how."""
    width, height = record["size"]
    faults = []
    try:
        # strict: a file cut short is otherwise filled up with grey
        whole = simplejpeg.decode_jpeg(data["image"], strict=True).shape == (height, width, 3)
    except ValueError:
        whole = False
    if not whole:
        faults.append(("image", f"not a whole JPEG of {width}x{height}"))
    scene = json.loads(data["scene"])
    try:
        from_plain(Scene, scene["scene"], "scene")
    except FastgenError as error:
        faults.append(("scene", str(error)))
    if not _same_boxes(rows(data["boxes"].decode()), scene):
        faults.append(("boxes", "differs from the scene file's objects"))
    faults += [("outlines", fault) for fault in _outline_faults(rows(data["outlines"].decode()))]
    mask = cv2.imdecode(np.frombuffer(data["mask"], np.uint8), cv2.IMREAD_UNCHANGED)
    if mask is None or mask.shape != (height, width) or mask.dtype != np.uint16:
        faults.append(("mask", f"not a whole 16-bit PNG of {width}x{height}"))
    elif not _same_masks(mask, record["facts"]["damage"]):
        faults.append(("mask", "differs from the COCO annotations"))
    return faults


def _same_masks(mask: NDArray[Any], annotations: list[dict[str, Any]]) -> bool:
    """Category, area, box and run lengths of every annotation, derived again from the mask."""
    parts = [(1, mask > 0)] if mask.any() else []
    parts += [(int(v) // 100, mask == v) for v in np.unique(mask[mask >= DAMAGE_VALUES.start])]
    seen = []
    for category, part in parts:
        rows, columns = np.nonzero(part)
        x, y = int(columns.min()), int(rows.min())
        box = [x, y, int(columns.max()) + 1 - x, int(rows.max()) + 1 - y]
        runs = coco.rle(part, (0, 0), (mask.shape[1], mask.shape[0]))["counts"]
        seen.append((category, int(rows.size), box, runs))
    held = [
        (item["category_id"], item["area"], item["bbox"], item["segmentation"]["counts"])
        for item in annotations
    ]
    return sorted(seen, key=repr) == sorted(held, key=repr)


def _same_boxes(found: list[tuple[int, list[float]]], scene: dict[str, Any]) -> bool:
    """The marker labels are the visible boxes of the scene file's objects, to 0.1 pixel."""
    held = [
        (index, [round(v, 1) for v in pixel_box(values, scene["size"])]) for index, values in found
    ]
    wanted = [
        (DETECTION_CLASSES.index(item["class_name"]), item["bbox"])
        for item in scene["objects"]
        if item["class_name"] in DETECTION_CLASSES and item["bbox"] and not item["ignored"]
    ]
    return sorted(held) == sorted(wanted)


def _outline_faults(found: list[tuple[int, list[float]]]) -> list[str]:
    faults = []
    for index, values in found:
        if not 0 <= index < len(SEGMENTATION_CLASSES) or len(values) < 6 or len(values) % 2:
            faults.append(f"class {index} with {len(values)} numbers cannot be")
        elif not (min(values) >= 0 and max(values) <= 1):
            faults.append("a value lies outside 0..1")
    return faults
