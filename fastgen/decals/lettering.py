"""Text layout, shared by sampling, labels and renderer: the position of each letter."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, NamedTuple

from fastgen.decals.glyphs import BOX, Font
from fastgen.errors import AssetError
from fastgen.validation import Bounds, Flag, OneOf

_WITHIN = Bounds(-1e5, 1e5, "mm")

TILE_CAPS = 1.6
"""Side of the square that a glyph's tile covers, in cap heights; ink is centred horizontally."""

TILE_BASELINE_CAPS = 0.3
"""Height of the baseline above the tile's bottom, in cap heights."""

TILE_RANGE_CAPS = 0.3
"""Distance across the outline over which tile values go from 0 to 255, in cap heights."""

LINE_PITCH_CAPS = 1.5
"""Distance between the baselines of horizontal lines, in cap heights."""

COLUMN_PITCH_CAPS = 1.6
"""Distance between the centres of vertical columns, in cap heights."""

GLYPH_PITCH_CAPS = 1.35
"""Distance between the baselines of the glyphs of a column, in cap heights."""


_SPACE_CAPS = 0.45
"""Width of a space in a line, in cap heights."""

BOX_MARGIN_CAPS = 0.15
"""Distance from a digit's capitals or widest ink to the outside of its frame, in cap heights."""

BOX_STROKE_CAPS = 0.06
"""Width of the frame's line, in cap heights."""

PART_ROLES = ("owner", "serial", "check", "type")
"""Parts of an identifier: owner code, serial number, check digit, size-type code."""


@dataclass(frozen=True)
class TextPart:
    """One part of a text with its own place, for example the serial number of an identifier.

    Attributes:
        role: One of PART_ROLES, or '' for a part without a label.
        text: The letters; spaces are gaps.
        x_mm: Left end of the letters' ink, from the left end of the decal.
        y_mm: Lowest baseline, from the lower end of the decal.
        vertical: True if the letters are below one another, centred in their column.
        pitch_mm: Distance between the centres of neighbouring letters, or between their baselines
            in a vertical part; 0 for the font's own spacing.
        boxed: True for a frame around the part, which must be a single character.
    """

    role: Annotated[str, OneOf(("", *PART_ROLES))]
    text: str
    x_mm: Annotated[float, _WITHIN]
    y_mm: Annotated[float, _WITHIN]
    vertical: Flag = False
    pitch_mm: Annotated[float, Bounds(0.0, 1e5, "mm")] = 0.0
    boxed: Flag = False


class PartBox(NamedTuple):
    """Tight box of a part with its frame, in mm from the lower left corner of the text.

    Attributes:
        role: Role of the part.
        text: Its letters.
        x0: Left end.
        y0: Lower end.
        x1: Right end.
        y1: Upper end.
    """

    role: str
    text: str
    x0: float
    y0: float
    x1: float
    y1: float


class PlacedGlyph(NamedTuple):
    """Tile rectangle of one glyph, in mm from the lower left corner of the text's ink box.

    Attributes:
        char: The character.
        tile: Index into the tiles of the text's font.
        x0: Left edge.
        y0: Bottom edge.
        x1: Right edge.
        y1: Top edge.
    """

    char: str
    tile: int
    x0: float
    y0: float
    x1: float
    y1: float


@dataclass(frozen=True)
class Lettering:
    """Layout of one text.

    Attributes:
        size_mm: Width of the ink, and height from the lowest baseline to the capitals' tops,
            frames included.
        glyphs: Glyphs of all characters except spaces, and of frames.
        parts: Boxes of the parts, empty for a text without parts.
    """

    size_mm: tuple[float, float]
    glyphs: tuple[PlacedGlyph, ...]
    parts: tuple[PartBox, ...] = ()


@lru_cache(maxsize=256)  # Sampling, renderer and labels lay out the same texts.
def layout(
    lines: tuple[str, ...],
    font: Font,
    cap_mm: float,
    vertical: bool = False,
    parts: tuple[TextPart, ...] = (),
) -> Lettering:
    """Lay out a text.

    Args:
        lines: The text, one string per line.
        font: Font of all letters.
        cap_mm: Height of the capitals.
        vertical: False for left-aligned lines, the first at the top. True for columns from left to
            right: upright glyphs one below the other, centred in their column.
        parts: Places of the parts of the text. If given, they decide the layout, and `lines` and
            `vertical` are not used.

    Returns:
        Size of the text and position of each glyph.

    Raises:
        AssetError: The font has no glyph for a character.
    """
    for char in "".join(part.text for part in parts) if parts else "".join(lines):
        if char not in font.glyphs and char != " ":
            raise AssetError(f"font {font.name}: no glyph for {char!r}; use other characters")
    if parts:
        return _laid_out(parts, font, cap_mm)
    place = _columns if vertical else _rows
    inks = place(lines, font)
    x0, y0, x1, y1 = _bounds(inks)
    size = (round((x1 - x0) * cap_mm, 1), round((y1 - y0) * cap_mm, 1))
    return Lettering(size, tuple(_placed(ink, font, cap_mm) for ink in _moved(inks, -x0, -y0)))


