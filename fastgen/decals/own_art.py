"""Artwork of users: read from PNG and SVG files, and kept as text in a configuration.

A configuration holds the images themselves, so that a dataset can be continued and repaired
without the files that they came from.
"""

import base64
import binascii
import struct
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.artwork import ART_SIZE, premultiplied_light, texels
from fastgen.errors import ConfigError
from fastgen.files.plain_file import read_plain

PREFIX = "data:image/png;base64,"
"""Start of every text that holds an image (RFC 2397)."""

_LARGEST_FILE = 16 << 20
_LARGEST_SIDE = 4096
_SVG_SIDE = 4 * ART_SIZE
"""Longer side at which an SVG is drawn before it is scaled to ART_SIZE."""

_PNG = b"\x89PNG\r\n\x1a\n"


def read_art(path: Path, square: bool) -> str:
    """Return the image in a PNG or SVG file as text.

    The image is stretched to ART_SIZE x ART_SIZE texels.

    Args:
        path: The file. SVG needs the package resvg-py.
        square: Refuse images that are not square.

    Raises:
        ConfigError: The file cannot be used. The message names it.
    """
    data = content_of(path)
    if path.suffix.lower() == ".svg":
        data = _drawn(path, data)
    width, height = png_size(path, data)
    if square and width != height:
        raise ConfigError(
            f"{path}: is {width}x{height}; give a square image, which the marker's four tips touch "
            "in the middle of its sides"
        )
    decoded = _decoded(path, data)
    if not decoded[..., 3].any():
        raise ConfigError(f"{path}: is transparent everywhere; give an image that shows something")
    image = _fitted(decoded)
    _, packed = cv2.imencode(".png", image[..., [2, 1, 0, 3]], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return PREFIX + base64.b64encode(packed.tobytes()).decode("ascii")


@lru_cache(maxsize=64)
def art_of(text: str) -> NDArray[np.uint8]:
    """Return the image in the text of `read_art`: read-only uint8 [ART_SIZE, ART_SIZE, 4].

    It is sRGB with straight alpha, row 0 at the top.

    Raises:
        ConfigError: The text is not such an image.
    """
    words = f"the text after {PREFIX} is not an image of {ART_SIZE}x{ART_SIZE}; give a path instead"
    try:
        data = base64.b64decode(text.removeprefix(PREFIX), validate=True)
    except (binascii.Error, ValueError):
        raise ConfigError(words) from None
    if png_size("image", data) != (ART_SIZE, ART_SIZE):
        raise ConfigError(words)
    image = _decoded("image", data)
    image.flags.writeable = False
    return image


def images_of(art: Mapping[str, str]) -> dict[str, NDArray[np.uint8]]:
    """Return the images of a configuration by their names in scenes, see `art_of`.

    Args:
        art: Texts by name. Images of names that begin with "marker/" are cut to the diamond.
    """
    images = {name: art_of(text) for name, text in art.items()}
    return {
        name: _cut_to_diamond(image) if name.startswith("marker/") else image
        for name, image in images.items()
    }


def _cut_to_diamond(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a square image, transparent outside the diamond whose tips touch its sides.

    Texels on its edge keep the share of their alpha that is inside, so that filtered artwork covers
    as much as the diamond.
    """
    side = len(image)
    from_center = np.abs(np.arange(side) + 0.5 - side / 2)
    inside = (side / 2 - from_center[:, None] - from_center) / np.sqrt(2)  # texels to the edge
    found = image.copy()
    found[..., 3] = np.rint(image[..., 3] * np.clip(inside + 0.5, 0, 1))
    return found


def content_of(path: Path) -> bytes:
    """Return the content of a file that a configuration names.

    Raises:
        ConfigError: It cannot be read, or has more than 16 MB.
    """
    try:
        return read_plain(path, _LARGEST_FILE)
    except (OSError, ValueError) as error:
        words = error.strerror if isinstance(error, OSError) else "give a path"
        raise ConfigError(f"{path}: cannot be read ({words})") from None


def _drawn(path: Path, data: bytes) -> bytes:
    """Return an SVG as PNG."""
    try:
        import resvg_py
    except ImportError:
        raise ConfigError(
            f"{path}: SVG needs the package resvg-py; pip install 'fastgen[svg]', or give a PNG"
        ) from None
    try:
        text = data.decode("utf-8")
        size = png_size(path, bytes(resvg_py.svg_to_bytes(text, skip_system_fonts=True)))
        width, height = (_SVG_SIDE, None) if size[0] >= size[1] else (None, _SVG_SIDE)
        drawn = bytes(
            resvg_py.svg_to_bytes(text, skip_system_fonts=True, width=width, height=height)
        )
    except ValueError as error:
        raise ConfigError(f"{path}: not an SVG that can be drawn ({error})") from None
    if "<text" in text:
        raise ConfigError(
            f"{path}: holds text, whose look depends on installed fonts; convert it to paths"
        )
    return drawn


def png_size(path: Path | str, data: bytes) -> tuple[int, int]:
    """Return (width, height) of a PNG from its header, before anything is decoded."""
    if not data.startswith(_PNG) or len(data) < 24:
        raise ConfigError(f"{path}: not a PNG or SVG image; give one")
    width, height = struct.unpack(">II", data[16:24])
    if not (0 < width <= _LARGEST_SIDE and 0 < height <= _LARGEST_SIDE):
        raise ConfigError(
            f"{path}: is {width}x{height}; give at most {_LARGEST_SIDE} pixels per side"
        )
    return width, height


def _decoded(path: Path | str, data: bytes) -> NDArray[np.uint8]:
    """Return a PNG as uint8 [H, W, 4] in RGBA order."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ConfigError(f"{path}: the image is damaged; write it again")
    if image.dtype == np.uint16:
        image = np.asarray(image // 257, np.uint8)
    shades = np.atleast_3d(image)
    color = shades[..., 2::-1] if shades.shape[2] > 2 else np.repeat(shades[..., :1], 3, axis=2)
    alpha = shades[..., -1:] if shades.shape[2] in (2, 4) else np.full_like(color[..., :1], 255)
    return np.ascontiguousarray(np.concatenate([color, alpha], axis=2), np.uint8)


def _fitted(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image stretched to ART_SIZE x ART_SIZE."""
    if image.shape[:2] == (ART_SIZE, ART_SIZE):
        return image
    light: np.ndarray = premultiplied_light(image)
    for axis in (0, 1):  # OpenCV averages only if neither side grows
        size = (light.shape[1], ART_SIZE) if axis == 0 else (ART_SIZE, ART_SIZE)
        how = cv2.INTER_AREA if light.shape[axis] > ART_SIZE else cv2.INTER_LINEAR
        light = cv2.resize(light, size, interpolation=how)
    return texels(light)
