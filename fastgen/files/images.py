"""Pixels to bytes, and bytes to disk so that a file is there whole or not at all."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray
from zlib_ng import zlib_ng

from fastgen.errors import OutputError
from fastgen.files.atomic_file import whole_file

JPEG_QUALITY = 92

_PNG_FAST = [
    *(cv2.IMWRITE_PNG_COMPRESSION, 1),
    # naming a level resets the strategy
    *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
    *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP),
]

_FILTER_UP = 2
_GREY = 0


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """sRGB uint8 [H, W, 3] as JPEG, at full colour resolution for small coloured markers."""
    data: bytes = simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=JPEG_QUALITY, colorspace="RGB", colorsubsampling="444"
    )
    return data


def png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """uint8 [H, W, 3] sRGB, or uint8 or uint16 [H, W], as PNG."""
    if pixels.ndim == 2:
        return _mask_png(pixels)
    done, data = cv2.imencode(".png", np.ascontiguousarray(pixels[..., ::-1]), _PNG_FAST)
    assert done
    return data.tobytes()


def _mask_png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Rows less the one above, then run lengths: masks are patches of one value.

    W3C, Portable Network Graphics, second edition, sections 5 (chunks), 9 (filters) and 11.
    """
    height, width = pixels.shape
    depth = 8 * pixels.itemsize
    values = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8)
    rows = np.empty((height, 1 + values.shape[1]), np.uint8)
    rows[:, 0] = _FILTER_UP
    rows[0, 1:] = values[0]
    np.subtract(values[1:], values[:-1], out=rows[1:, 1:])
    # zlib's own bytes in a tenth of the time
    packer = zlib_ng.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, 8, zlib.Z_RLE)
    packed = packer.compress(rows) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, depth, _GREY, 0, 0, 0)
    chunks = _chunk(b"IHDR", head), _chunk(b"IDAT", packed), _chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write(path: Path, data: bytes | str) -> None:
    """Put `data` at `path`, written aside and renamed into place.

    Raises OutputError where that fails.
    """
    try:
        with whole_file(path) as stream:
            stream.write(data.encode() if isinstance(data, str) else data)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
