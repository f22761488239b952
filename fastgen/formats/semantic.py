"""Semantic segmentation of damage: class index PNGs of 8 bits with a palette, beside the images.

0 is the background, 1 the container and 2 and up the damages. IGNORED marks objects that are too
small to be labelled, and containers of the background that are ignored.
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import ALL_SEGMENTATION_CLASSES
from fastgen.config.config import Config
from fastgen.files.images import png
from fastgen.formats.damage import instances
from fastgen.formats.format import DatasetFiles, Files, Format, Same
from fastgen.formats.item import Item
from fastgen.labels.background import background_masks
from fastgen.labels.visibility import window
from fastgen.overlay import class_color
from fastgen.sample import Sample

IGNORED = 255
"""Value of pixels that count for nothing, as trainers of semantic segmentation expect it."""

_PALETTE = np.zeros((256, 3), np.uint8)
_PALETTE[1 : 1 + len(ALL_SEGMENTATION_CLASSES)] = [*map(class_color, ALL_SEGMENTATION_CLASSES)]
_PALETTE[IGNORED] = 255


def class_map(sample: Sample) -> NDArray[np.uint8]:
    """Return the class index of each pixel, uint8 [H, W]."""
    found = (sample.damage // 100).astype(np.uint8)
    for _, box, mask, ignored in instances(sample):
        if ignored:
            window(found, box)[window(mask, box)] = IGNORED
    for thing, box, part in background_masks(sample):
        window(found, box)[part] = IGNORED if thing.ignored else 1
    return found


class _Semantic(Format):
    name = "semantic"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        name = f"{item.split}/{item.stem}"
        return {
            f"semantic/images/{name}.jpg": Same(item.image_path, link_only=True),
            f"semantic/masks/{name}.png": png(class_map(item.sample), _PALETTE),
        }, None

    def folders(self, split: str) -> Sequence[str]:
        return (f"semantic/images/{split}", f"semantic/masks/{split}")

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        names = ("background", *config.damage.segmentation_classes)
        yield "semantic/classes.txt", [f"{name}\n" for name in names]
        numbered = {str(number): name for number, name in enumerate(names)}
        yield "semantic/id2label.json", [json.dumps(numbered, indent=1)]


FORMAT = _Semantic()
