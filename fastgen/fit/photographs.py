"""Reading of a folder of photographs, and of the boxes beside them."""

import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import AssetError
from fastgen.files.images import decode
from fastgen.files.plain_file import read_plain
from fastgen.fit.statistics import Pixels, scaled

_TYPES = (".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff")
_SMALLEST = 64

LARGEST_FILE = 1 << 30
"""Largest size in bytes of a photograph, or of a file of boxes beside it."""


class Photograph(NamedTuple):
    """One photograph.

    Attributes:
        path: Its file.
        size: (width, height) of the file in pixels.
        pixels: uint8 [H, W, 3], sRGB, scaled down to `longest` if the file is larger.
    """

    path: Path
    size: tuple[int, int]
    pixels: Pixels


def read_photographs(folder: Path, longest: int, fewest: int = 1) -> list[Photograph]:
    """Return the photographs directly in a folder, sorted by name.

    Args:
        folder: Folder with files of type JPEG, PNG, WebP, BMP or TIFF. Hidden files are ignored.
        longest: Longer side in pixels that larger photographs are scaled down to.
        fewest: Number of photographs that the folder must have.

    Raises:
        AssetError: The folder is missing or has too few photographs, or one cannot be read or is
            smaller than 64 pixels.
    """
    if not folder.is_dir():
        wrong = "is a file, not a folder" if folder.exists() else "no such folder"
        raise AssetError(f"{folder}: {wrong}; give one that contains photographs")
    found = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in _TYPES and not path.name.startswith(".")
    )
    if not found:
        raise AssetError(
            f"{folder}: no photograph in this folder; give one with {', '.join(_TYPES)}"
        )
    if len(found) < fewest:
        count = "1 photograph" if len(found) == 1 else f"{len(found)} photographs"
        raise AssetError(
            f"{folder}: has {count}, too few to compare; give at least {fewest}, or better 20"
        )
    return [_read(path, longest) for path in found]


def _read(path: Path, longest: int) -> Photograph:
    try:
        # Pillow warns about damaged and large files; the error below says so
        with warnings.catch_warnings(action="ignore"):
            pixels = _as_rgb(decode(read_plain(path, LARGEST_FILE)))
    except (OSError, ValueError) as error:
        words = error.strerror if isinstance(error, OSError) else error
        raise AssetError(f"{path}: cannot be read as a picture ({words}); remove it") from None
    height, width = pixels.shape[:2]
    if min(height, width) < _SMALLEST:
        raise AssetError(
            f"{path}: {width}x{height} pixels are too few to measure; give photographs of at least "
            f"{_SMALLEST} pixels on each side"
        )
    if max(height, width) > longest:
        pixels = scaled(pixels, longest)
    return Photograph(path, (width, height), pixels)


def _as_rgb(pixels: NDArray[np.generic]) -> Pixels:
    """Return a decoded picture as uint8 [H, W, 3] without alpha."""
    if pixels.dtype == np.uint16:
        pixels = (pixels // 257).astype(np.uint8)
    if pixels.dtype != np.uint8 or pixels.ndim not in (2, 3):
        raise ValueError(f"pixels of type {pixels.dtype} with {pixels.ndim} axes")
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    if pixels.shape[2] < 3:  # grey, maybe with alpha
        pixels = np.repeat(pixels[..., :1], 3, axis=2)
    return np.ascontiguousarray(pixels[..., :3], np.uint8)
