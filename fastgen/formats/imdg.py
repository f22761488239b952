"""Marker detection: YOLO with its data.yaml, and COCO with what YOLO cannot say."""

from collections.abc import Sequence
from typing import Any

from fastgen.classes import CONTAINER_ID, DETECTION_CLASSES
from fastgen.formats import DatasetFiles, Files, Format, Item, Records, Same, coco
from fastgen.formats.yolo import detection_lines
from fastgen.labels.visibility import window
from fastgen.sampling.scene import SPLITS

CATEGORIES = [{"id": i + 1, "name": name} for i, name in enumerate(DETECTION_CLASSES)]


class _Imdg(Format):
    name = "imdg"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        sample, split, stem = item.sample, item.split, item.stem
        labels = detection_lines(sample.objects, sample.view.size)
        files: Files = {
            # trainers resolve this folder and look for labels where `images` reads `labels`: a link
            # in place of the folder would lead them out of imdg
            f"imdg/images/{split}/{stem}.jpg": Same(item.image_path),
            f"imdg/labels/{split}/{stem}.txt": labels.encode(),
        }
        found: list[dict[str, Any] | None] = []
        for thing, box in item.detections:
            if thing.id == CONTAINER_ID:
                found.append(item.container_annotation)
                continue
            part = window(sample.ids, box) == thing.id
            category = DETECTION_CLASSES.index(thing.class_name) + 1
            more = {"text": thing.text} if thing.text else {}
            found.append(
                {
                    **coco.annotation(category, box, part, sample.view.size, thing.ignored),
                    **more,
                }
            )
        return files, found

    def folders(self, split: str) -> Sequence[str]:
        return (f"imdg/images/{split}", f"imdg/labels/{split}")

    def dataset_files(self, split: str, records: Records) -> DatasetFiles:
        words = "Synthetic shipping containers with dangerous-goods markers and identifiers"
        yield f"imdg/coco_{split}.json", coco.file_text(words, CATEGORIES, records, self.name)
        if split == SPLITS[0]:
            names = "".join(f"  {i}: {name}\n" for i, name in enumerate(DETECTION_CLASSES))
            # no `path`: trainers take it relative to this file
            head = "".join(f"{each}: images/{each}\n" for each in SPLITS)
            yield "imdg/data.yaml", f"{head}nc: {len(DETECTION_CLASSES)}\nnames:\n{names}".encode()


FORMAT = _Imdg()
