"""Text crops: which identifiers of an image can be read, and their pixels."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fastgen.labels import decal_of
from fastgen.sample import Object, Sample

_CROP_MARGIN_PX = 3
_LEGIBLE_FRACTION = 0.85


def text_crops(sample: Sample, min_text_px: float) -> Iterator[tuple[Object, NDArray[np.uint8]]]:
    """Each legible text of an image, and its pixels [h, w, 3] with a small margin, as a view.

    min_text_px: least height of its capitals in the image, see config.LabelConfig.
    """
    width, height = sample.view.size
    for item in sample.objects:
        if item.class_name != "text" or not _legible(sample, item, min_text_px):
            continue
        assert item.bbox is not None
        x0, y0, x1, y1 = item.bbox
        margin = _CROP_MARGIN_PX
        yield (
            item,
            sample.image[
                max(y0 - margin, 0) : min(y1 + margin, height),
                max(x0 - margin, 0) : min(x1 + margin, width),
            ],
        )


def _legible(sample: Sample, item: Object, min_text_px: float) -> bool:
    """Large enough along both of its sides, hardly occluded, and not cut by the border."""
    if item.bbox is None or item.truncated or item.visible_fraction < _LEGIBLE_FRACTION:
        return False
    decal = decal_of(sample.scene, item.id)
    upper_left, _, lower_right, lower_left = np.array(item.quad).reshape(4, 2)
    across = np.linalg.norm(lower_right - lower_left) / decal.size_mm[0]
    up = np.linalg.norm(upper_left - lower_left) / decal.size_mm[1]
    return bool(min(across, up) * decal.cap_mm >= min_text_px)
