"""Text recognition: image crops of legible texts, and a label file with lines `file<TAB>text`."""

from collections.abc import Iterable, Sequence
from typing import Any

from fastgen.config.config import Config
from fastgen.files.images import png
from fastgen.formats.format import DatasetFiles, Files, Format, Records
from fastgen.formats.item import Item
from fastgen.labels.crops import text_crops


class _Text(Format):
    name = "text"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        files: Files = {}
        found = []
        for thing, pixels in text_crops(item.sample, item.rules.min_text_px):
            name = f"{item.stem}_{thing.instance}.png"
            files[f"text/{item.split}/{name}"] = png(pixels)
            found.append({"file": name, "text": thing.text})
        return files, found

    def counts(self, facts: Iterable[Any]) -> dict[str, int]:
        return {"crops": sum(map(len, facts))}

    def folders(self, split: str) -> Sequence[str]:
        return (f"text/{split}",)

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        lines = (
            f"{crop['file']}\t{crop['text']}\n"
            for record in records()
            for crop in record["facts"][self.name]
        )
        yield f"text/{split}/labels.txt", lines


FORMAT = _Text()
