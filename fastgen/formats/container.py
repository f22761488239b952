"""COCO keypoints at the eight corner castings of each container, with its pose and the camera."""

from typing import Any

from fastgen.config.config import Config
from fastgen.formats import coco
from fastgen.formats.format import DatasetFiles, Files, Format, Records
from fastgen.formats.item import Item
from fastgen.formats.scene_file import view_values
from fastgen.labels.objects import CASTINGS

_EDGES = [[a + 1, b + 1] for a in range(8) for b in range(a + 1, 8) if (a ^ b) in (1, 2, 4)]

CATEGORIES = [{"id": 1, "name": "container", "keypoints": list(CASTINGS), "skeleton": _EDGES}]


class _Container(Format):
    name = "container"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        found = []
        for thing in item.containers:
            if thing.id not in item.container_annotations:
                continue
            seen = item.sample.container_at(thing.container)
            pose = view_values(seen.view)
            found.append(
                {
                    **item.container_annotations[thing.id],
                    "keypoints": [value for point in thing.keypoints for value in point],
                    "num_keypoints": sum(flag > 0 for *_, flag in thing.keypoints),
                    "kind": seen.container.kind,
                    "rotation": pose["rotation"],
                    "translation_mm": pose["translation_mm"],
                    "intrinsics": pose["intrinsics"],
                    "distortion_model": pose["distortion_model"],
                    "distortion": pose["distortion"],
                }
            )
        # without keypoints, a container is a region to ignore, even if other tasks label it
        none = {"iscrowd": 1, "keypoints": [0] * (3 * len(CASTINGS)), "num_keypoints": 0}
        found += [{**each, **none} for each in item.background_annotations]
        return {}, found

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        words = "Corner castings of synthetic shipping containers, and the containers' poses"
        text = coco.file_text(words, CATEGORIES, len(CATEGORIES), records, self.name)
        yield f"container/coco_{split}.json", text


FORMAT = _Container()
