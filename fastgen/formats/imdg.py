"""Labels of the marker task: a folder for YOLO, and COCO with masks, texts and crowds."""

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from fastgen.classes import ALL_DETECTION_CLASSES, is_detection, with_marks
from fastgen.config.config import Config
from fastgen.formats import coco, yolo
from fastgen.formats.format import DatasetFiles, Files, Format, Label, Read, Record, Records
from fastgen.formats.item import Item
from fastgen.labels.visibility import window
from fastgen.overlay import Outline


class _Imdg(Format):
    name = "imdg"
    classes: tuple[str, ...] = ALL_DETECTION_CLASSES

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        sample = item.sample
        lines = yolo.detection_lines(sample.objects, sample.view.size, sample.marker_classes)
        found: list[dict[str, Any]] = []
        for thing, box in item.detections:
            if thing.background:
                continue
            if thing.id in item.container_annotations:
                found.append(item.container_annotations[thing.id])
                continue
            part = window(sample.ids, box) == thing.id
            category = sample.marker_classes.index(thing.class_name) + 1
            more = {"text": thing.text} if thing.text else {}
            found.append({**item.annotation(category, box, part, thing.ignored), **more})
        return yolo.files("imdg", item, lines), found + item.background_annotations

    def with_classes(self, classes: Sequence[str]) -> Format:
        made = _Imdg()
        made.classes = with_marks(classes)
        return made

    def labels(self, facts: Any) -> Iterable[Label]:
        return coco.labels(facts, self.classes)

    def counts(self, facts: Iterable[Any]) -> dict[str, int]:
        return {"objects": sum(len(coco.trained_on(each)) for each in facts)}

    def folders(self, split: str) -> Sequence[str]:
        return (f"imdg/images/{split}", f"imdg/labels/{split}")

    def coco_task(self, config: Config) -> coco.Task:
        return coco.Task(
            self.name,
            "Synthetic shipping containers with dangerous-goods markers and identifiers",
            [{"id": i + 1, "name": name} for i, name in enumerate(self.classes)],
            len(config.markings.detection_classes),
            (("text", ""),),
        )

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        yield self.coco_task(config).split_file(split, records)

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        return yolo.task_files("imdg", config.markings.detection_classes, splits)

    def outlines(self, size: tuple[int, int], read: Read, name: str) -> list[Outline]:
        return [
            Outline.of_box(yolo.pixel_box(values, size), self.classes[index])
            for index, values in yolo.finite_rows(read(f"imdg/labels/{name}.txt"))
        ]

    def check(self, record: Record, read: Read) -> Iterator[str]:
        name = f"{record['split']}/{record['stem']}"
        path = f"imdg/labels/{name}.txt"
        scene = json.loads(read(f"scenes/{name}.json"))
        width, height = scene["size"]
        listed = [  # to 0.1 pixel, because the file has six digits
            (index, [round(v, 1) for v in yolo.pixel_box(values, (width, height))])
            for index, values in yolo.rows(read(path).decode())
        ]
        numbers = {name: number for number, name in enumerate(self.classes)}
        visible = [
            (numbers.get(item["class_name"]), item["bbox"])
            for item in scene["objects"]
            if is_detection(item["class_name"]) and item["bbox"] and not item["ignored"]
        ]
        if sorted(listed, key=repr) != sorted(visible, key=repr):
            yield f"{path}: differs from the scene file's objects"


FORMAT = _Imdg()
