"""Pixels to bytes, and bytes to disk so that a file is there whole or not at all."""

import contextlib
import os
from pathlib import Path

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

JPEG_QUALITY = 92

_PNG_FAST = [
    *(cv2.IMWRITE_PNG_COMPRESSION, 1),
    # naming a level resets the strategy; run lengths of rows taken from the one above suit masks:
    # 1.6 ms and 3 kB for 640x640, against 5.3 ms when libpng chooses filters
    *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
    *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP),
]


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """sRGB uint8 [H, W, 3] as JPEG, at full colour resolution for small coloured markers."""
    data: bytes = simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=JPEG_QUALITY, colorspace="RGB", colorsubsampling="444"
    )
    return data


def png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """uint8 [H, W, 3] sRGB, or uint8 or uint16 [H, W], as PNG."""
    ordered = pixels[..., ::-1] if pixels.ndim == 3 else pixels
    done, data = cv2.imencode(".png", np.ascontiguousarray(ordered), _PNG_FAST)
    assert done
    return data.tobytes()


def write(path: Path, data: bytes | str) -> None:
    """Put `data` at `path`, written aside and renamed into place."""
    aside = path.with_name(f".{path.name}.part")
    try:
        aside.write_bytes(data.encode() if isinstance(data, str) else data)
        os.replace(aside, path)
    except OSError:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)
        raise
