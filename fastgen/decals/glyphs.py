"""Glyphs of the packaged fonts: tiles of signed distances, metrics and ink coverage."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.asset_files import asset_image, asset_json
from fastgen.files import disk_cache
from fastgen.resources import asset_path

VERSION = 1  # raise when the stored arrays change

BOX = "\N{WHITE RECTANGLE}"
"""Character of the frame around a check digit, in every font."""

CHARACTERS = f"ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-./:,&'()+{BOX}"
"""Characters of every font."""

GLYPH_TILE_SIZE = 64
"""Width and height of a glyph tile, texels."""

GLYPH_MOST_INK = GLYPH_TILE_SIZE**2 / 2
"""Upper limit of the ink in a glyph tile, in full texels."""

GLYPH_EXTENT_STEPS = 128
"""Steps along a side of a glyph tile in which `glyph_extents` are given."""

_INK_SAMPLES = 8
"""Samples per texel and axis from which ink coverage is computed."""


@dataclass(frozen=True)
class Glyph:
    """Tile and metrics of one character; lengths are in cap heights from the pen position.

    Attributes:
        tile: Index into the tiles of the font, see `glyph_tiles` for those of fastgen.
        ink_left: Left end of the ink.
        ink_right: Right end of the ink.
        advance: Distance to the next pen position.
    """

    tile: int
    ink_left: float
    ink_right: float
    advance: float


@dataclass(frozen=True, eq=False)
class Font:
    """Glyphs of a font by character; two fonts are equal only if they are the same object."""

    name: str
    glyphs: Mapping[str, Glyph]


@lru_cache(maxsize=1)
def glyph_tiles() -> tuple[NDArray[np.uint8], Mapping[str, Font]]:
    """Return the glyphs of all fonts as signed-distance tiles.

    `lettering.TILE_CAPS` and its neighbours define the area and the value range of a tile.

    Returns:
        Tiles, uint8 [G, GLYPH_TILE_SIZE, GLYPH_TILE_SIZE], row 0 at the top, above 127 inside the
        outline; and the fonts by name.

    Raises:
        AssetError: A file is missing or broken.
    """
    data = asset_json("fonts", "glyphs.json")
    mosaic = asset_image(asset_path("fonts", "glyphs.png"), 1, None)
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


_OWN: dict[str, Font] = {}
"""Fonts of configurations by name."""


def add_font(font: Font) -> None:
    """Make a font of a configuration known in this process; its name belongs to its content."""
    _OWN.setdefault(font.name, font)


def font_named(name: str) -> Font:
    """Return a font of fastgen, or one of a configuration that this process has read."""
    bundled = glyph_tiles()[1]
    return bundled[name] if name in bundled else _OWN[name]


def glyph_coverage() -> NDArray[np.uint8]:
    """Return the share of ink in each texel of `glyph_tiles`, read-only.

    Returns:
        uint8 [G, GLYPH_TILE_SIZE, GLYPH_TILE_SIZE], 255 for full ink.

    Raises:
        AssetError: A file is missing or broken.
    """
    return glyph_ink()["coverage"]


def extents_of(coverage: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return how far the ink of each glyph reaches from the middle of its tile.

    Args:
        coverage: Share of ink, see `glyph_coverage`.

    Returns:
        int64 [G, 2], half width and half height in GLYPH_EXTENT_STEPS per tile, rounded up.
    """
    ink = coverage > 0
    texel = np.abs(np.arange(GLYPH_TILE_SIZE) + 0.5 - GLYPH_TILE_SIZE / 2) + 0.5
    reach = [(ink.any(axis=axis) * texel).max(axis=1) for axis in (1, 2)]
    steps = GLYPH_EXTENT_STEPS / GLYPH_TILE_SIZE
    return np.ceil(np.stack(reach, axis=1) * steps).astype(np.int64)


@lru_cache(maxsize=1)
def glyph_extents() -> NDArray[np.int64]:
    """Return `extents_of` the tiles of `glyph_tiles`."""
    return extents_of(glyph_coverage())


def glyph_sums() -> NDArray[np.uint16]:
    """Return summed-area tables of the ink of `glyph_tiles` (Crow 1984), read-only.

    Returns:
        uint16 [G, GLYPH_TILE_SIZE, GLYPH_TILE_SIZE]: the ink of the texels up to and including a
        row and column, in units of GLYPH_MOST_INK / 65535 texels.
    """
    return glyph_ink()["sums"]


@lru_cache(maxsize=1)
def glyph_ink() -> disk_cache.Arrays:
    """Return the arrays of `glyph_coverage` and `glyph_sums`, from the disk cache if possible."""
    tiles, _ = glyph_tiles()
    shape = " ".join(map(str, tiles.shape))
    layout = {"coverage": f"uint8 {shape}", "sums": f"uint16 {shape}"}
    digest = hashlib.sha256(tiles.data).hexdigest()
    return disk_cache.cached("glyph-ink", VERSION, digest, lambda: ink_of(tiles), layout=layout)


def ink_of(tiles: NDArray[np.uint8]) -> disk_cache.Arrays:
    """Return the arrays "coverage" and "sums" of tiles, see `glyph_coverage` and `glyph_sums`."""
    coverage = np.stack([_ink(tile) for tile in tiles])
    sums = (coverage / 255).cumsum(axis=1).cumsum(axis=2)
    scaled = np.rint(sums * (65535 / GLYPH_MOST_INK)).astype(np.uint16)
    return {"coverage": coverage, "sums": scaled}


def _ink(distances: NDArray[np.uint8]) -> NDArray[np.uint8]:
    side = GLYPH_TILE_SIZE
    fine = cv2.resize(distances, (side * _INK_SAMPLES,) * 2, interpolation=cv2.INTER_LINEAR)
    _, ink = cv2.threshold(fine, 127, 255, cv2.THRESH_BINARY)
    return np.asarray(cv2.resize(ink, (side, side), interpolation=cv2.INTER_AREA), np.uint8)
