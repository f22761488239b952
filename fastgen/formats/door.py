"""Door or no door: images of the two ends in folders named for their class, as an ImageFolder."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fastgen.formats import Files, Format, Item, Same
from fastgen.scene import Camera

DOOR_CLASSES = ("door", "no_door")
"""Folders of the task, named as the faces that their cameras look at."""

_MOST_SLANT = 0.7
"""Cosine to the container's length from which a camera counts as looking at an end."""


def door_class(camera: Camera) -> str | None:
    """Which end of the container a camera looks at, whatever its name; None for other views."""
    toward = np.subtract(camera.target_mm, camera.position_mm)
    along = toward[0] / max(float(np.linalg.norm(toward)), 1e-9)
    if abs(along) < _MOST_SLANT:
        return None
    return DOOR_CLASSES[int(along > 0)]


class _Door(Format):
    name = "door"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        folder = door_class(item.sample.camera)
        if folder is None:
            return {}, None
        return {f"door/{item.split}/{folder}/{item.stem}.jpg": Same(item.image_path)}, None

    def folders(self, split: str) -> Sequence[str]:
        return (f"door/{split}/door", f"door/{split}/no_door")


FORMAT = _Door()
