"""The `seafront` layout: one folder a task of the paper, each in the form its trainers read."""

import json
import os
from functools import lru_cache
from pathlib import Path
from typing import Any

from fastgen.classes import DETECTION_CLASSES
from fastgen.config import LabelConfig
from fastgen.crops import text_crops
from fastgen.records import to_plain
from fastgen.sample import Sample
from fastgen.sampling import SPLITS
from fastgen.scene import Scene
from fastgen.writers import coco, encode, yolo

DOOR_FOLDERS = {"Cr": "door", "Cl": "no_door"}
"""Folder of the door task that a camera's images go to."""


def sample_files(split: str, stem: str) -> list[str]:
    """Files of one sample relative to OUT, except its text crops, which its scene file names."""
    found = [
        f"images/{split}/{stem}.jpg",
        # trainers resolve this folder and look for labels where `images` reads `labels`: a link
        # in place of the folder would lead them out of imdg
        f"imdg/images/{split}/{stem}.jpg",
        f"imdg/labels/{split}/{stem}.txt",
        f"damage/masks/{split}/{stem}.png",
        f"damage/yolo/{split}/{stem}.txt",
        f"scenes/{split}/{stem}.json",
    ]
    if folder := DOOR_FOLDERS.get(stem.split("_", 1)[1]):
        found.append(f"door/{split}/{folder}/{stem}.jpg")
    return found


def dataset_files() -> list[str]:
    """Files relative to OUT that `finish` writes, over all samples."""
    per_split = [(f"damage/coco_{split}.json", f"text/{split}/labels.txt") for split in SPLITS]
    return ["imdg/data.yaml", *(name for names in per_split for name in names)]


class SeafrontWriter:
    """Writes OUT as docs/output.md lays it out. A sample's scene file comes last: it says the rest
    is whole.

    out: the dataset's folder. labels: which labels are written. version: of fastgen, for COCO info.
    """

    def __init__(self, out: Path, labels: LabelConfig, version: str) -> None:
        self._out = out
        self._labels = labels
        self._version = version
        for split in SPLITS:
            for folder in (
                f"images/{split}",
                f"damage/masks/{split}",
                f"damage/yolo/{split}",
                f"imdg/images/{split}",
                f"imdg/labels/{split}",
                f"text/{split}",
                f"door/{split}/door",
                f"door/{split}/no_door",
                f"scenes/{split}",
            ):
                (out / folder).mkdir(parents=True, exist_ok=True)

    def has(self, split: str, stem: str) -> bool:
        """Whether a sample was written whole before, and none of its files has gone since."""
        if not all((self._out / name).is_file() for name in sample_files(split, stem)):
            return False
        try:
            text = (self._out / "scenes" / split / f"{stem}.json").read_text(encoding="utf-8")
            crops = [crop["file"] for crop in json.loads(text)["crops"]]
        except (ValueError, KeyError, TypeError):
            return False
        return all((self._out / "text" / split / name).is_file() for name in crops)

    def add(self, sample: Sample, split: str, stem: str) -> None:
        """Write all files of one sample, its scene file last."""
        out, size = self._out, sample.view.size
        image = out / "images" / split / f"{stem}.jpg"
        encode.write(image, encode.jpeg(sample.image))
        encode.link(image, out / "imdg/images" / split / f"{stem}.jpg")
        encode.write(out / "damage/masks" / split / f"{stem}.png", encode.png(sample.damage))
        encode.write(out / "damage/yolo" / split / f"{stem}.txt", yolo.segmentation_lines(sample))
        detections = yolo.detection_lines(sample.objects, size)
        encode.write(out / "imdg/labels" / split / f"{stem}.txt", detections)
        if folder := DOOR_FOLDERS.get(sample.camera.name):
            encode.link(image, out / "door" / split / folder / f"{stem}.jpg")
        record = {
            "stem": stem,
            "split": split,
            "camera": sample.camera.name,
            "size": list(size),
            "objects": [vars(item) for item in sample.objects],
            "annotations": coco.annotations(sample),
            "crops": self._crops(sample, split, stem),
        }
        path = out / "scenes" / split / f"{stem}.json"
        text = json.dumps(record, separators=(",", ":"))
        encode.write(path, f'{text[:-1]},"scene":{_scene_json(sample.scene)}}}')

    def finish(self) -> dict[str, dict[str, int]]:
        """Write the COCO files, text labels and data.yaml. Returns image and object counts."""
        counts = {}
        for split in SPLITS:
            records = [
                json.loads(path.read_text(encoding="utf-8"))
                for path in sorted((self._out / "scenes" / split).glob("*.json"))
            ]
            self._write_coco(split, records)
            crops = [crop for record in records for crop in record["crops"]]
            lines = "".join(f"{crop['file']}\t{crop['text']}\n" for crop in crops)
            encode.write(self._out / "text" / split / "labels.txt", lines)
            counts[split] = {
                "images": len(records),
                "objects": sum(len(record["objects"]) for record in records),
                "damages": sum(
                    item["category_id"] > 1 for record in records for item in record["annotations"]
                ),
                "crops": len(crops),
            }
        names = "".join(f"  {i}: {name}\n" for i, name in enumerate(DETECTION_CLASSES))
        # no `path`: trainers take it relative to this file
        head = "".join(f"{split}: images/{split}\n" for split in SPLITS)
        encode.write(self._out / "imdg" / "data.yaml", f"{head}nc: 28\nnames:\n{names}")
        return counts

    def _write_coco(self, split: str, records: list[dict[str, Any]]) -> None:
        images: list[dict[str, Any]] = []
        found: list[dict[str, Any]] = []
        for number, record in enumerate(records, start=1):
            width, height = record["size"]
            images.append(
                {
                    "id": number,
                    "file_name": f"images/{split}/{record['stem']}.jpg",
                    "width": width,
                    "height": height,
                    "license": 1,
                }
            )
            for item in record["annotations"]:
                found.append({"id": len(found) + 1, "image_id": number, **item})
        dataset = {
            "info": {
                "description": "Synthetic shipping containers with damage masks",
                "version": self._version,
                "contributor": "fastgen",
                "year": 2026,
                "url": "",
                "date_created": "",
            },
            "licenses": [
                {
                    "id": 1,
                    "name": "CC0 1.0",
                    "url": "https://creativecommons.org/publicdomain/zero/1.0/",
                }
            ],
            "categories": coco.categories(),
            "images": images,
            "annotations": found,
        }
        text = json.dumps(dataset, separators=(",", ":"))
        encode.write(self._out / "damage" / f"coco_{split}.json", text)

    def _crops(self, sample: Sample, split: str, stem: str) -> list[dict[str, str]]:
        made = []
        for item, pixels in text_crops(sample, self._labels.min_text_px):
            name = f"{stem}_{item.instance}.png"
            encode.write(self._out / "text" / split / name, encode.png(pixels))
            made.append({"file": name, "text": item.text})
        return made


@lru_cache(maxsize=2)
def _scene_json(scene: Scene) -> str:
    """The scene as JSON text; all cameras of a scene share it."""
    return json.dumps(to_plain(scene), separators=(",", ":"))


def remove_partial(out: Path) -> None:
    """Clear away what an interrupted run left aside."""
    for folder, _, files in os.walk(out):
        for name in files:
            if name.startswith(".") and name.endswith(".part"):
                Path(folder, name).unlink(missing_ok=True)
