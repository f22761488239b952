"""Door or no door: images of the two ends in folders named for their class, as an ImageFolder."""

from collections.abc import Sequence
from typing import Any

from fastgen.formats import Files, Format, Item, Same

DOOR_FOLDERS = {"Cr": "door", "Cl": "no_door"}
"""Folder that a camera's images go to."""


class _Door(Format):
    name = "door"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        folder = DOOR_FOLDERS.get(item.sample.camera.name)
        if folder is None:
            return {}, None
        return {f"door/{item.split}/{folder}/{item.stem}.jpg": Same(item.image_path)}, None

    def folders(self, split: str) -> Sequence[str]:
        return (f"door/{split}/door", f"door/{split}/no_door")


FORMAT = _Door()