def ink_width_mm(text: str, font: Font, cap_mm: float) -> float:
    """Return the width of the ink of one line, as `layout` finds it."""
    first, last = font.glyphs[text[0]], font.glyphs[text[-1]]
    advances = sum(_SPACE_CAPS if char == " " else font.glyphs[char].advance for char in text[:-1])
    return (advances + last.ink_right - first.ink_left) * cap_mm


class _Ink(NamedTuple):
    """Ink of one glyph, in cap heights."""

    char: str
    x: float
    """Left end."""
    y: float
    """Baseline."""
    width: float


def _laid_out(parts: Sequence[TextPart], font: Font, cap_mm: float) -> Lettering:
    glyphs: list[PlacedGlyph] = []
    boxes = []
    for part in parts:
        inks = _part_inks(part, font, cap_mm)
        x0, y0, x1, y1 = (value * cap_mm for value in _bounds(inks))
        if part.boxed:
            frame = font.glyphs[BOX]
            width = frame.ink_right - frame.ink_left
            (letter,) = inks
            # the frame comes first: the shader takes the first of two glyphs at one place
            inks.insert(0, _Ink(BOX, letter.x + (letter.width - width) / 2, letter.y, width))
            x0 = inks[0].x * cap_mm
            x1 = x0 + width * cap_mm
            y0, y1 = y0 - BOX_MARGIN_CAPS * cap_mm, y1 + BOX_MARGIN_CAPS * cap_mm
        glyphs += [_placed(ink, font, cap_mm) for ink in inks]
        boxes.append(PartBox(part.role, part.text, x0, y0, x1, y1))
    size = (round(max(box.x1 for box in boxes), 1), round(max(box.y1 for box in boxes), 1))
    return Lettering(size, tuple(glyphs), tuple(boxes))


def _part_inks(part: TextPart, font: Font, cap_mm: float) -> list[_Ink]:
    inks = (_columns if part.vertical else _rows)((part.text,), font)
    if part.pitch_mm:
        pitch = part.pitch_mm / cap_mm
        places = [i for i, char in enumerate(part.text) if char != " "]
        inks = [
            _Ink(char, x, -i * pitch, width)
            if part.vertical
            else _Ink(char, i * pitch - width / 2, y, width)
            for i, (char, x, y, width) in zip(places, inks, strict=True)
        ]
    left, low, _, _ = _bounds(inks)
    return _moved(inks, part.x_mm / cap_mm - left, part.y_mm / cap_mm - low)


def _moved(inks: Sequence[_Ink], right: float, up: float) -> list[_Ink]:
    return [_Ink(char, x + right, y + up, width) for char, x, y, width in inks]


def _bounds(inks: Sequence[_Ink]) -> tuple[float, float, float, float]:
    """Return left, lowest baseline, right and capitals' top of inks, in cap heights."""
    lines = [ink.y for ink in inks]
    right = max([ink.x + ink.width for ink in inks])
    return min([ink.x for ink in inks]), min(lines), right, max(lines) + 1.0


def _placed(ink: _Ink, font: Font, cap_mm: float) -> PlacedGlyph:
    x0 = (ink.x + ink.width / 2 - TILE_CAPS / 2) * cap_mm
    y0 = (ink.y - TILE_BASELINE_CAPS) * cap_mm
    side = TILE_CAPS * cap_mm
    return PlacedGlyph(ink.char, font.glyphs[ink.char].tile, x0, y0, x0 + side, y0 + side)


def _rows(lines: Sequence[str], font: Font) -> list[_Ink]:
    inks: list[_Ink] = []
    for row, line in enumerate(lines):
        pen = 0.0
        for char in line:
            if char == " ":
                pen += _SPACE_CAPS
                continue
            glyph = font.glyphs[char]
            width = glyph.ink_right - glyph.ink_left
            inks.append(_Ink(char, pen + glyph.ink_left, -row * LINE_PITCH_CAPS, width))
            pen += glyph.advance
    return inks


def _columns(lines: Sequence[str], font: Font) -> list[_Ink]:
    inks: list[_Ink] = []
    for column, line in enumerate(lines):
        y = 0.0
        for char in line:
            if char == " ":
                y -= 0.6
                continue
            width = font.glyphs[char].ink_right - font.glyphs[char].ink_left
            inks.append(_Ink(char, column * COLUMN_PITCH_CAPS - width / 2, y, width))
            y -= GLYPH_PITCH_CAPS
    return inks
