"""Labels of containers: keypoints at the eight corner castings, in COCO and in a folder for YOLO.

COCO files also have the containers' poses and the camera.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fastgen.config.config import Config
from fastgen.formats import coco, yolo
from fastgen.formats.format import DatasetFiles, Files, Format, Records
from fastgen.formats.item import Item
from fastgen.formats.scene_file import view_values
from fastgen.labels.objects import CASTINGS

_EDGES = [[a + 1, b + 1] for a in range(8) for b in range(a + 1, 8) if (a ^ b) in (1, 2, 4)]

_MIRRORED = [number ^ 2 for number in range(len(CASTINGS))]
"""Casting that each casting becomes in a mirrored image: `front` and `back` change places."""

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
        lines = [_pose_line(each, item.sample.view.size) for each in found if not each["iscrowd"]]
        return yolo.files(self.name, item, "".join(lines)), found

    def folders(self, split: str) -> Sequence[str]:
        return (f"container/images/{split}", f"container/labels/{split}")

    def coco_task(self, config: Config) -> coco.Task:
        words = "Corner castings of synthetic shipping containers, and the containers' poses"
        return coco.Task(self.name, words, CATEGORIES, len(CATEGORIES), (("keypoints", ()),))

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        yield self.coco_task(config).split_file(split, records)

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        more = f"kpt_shape: [{len(CASTINGS)}, 3]\nflip_idx: {_MIRRORED}\n"
        return yolo.task_files(self.name, ("container",), splits, more)


def _pose_line(annotation: dict[str, Any], size: tuple[int, int]) -> str:
    """Return the YOLO label of a container: its visible box, then x, y and flag of each casting."""
    x, y, width, height = annotation["bbox"]
    box = yolo.line(0, yolo.normalised((x, y, x + width, y + height), size)).rstrip()
    points = np.reshape(annotation["keypoints"], (-1, 3)).tolist()
    shares = [f" {u / size[0]:.6f} {v / size[1]:.6f} {flag:.0f}" for u, v, flag in points]
    return f"{box}{''.join(shares)}\n"


FORMAT = _Container()
