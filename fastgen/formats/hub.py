"""Dataset card and image metadata, from which Hugging Face's `datasets` loads a folder."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

from fastgen.config.config import Config
from fastgen.formats import coco
from fastgen.formats.card import card
from fastgen.formats.coco_folders import TASKS
from fastgen.formats.format import DatasetFiles, Files, Format, Records
from fastgen.formats.item import Item


class _Hub(Format):
    name = "hub"
    fits_archives = False

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        return {}, None

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        if next(iter(records()), None) is not None:
            yield f"images/{split}/metadata.jsonl", _lines(records, config)

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        yield "README.md", card("images/SPLIT/**", splits)


def _lines(records: Records, config: Config) -> Iterator[str]:
    tasks = {name: task_of(config) for name, (task_of, _) in TASKS.items()}
    for record in records():
        row: dict[str, Any] = {"file_name": f"{record['stem']}.jpg"}
        for name, task in tasks.items():
            if name in record["facts"]:
                row[name] = coco.columns(record["facts"][name], task)
        yield json.dumps(row) + "\n"


FORMAT = _Hub()
