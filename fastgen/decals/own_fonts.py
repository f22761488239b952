"""Fonts of users: read from font files, and kept as text in a configuration.

A configuration holds the tiles and metrics themselves, so that a dataset can be continued and
repaired without the font, and on machines that would draw it differently.
"""

import base64
import binascii
import hashlib
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.glyphs import CHARACTERS, GLYPH_TILE_SIZE, Font, Glyph
from fastgen.decals.own_art import content_of, png_size
from fastgen.errors import ConfigError

PREFIX = "data:application/x-fastgen-font;base64,"
"""Start of every text that holds a font (RFC 2397)."""

MOST_FONTS = 5
"""Largest number of fonts in a configuration. Shaders can number 1,024 tiles: those of fastgen, and
those of five fonts with a condensed form of each."""

_DOOR_DIGIT_CAPS = 0.58
"""Mean advance of digits, in cap heights, with which identifiers fit between the bars of a door."""

_DIGEST = 8
_MOST_CAPS = 4.0
"""Bound of ends of ink and of advances."""

_LACKING = "lacks {}; give a font with A to Z, 0 to 9 and -./:,&'()+"
_BROKEN = f"the text after {PREFIX} is not a font that fastgen wrote; give a path instead"


@dataclass(frozen=True, eq=False)
class OwnFont:
    """A font of a user.

    Attributes:
        font: Its glyphs, whose tiles count from 0.
        tiles: uint8 [G, GLYPH_TILE_SIZE, GLYPH_TILE_SIZE], see glyphs.glyph_tiles.
    """

    font: Font
    tiles: NDArray[np.uint8]


@lru_cache(maxsize=64)
def forms_of(own: OwnFont) -> tuple[OwnFont, ...]:
    """Return a font, and a condensed form for doors if it is too wide for them."""
    glyphs = own.font.glyphs
    share = _DOOR_DIGIT_CAPS / (sum(glyphs[digit].advance for digit in "0123456789") / 10)
    if share >= 1:
        return (own,)
    middle = (GLYPH_TILE_SIZE - 1) / 2
    narrow = np.array([[share, 0.0, (1 - share) * middle], [0.0, 1.0, 0.0]])
    size = GLYPH_TILE_SIZE, GLYPH_TILE_SIZE
    tiles = np.stack([cv2.warpAffine(tile, narrow, size) for tile in own.tiles])
    narrower = {
        char: Glyph(each.tile, *(share * x for x in (each.ink_left, each.ink_right, each.advance)))
        for char, each in glyphs.items()
    }
    name = f"{own.font.name}-condensed"
    return own, OwnFont(Font(name, MappingProxyType(narrower)), np.asarray(tiles, np.uint8))


class OwnPrints(NamedTuple):
    """Artwork and fonts of a configuration, which its decals can use.

    Attributes:
        art: Images by name, uint8 [ART_SIZE, ART_SIZE, 4], see own_art.art_of.
        fonts: Fonts.
    """

    art: Mapping[str, NDArray[np.uint8]] = MappingProxyType({})
    fonts: tuple[OwnFont, ...] = ()


def read_font(path: Path) -> str:
    """Return the glyphs of a TrueType, OpenType or WOFF file as text.

    Signs that reach far below the baseline, such as parentheses, are cut off at the tile's border.

    Raises:
        ConfigError: The file cannot be used. The message names it.
    """
    from fastgen.decals import font_tiles  # Pillow takes 30 ms, and only this needs it

    data = content_of(path)
    try:
        face = font_tiles.typeface(io.BytesIO(data))
    except OSError:
        raise ConfigError(f"{path}: not a font; give a TTF, OTF or WOFF file") from None
    except ValueError:
        raise ConfigError(f"{path}: {_LACKING.format('H')}") from None
    lacking = "".join(char for char in CHARACTERS[:-1] if not face.has(char))
    if lacking:
        raise ConfigError(f"{path}: {_LACKING.format(lacking)}")
    large = [char for char in CHARACTERS if char.isalnum() and not face.fits(char)]
    if large:
        raise ConfigError(
            f"{path}: {', '.join(large)} reach beyond 1.6 cap heights across, or 0.3 above the "
            "capitals or below the baseline; give a narrower font"
        )
    tiles = font_tiles.font_tiles(face)
    header = {char: [round(float(value), 4) for value in tile[1:]] for char, tile in tiles.items()}
    stacked = np.concatenate([tile.distances for tile in tiles.values()])
    _, image = cv2.imencode(".png", stacked, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    packed = json.dumps(header).encode("ascii") + b"\n" + image.tobytes()
    return PREFIX + base64.b64encode(packed).decode("ascii")


@lru_cache(maxsize=64)
def own_font(name: str, text: str) -> OwnFont:
    """Return the font in the text of `read_font`.

    Scenes name it after its content too, because another configuration may give the name to
    another font.

    Args:
        name: Name of the font in the configuration.
        text: The text.

    Raises:
        ConfigError: The text is not such a font.
    """
    try:
        data = base64.b64decode(text.removeprefix(PREFIX), validate=True)
        header, _, image = data.partition(b"\n")
        metrics = json.loads(header)
        rows = [[float(value) for value in metrics[char]] for char in CHARACTERS]
    except (binascii.Error, ValueError, KeyError, TypeError, RecursionError):
        raise ConfigError(_BROKEN) from None
    side, count = GLYPH_TILE_SIZE, len(CHARACTERS)
    sound = all(
        isinstance(metrics[char], list) and len(row) == 3 and max(map(abs, row)) <= _MOST_CAPS
        for char, row in zip(CHARACTERS, rows, strict=True)
    ) and all(math.isfinite(value) for row in rows for value in row)
    if not sound or png_size("font", image) != (side, side * count):
        raise ConfigError(_BROKEN)
    mosaic = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_GRAYSCALE)
    if mosaic is None:
        raise ConfigError(_BROKEN)
    glyphs = {c: Glyph(i, *row) for i, (c, row) in enumerate(zip(CHARACTERS, rows, strict=True))}
    digest = hashlib.sha256(data).hexdigest()[:_DIGEST]
    font = Font(f"{name}-{digest}", MappingProxyType(glyphs))
    return OwnFont(font, np.asarray(mosaic, np.uint8).reshape(count, side, side))
