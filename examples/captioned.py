"""Pictures with captions below, side by side."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

_GAP_PX = 6
"""Gap between pictures."""

_MARGIN = 255
"""Grey level of gaps and captions."""


def captioned(
    image: NDArray[np.uint8], words: str, strip_px: int = 42, letters: float = 0.95
) -> NDArray[np.uint8]:
    """Return an image uint8 [H, W, 3] with a caption below.

    Args:
        image: The image.
        words: The caption.
        strip_px: Height of the caption with its margins.
        letters: Scale of the letters, see cv2.putText.
    """
    strip = np.full((strip_px, image.shape[1], 3), _MARGIN, np.uint8)
    place, black = (2, strip_px - round(0.315 * strip_px)), (30, 30, 30)
    cv2.putText(strip, words, place, cv2.FONT_HERSHEY_SIMPLEX, letters, black, 1, cv2.LINE_AA)
    return np.concatenate([image, strip])


def beside(pictures: Sequence[NDArray[np.uint8]], columns: int) -> NDArray[np.uint8]:
    """Return pictures of one size in rows of `columns`, uint8 [H, W, 3]."""
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // columns)
    whole = np.full((rows * height, columns * (width + _GAP_PX) - _GAP_PX, 3), _MARGIN, np.uint8)
    for i, picture in enumerate(pictures):
        y, x = i // columns * height, i % columns * (width + _GAP_PX)
        whole[y : y + height, x : x + width] = picture
    return whole


def write_jpeg(path: Path, picture: NDArray[np.uint8], quality: int) -> None:
    """Write an sRGB picture uint8 [H, W, 3] as a small JPEG file, and make its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    flags = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    encoded, data = cv2.imencode(".jpg", picture[..., ::-1], flags)
    if not encoded:
        raise SystemExit(f"{path}: the picture cannot be encoded")
    path.write_bytes(data.tobytes())
