"""Parts of identifiers: an upright crop of each part, and lines `file<TAB>role<TAB>text`.

Archives have one file per image instead, with lines `QUAD<TAB>role<TAB>text`: four corners x0 y0
and so on in pixels.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from fastgen.config.config import Config
from fastgen.files.images import png
from fastgen.formats.format import DatasetFiles, Files, Format, Records, crop_lines
from fastgen.formats.item import Item
from fastgen.labels.crops import part_crop, text_crops


class _TextParts(Format):
    name = "text_parts"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        files: Files = {}
        found = []
        for thing, _ in text_crops(item.sample, item.rules.min_text_px):
            for part in thing.parts:
                name = f"{item.stem}_{thing.instance}_{part.role}.png"
                crop = part_crop(item.sample.image, part)
                files[f"text_parts/{item.split}/{name}"] = png(crop)
                found.append(
                    {"file": name, "role": part.role, "text": part.text, "quad": [*part.quad]}
                )
        return files, found

    def members(self, item: Item, files: Files, facts: Any) -> Files:
        found = [(each["quad"], f"{each['role']}\t{each['text']}") for each in facts]
        return crop_lines(self.name, item, found)

    def counts(self, facts: Iterable[Any]) -> dict[str, int]:
        return {"part_crops": sum(map(len, facts))}

    def folders(self, split: str) -> Sequence[str]:
        return (f"text_parts/{split}",)

    def dataset_files(self, split: str, records: Records, config: Config) -> DatasetFiles:
        lines = (
            f"{crop['file']}\t{crop['role']}\t{crop['text']}\n"
            for record in records()
            for crop in record["facts"][self.name]
        )
        yield f"text_parts/{split}/labels.txt", lines


FORMAT = _TextParts()
