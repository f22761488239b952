"""Id map as 16-bit PNG: 0 background, 1 container, else the id of an Object in the scene file."""

from typing import Any

from fastgen.files.images import png
from fastgen.formats.format import Files, Format
from fastgen.formats.item import Item


class _Ids(Format):
    name = "ids"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        return {f"ids/{item.split}/{item.stem}.png": png(item.sample.ids)}, None


FORMAT = _Ids()
