"""Preview: one image of a scene as a picture for people, also by material layer or label."""

import numpy as np
from numpy.typing import NDArray

from fastgen.generator import Generator
from fastgen.labels.overlay import DAMAGE_GREYS, ID_GREYS, label_colors, overlay
from fastgen.render.variant import LAYERS
from fastgen.validation import check_known

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
    return overlay(sample, image) if annotated else image
