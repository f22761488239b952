"""Markers, stickers, emblems and glyphs as arrays, read from the packaged assets; no GL."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import MARKER_CLASSES
from fastgen.errors import AssetError
from fastgen.resources import asset_path
from fastgen.srgb import DECODED, ENCODED

ART_SIZE = 512
GLYPH_TILE_SIZE = 64

_INK_SAMPLES = 8


@dataclass(frozen=True)
class Glyph:
    """tile: its number in the tile array. ink_left, ink_right, advance: in cap heights, from the
    pen's origin."""

    tile: int
    ink_left: float
    ink_right: float
    advance: float


@dataclass(frozen=True, eq=False)
class Font:
    """A font's glyphs by character; fonts are told apart by identity."""

    name: str
    glyphs: Mapping[str, Glyph]


@dataclass(frozen=True)
class Sticker:
    """A plate or sticker: true size in mm, faces it comes on, whether every container has it."""

    name: str
    size_mm: tuple[float, float]
    where: tuple[str, ...]
    always: bool


@dataclass(frozen=True)
class Brand:
    """A made-up shipping line. emblem: art name. owner_codes: four letters, the last a U."""

    name: str
    emblem: str
    owner_codes: tuple[str, ...]
    wordmark: str
    main_texts: tuple[str, ...]


@lru_cache(maxsize=1)
def art_images() -> tuple[NDArray[np.uint8], Mapping[str, int]]:
    """All artwork, uint8 [K, ART_SIZE, ART_SIZE, 4] sRGB with straight alpha, row 0 at the top,
    and the layer of each name: the markers in class order, then stickers and emblems.

    Raises AssetError for a missing or broken file.
    """
    paths = {name: asset_path("markers", f"{name}.png") for name in MARKER_CLASSES}
    paths |= {name: asset_path("stickers", f"{name}.png") for name in sorted(_index())}
    images = np.stack([_image(path, 4, ART_SIZE) for path in paths.values()])
    images = np.ascontiguousarray(images[..., [2, 1, 0, 3]])
    return images, MappingProxyType({name: i for i, name in enumerate(paths)})


def smaller(image: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """An image [N, N, 4] of `art_images` at half its side, a quarter, and so on to one texel.

    A texel is the mean of light that it covers, each part by its alpha: what is transparent has no
    colour to give.
    """
    rgba: np.ndarray = cv2.LUT(image, _LIGHT_AND_ALPHA)
    for channel in range(3):
        rgba[..., channel] *= rgba[..., 3]
    found = []
    while len(rgba) > 1:
        rgba = cv2.resize(rgba, (len(rgba) // 2,) * 2, interpolation=cv2.INTER_AREA)
        light = rgba[..., :3] / np.maximum(rgba[..., 3:], 1e-6)
        half = np.empty(rgba.shape, np.uint8)
        half[..., :3] = ENCODED[(light * (len(ENCODED) - 1) + 0.5).astype(np.uint16)]
        half[..., 3] = rgba[..., 3] * 255 + 0.5
        found.append(half)
    return found


_LIGHT_AND_ALPHA = np.stack([DECODED] * 3 + [np.linspace(0, 1, 256)], axis=1)[None].astype(
    np.float32
)


@lru_cache(maxsize=1)
def glyph_tiles() -> tuple[NDArray[np.uint8], Mapping[str, Font]]:
    """Signed-distance tiles, uint8 [G, 64, 64], row 0 at the top, and the fonts by name.

    assets/build_fonts.py says what a tile covers. Raises AssetError for a missing or broken file.
    """
    data = _json("fonts", "glyphs.json")
    mosaic = _image(asset_path("fonts", "glyphs.png"), 1, None)
    side = GLYPH_TILE_SIZE
    rows, columns = mosaic.shape[0] // side, mosaic.shape[1] // side
    tiles = mosaic.reshape(rows, side, columns, side).swapaxes(1, 2).reshape(-1, side, side)
    fonts = {
        name: Font(
            name,
            MappingProxyType(
                {
                    c: Glyph(g["tile"], g["ink"][0], g["ink"][1], g["advance"])
                    for c, g in glyphs.items()
                }
            ),
        )
        for name, glyphs in data["fonts"].items()
    }
    return np.ascontiguousarray(tiles[: data["tiles"]]), MappingProxyType(fonts)


def glyph_coverage(tiles: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Share of ink, uint8 [G, 64, 64], in each texel of signed-distance tiles [G, 64, 64].

    Mip levels of it keep the ink that those of distances lose where strokes are thin.
    """
    return np.stack([_ink(tile) for tile in tiles])


def _ink(distances: NDArray[np.uint8]) -> NDArray[np.uint8]:
    side = GLYPH_TILE_SIZE
    fine = cv2.resize(distances, (side * _INK_SAMPLES,) * 2, interpolation=cv2.INTER_LINEAR)
    _, ink = cv2.threshold(fine, 127, 255, cv2.THRESH_BINARY)
    return np.asarray(cv2.resize(ink, (side, side), interpolation=cv2.INTER_AREA), np.uint8)


@lru_cache(maxsize=1)
def stickers() -> Mapping[str, Sticker]:
    """Plates and stickers that are no markers, by name."""
    return MappingProxyType(
        {
            name: Sticker(name, tuple(s["size_mm"]), tuple(s["where"]), s["always"])
            for name, s in _index().items()
            if s["role"] == "sticker"
        }
    )


@lru_cache(maxsize=1)
def brands() -> tuple[Brand, ...]:
    """The made-up shipping lines."""
    return tuple(
        Brand(name, b["emblem"], tuple(b["owner_codes"]), b["wordmark"], tuple(b["main_texts"]))
        for name, b in _json("stickers", "brands.json").items()
    )


@lru_cache(maxsize=1)
def _index() -> dict[str, Any]:
    return _json("stickers", "index.json")


def _json(*parts: str) -> dict[str, Any]:
    path = asset_path(*parts)
    try:
        data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise AssetError(f"{path}: cannot be read ({error}); reinstall fastgen") from None
    return data


def _image(path: Path, channels: int, size: int | None) -> NDArray[np.uint8]:
    # by its bytes: OpenCV takes no path that is not UTF-8
    data = np.frombuffer(path.read_bytes() if path.exists() else b"", np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    found = 0 if image is None else image.shape[2] if image.ndim == 3 else 1
    if image is None or found != channels or (size and image.shape[:2] != (size, size)):
        wanted = f"{size}x{size}, " if size else ""
        raise AssetError(f"{path}: not a PNG of {wanted}{channels} channels; reinstall fastgen")
    return np.asarray(image, np.uint8)
