"""Image encoders and decoders, and atomic writes of small files.

`jpeg` and `png` encode the images of a dataset, where each millisecond counts. `encode_picture` and
`decode` use imageio, for pictures that are written or read once.
"""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from zlib_ng import zlib_ng

from fastgen.errors import OutputError
from fastgen.files.atomic_file import whole_file

JPEG_QUALITY = 92

_FILTER_UP = 2
_COLOR_TYPES = {1: 0, 3: 2, 4: 6}
"""Colour type by number of channels: grey, RGB, RGBA."""

_INDEXED = 3

_PICTURE_OPTIONS: dict[str, dict[str, Any]] = {
    ".png": {"compress_level": 1},
    ".jpg": {"quality": JPEG_QUALITY, "subsampling": 0},
    ".jpeg": {"quality": JPEG_QUALITY, "subsampling": 0},
}

PICTURE_TYPES = tuple(_PICTURE_OPTIONS)
"""File name suffixes that `encode_picture` accepts."""


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """Return an sRGB image, uint8 [H, W, 3], as JPEG.

    Color has full resolution (4:4:4), because markers are small and colored.
    """
    data: bytes = simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=JPEG_QUALITY, colorspace="RGB", colorsubsampling="444"
    )
    return data


def png(
    pixels: NDArray[np.uint8] | NDArray[np.uint16], palette: NDArray[np.uint8] | None = None
) -> bytes:
    """Return an image as PNG.

    The difference of each row to the row above is encoded with run lengths, which suits flat areas.
    W3C, Portable Network Graphics, second edition, sections 5 (chunks), 9 (filters) and 11.

    Args:
        pixels: sRGB uint8 [H, W, 3], the same with alpha [H, W, 4], or a mask uint8 or uint16
            [H, W].
        palette: Colours uint8 [N, 3] of the values of a mask of 8 bits, as which viewers show it.
    """
    height, width, channels = np.atleast_3d(pixels).shape
    values = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8)
    values = values.reshape(height, -1)
    rows = np.empty((height, 1 + values.shape[1]), np.uint8)
    rows[:, 0] = _FILTER_UP
    rows[0, 1:] = values[0]
    np.subtract(values[1:], values[:-1], out=rows[1:, 1:])
    # zlib gives the same bytes but takes ten times as long
    packer = zlib_ng.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, 8, zlib.Z_RLE)
    packed = packer.compress(rows) + packer.flush()
    kind = _COLOR_TYPES[channels] if palette is None else _INDEXED
    head = struct.pack(">IIBBBBB", width, height, 8 * pixels.itemsize, kind, 0, 0, 0)
    chunks = [_chunk(b"IHDR", head), _chunk(b"IDAT", packed), _chunk(b"IEND", b"")]
    if palette is not None:
        chunks.insert(1, _chunk(b"PLTE", palette.tobytes()))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def encode_picture(image: NDArray[np.uint8], suffix: str) -> bytes:
    """Return an sRGB image, uint8 [H, W, 3], as a file of a type in PICTURE_TYPES."""
    import imageio.v3 as iio  # here because it takes 0.1 s and workers do not need it

    data: bytes = iio.imwrite(
        "<bytes>", image, plugin="pillow", extension=suffix, **_PICTURE_OPTIONS[suffix]
    )
    return data


def decode(data: bytes) -> NDArray[Any]:
    """Return the pixels of an image file.

    Returns:
        Array [H, W] for grey images, else [H, W, C] in the order RGB or RGBA, of the file's depth.

    Raises:
        ValueError: The file is damaged, not an image, or too large.
    """
    import imageio.v3 as iio  # here because it takes 0.1 s and workers do not need it
    from PIL.Image import DecompressionBombError

    try:
        return iio.imread(data, plugin="pillow")
    except (OSError, SyntaxError) as error:
        if error.__cause__ is None:  # raised by Pillow itself
            raise ValueError(f"not a complete image ({error})") from None
        # imageio's message lists its plugins, which does not help the user
        large = isinstance(error.__cause__, DecompressionBombError)
        reason = "too many pixels" if large else "not an image of a known type, or cut short"
        raise ValueError(reason) from None


def check_folder(path: Path) -> None:
    """Raise OutputError if the folder of a file to write is missing."""
    if not path.absolute().parent.is_dir():
        raise OutputError(f"{path}: no folder {path.parent}; make it first")


def write(path: Path, data: bytes | str) -> None:
    """Write a file completely or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    try:
        with whole_file(path) as stream:
            stream.write(data.encode() if isinstance(data, str) else data)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
