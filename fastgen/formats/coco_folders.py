"""COCO's own folders: `annotations/instances_SPLIT.json` beside `images/SPLIT` of each task.

Names of images in these files start at `images/SPLIT`, which is where readers of the layout look.
"""

from typing import Any

from fastgen.config.config import Config
from fastgen.formats import coco, container, damage, imdg
from fastgen.formats.format import DatasetFiles, Files, Format, Records
from fastgen.formats.item import Item

TASKS = {
    "imdg": (imdg.FORMAT.coco_task, "instances"),
    "damage": (damage.FORMAT.coco_task, "instances"),
    "container": (container.FORMAT.coco_task, "person_keypoints"),
}
"""Task of COCO and start of the file name by format."""


class _CocoFolders(Format):
    name = "coco"
    fits_archives = False
    builds_on = tuple(TASKS)

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        return {}, None

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        first = next(iter(records()), None)
        for name, (task_of, start) in TASKS.items():
            if first is None or name not in first["facts"]:
                continue
            text = coco.file_text(task_of(config), records, "")
            yield f"{name}/annotations/{start}_{split}.json", text


FORMAT = _CocoFolders()
