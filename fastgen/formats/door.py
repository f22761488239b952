"""Door or no door: images of the two ends in folders named for their class, as an ImageFolder."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fastgen.config.cameras import CameraConfig
from fastgen.errors import ConfigError
from fastgen.formats.format import Files, Format, Same
from fastgen.formats.item import Item
from fastgen.scene import Camera

DOOR_CLASSES = ("door", "no_door")
"""Folders of the task, named as the faces that their cameras look at."""

_LEAST_COSINE = 0.7
"""Cosine to the container's length from which a camera counts as looking at an end."""


def door_class(camera: Camera) -> str | None:
    """Which end of the container a camera looks at, whatever its name; None for other views."""
    toward = np.subtract(camera.target_mm, camera.position_mm)
    along = toward[0] / max(float(np.linalg.norm(toward)), 1e-9)
    if abs(along) < _LEAST_COSINE:
        return None
    return DOOR_CLASSES[int(along > 0)]


def door_number(camera: Camera) -> int:
    """Position of `door_class` in DOOR_CLASSES. Raises ConfigError that names the camera where it
    looks at no end."""
    found = door_class(camera)
    if found is None:
        raise ConfigError(
            f"cameras.{camera.name}: looks at no end of the container, but along a side; keep "
            "azimuth_deg and elevation_deg nearer to 0"
        )
    return DOOR_CLASSES.index(found)


def always_at_an_end(rig: CameraConfig) -> bool:
    """Whether every camera that is drawn from `rig` has a `door_class`."""
    slant = [max(map(abs, angles)) for angles in (rig.azimuth_deg, rig.elevation_deg)]
    along = math.prod(math.cos(math.radians(angle)) for angle in slant)
    return rig.face in DOOR_CLASSES and along > _LEAST_COSINE + 1e-3  # places are rounded


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
