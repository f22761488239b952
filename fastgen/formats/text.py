"""Text recognition: image crops of legible texts, and a label file with lines `file<TAB>text`.

Archives have no crops but one file per image with lines `x0 y0 x1 y1<TAB>text`: the box of each
crop in pixels.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from fastgen.config.config import Config
from fastgen.files.images import png
from fastgen.formats.format import DatasetFiles, Files, Format, Records, crop_lines
from fastgen.formats.item import Item
from fastgen.labels.crops import crop_box, text_crops


class _Text(Format):
    name = "text"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        files: Files = {}
        found = []
        for thing, pixels in text_crops(item.sample, item.rules.min_text_px):
            assert thing.bbox is not None
            name = f"{item.stem}_{thing.instance}.png"
            files[f"text/{item.split}/{name}"] = png(pixels)
            box = [*crop_box(thing.bbox, item.sample.view.size)]
            found.append({"file": name, "text": thing.text, "box": box})
        return files, found

    def members(self, item: Item, files: Files, facts: Any) -> Files:
        return crop_lines(self.name, item, [(each["box"], each["text"]) for each in facts])

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
