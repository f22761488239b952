"""Preview: images as pictures for people, also by material layer or label, or many in a grid."""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.overlay import DAMAGE_GREYS, ID_GREYS, Picture, label_colors
from fastgen.render.variant import LAYERS
from fastgen.sample import Sample
from fastgen.validation import check_known, whole

PREVIEW_LAYERS = (*LAYERS, "ids", "damage")
"""Material layers, and the two label images."""


def preview(
    generator: Generator,
    index: int,
    camera: str | None = None,
    layer: str = "all",
    annotated: bool = False,
) -> NDArray[np.uint8]:
    """Render one image of a scene as a picture.

    Args:
        generator: Renders the image.
        index: Scene number.
        camera: Name of one of the scene's cameras; by default the first.
        layer: "all" for the finished image, one material layer without lighting, or "ids" or
            "damage" for a label image in distinct colours.
        annotated: Draw boxes, class names and damage outlines over the picture.

    Returns:
        uint8 sRGB [H, W, 3].

    Raises:
        ConfigError: An argument is not valid.
    """
    check_known("layer", layer, PREVIEW_LAYERS)
    sample = generator.render(index, camera, layer=layer if layer in LAYERS else "all")
    image = sample.image
    if layer == "ids":
        image = label_colors(sample.ids, ID_GREYS)
    elif layer == "damage":
        image = label_colors(sample.damage, DAMAGE_GREYS)
    return sample.overlay(image) if annotated else image


def grid(
    samples: Iterable[Sample], columns: int = 4, tile_px: int = 320, annotated: bool = True
) -> Picture:
    """Return samples side by side in one picture, which notebooks show.

    Args:
        samples: At least one sample.
        columns: Samples in a row, 1 or more.
        tile_px: Longer side of each sample in pixels, 16 to 4096.
        annotated: Draw boxes, class names and tinted damages.

    Returns:
        uint8 sRGB [H, W, 3]; smaller samples have a dark margin.

    Raises:
        ConfigError: `samples` is empty, or a number is out of range.
    """
    if whole("columns", columns) < 1:
        raise ConfigError(f"columns: {columns} is too small; give 1 or more")
    if not 16 <= whole("tile_px", tile_px) <= 4096:
        raise ConfigError(f"tile_px: {tile_px} is out of range; give 16 to 4096")
    tiles = []
    for sample in samples:
        image = sample.overlay() if annotated else sample.image
        scale = tile_px / max(image.shape[:2])
        width, height = (max(round(side * scale), 1) for side in image.shape[1::-1])
        smaller = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        tiles.append(cv2.resize(image, (width, height), interpolation=smaller))
    if not tiles:
        raise ConfigError("samples: there are none; give at least one")
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    height, width = np.max([tile.shape[:2] for tile in tiles], axis=0)
    picture = np.full((rows * height, columns * width, 3), 32, np.uint8)
    for i, tile in enumerate(tiles):
        y, x = i // columns * height, i % columns * width
        picture[y : y + tile.shape[0], x : x + tile.shape[1]] = tile
    return picture.view(Picture)
