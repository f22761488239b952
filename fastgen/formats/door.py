"""Door classification: images of the two ends in a folder per class, as ImageFolder reads them."""

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
"""Classes and folders of the task, named like the faces that their cameras look at."""

_LEAST_COSINE = 0.7
"""A camera looks at an end if the cosine of its angle to the container's length is this or more."""


def door_class(camera: Camera) -> str | None:
    """Return the end of the container at which a camera looks; None for other views."""
    toward = np.subtract(camera.target_mm, camera.position_mm)
    along = toward[0] / max(float(np.linalg.norm(toward)), 1e-9)
    if abs(along) < _LEAST_COSINE:
        return None
    return DOOR_CLASSES[int(along > 0)]


def door_number(camera: Camera) -> int:
    """Return the index of a camera's `door_class` in DOOR_CLASSES.

    Raises:
        ConfigError: The camera does not look at an end.
    """
    found = door_class(camera)
    if found is None:
        raise ConfigError(
            f"cameras.{camera.name}: does not look at an end of the container; keep "
            "azimuth_deg and elevation_deg closer to 0"
        )
    return DOOR_CLASSES.index(found)


def always_at_an_end(rig: CameraConfig) -> bool:
    """Return whether every camera sampled from `rig` has a `door_class`."""
    slant = [max(map(abs, angles)) for angles in (rig.azimuth_deg, rig.elevation_deg)]
    along = math.prod(math.cos(math.radians(angle)) for angle in slant)
    return rig.face in DOOR_CLASSES and along > _LEAST_COSINE + 1e-3  # positions are rounded


class _Door(Format):
    name = "door"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        folder = door_class(item.sample.camera)
        if folder is None or item.container is None:
            return {}, None
        return {f"door/{item.split}/{folder}/{item.stem}.jpg": Same(item.image_path)}, None

    def folders(self, split: str) -> Sequence[str]:
        return (f"door/{split}/door", f"door/{split}/no_door")


FORMAT = _Door()
