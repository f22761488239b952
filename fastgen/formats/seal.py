"""Seal classification: a crop of each hasp in a folder per class, as ImageFolder reads them.

Archives have one file per image instead, with lines `QUAD<TAB>class`: four corners x0 y0 ... in
pixels.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from fastgen.files.images import png
from fastgen.formats.format import Files, Format, crop_lines
from fastgen.formats.item import Item
from fastgen.labels.hasp_crops import hasp_crops

SEAL_CLASSES = ("open", "sealed")
"""Classes and folders of the task, in the order in which ImageFolder numbers them."""


class _Seal(Format):
    name = "seal"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        files: Files = {}
        found = []
        for crop in hasp_crops(item.sample):
            folder = SEAL_CLASSES[crop.sealed]
            files[f"seal/{item.split}/{folder}/{item.stem}_{crop.hasp}.png"] = png(crop.pixels)
            found.append({"class": folder, "quad": crop.quad.round(2).ravel().tolist()})
        return files, found

    def members(self, item: Item, files: Files, facts: Any) -> Files:
        return crop_lines(self.name, item, [(each["quad"], each["class"]) for each in facts])

    def counts(self, facts: Iterable[Any]) -> dict[str, int]:
        crops = [crop["class"] for each in facts for crop in each]
        return {f"hasps_{folder}": crops.count(folder) for folder in SEAL_CLASSES}

    def folders(self, split: str) -> Sequence[str]:
        return tuple(f"seal/{split}/{folder}" for folder in SEAL_CLASSES)


FORMAT = _Seal()
