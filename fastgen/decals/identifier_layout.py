"""Layouts of container identifiers (ISO 6346, section 7, and the practice of container makers)."""

from dataclasses import dataclass
from itertools import pairwise

from fastgen.decals.glyphs import BOX, Font
from fastgen.decals.iso6346 import Identifier
from fastgen.decals.lettering import (
    BOX_MARGIN_CAPS,
    GLYPH_PITCH_CAPS,
    LINE_PITCH_CAPS,
    TextPart,
    ink_width_mm,
)

LAYOUTS = ("rows", "block", "column")
"""rows: owner code, serial number and check digit in one line, the size-type code mostly below.
block: owner code above serial number and check digit, above the size-type code.
column: letters below one another, the size-type code in a column of its own."""

TYPE_PLACES = {
    "rows": ("under serial", "under owner", "same line"),
    "block": ("below",),
    "column": ("beside, top", "beside, bottom", "below"),
}
"""Places of the size-type code by layout."""


@dataclass(frozen=True)
class Form:
    """How one identifier is written.

    Attributes:
        layout: One of LAYOUTS.
        type_place: Place of the size-type code, one of TYPE_PLACES[layout].
        cap_mm: Height of the capitals.
        boxed: Whether the check digit has a frame. ISO 6346 requires it.
        owner_gap_mm: Gap between owner code and serial number.
        check_gap_mm: Gap between the serial number and the check digit or its frame.
        column_gap_mm: Gap between the columns of an upright identifier.
        pitch_mm: Distance between the letters of a line, or between the baselines of a column; 0
            for the usual one. Lines with a pitch have all their letters in columns of that pitch,
            without the gaps above and with one free column before the serial number of rows. A
            size-type code that is not under the serial number is then under the owner code.
    """

    layout: str
    type_place: str
    cap_mm: float
    boxed: bool
    owner_gap_mm: float
    check_gap_mm: float
    column_gap_mm: float = 0.0
    pitch_mm: float = 0.0

    @property
    def spaced(self) -> bool:
        """Whether the letters of lines have a pitch."""
        return self.layout != "column" and self.pitch_mm > 0


def identifier_lines(identifier: Identifier, form: Form) -> tuple[str, ...]:
    """Return the lines of an identifier in reading order."""
    owner, number = identifier.owner, f"{identifier.serial} {identifier.check}"
    if form.layout == "block":
        return (owner, number, identifier.size_type)
    return (f"{owner} {number}", identifier.size_type)


def identifier_parts(identifier: Identifier, form: Form, font: Font) -> tuple[TextPart, ...]:
    """Return the places of owner code, serial number, check digit and size-type code.

    Args:
        identifier: The identifier.
        form: How it is written.
        font: Font of all letters.

    Returns:
        The four parts. The lower left corner of their common box is at (0, 0).
    """
    if form.spaced:
        return _spaced(identifier, form, font)
    place = {"rows": _rows, "block": _block, "column": _column}[form.layout]
    return place(identifier, form, font)


def _frame(form: Form, font: Font) -> tuple[float, float]:
    """Return the distances by which a frame exceeds its digit, at each side and up and down."""
    if not form.boxed:
        return 0.0, 0.0
    frame = font.glyphs[BOX]
    widest = frame.ink_right - frame.ink_left - 2 * BOX_MARGIN_CAPS
    return (widest / 2 + BOX_MARGIN_CAPS) * form.cap_mm, BOX_MARGIN_CAPS * form.cap_mm


def _width(text: str, form: Form, font: Font) -> float:
    """Return the width of the ink of letters without spaces in one line."""
    return ink_width_mm(text, font, form.cap_mm)


def row_widths(identifier: Identifier, form: Form, font: Font) -> tuple[float, float]:
    """Return the widths of the owner code, and of serial number with check digit, in a row."""
    serial = _width(identifier.serial, form, font)
    check_x = _check_x(identifier, form, font, serial)
    check = _width(identifier.check, form, font) / 2
    return _width(identifier.owner, form, font), check_x + check + (_frame(form, font)[0] or check)


def _check_x(identifier: Identifier, form: Form, font: Font, serial_end: float) -> float:
    """Return the left end of the check digit behind a serial number that ends at `serial_end`."""
    half = _width(identifier.check, form, font) / 2
    middle = serial_end + form.check_gap_mm + (_frame(form, font)[0] or half)
    return middle - half


def _rows(identifier: Identifier, form: Form, font: Font) -> tuple[TextPart, ...]:
    below = form.type_place != "same line"
    line_y = LINE_PITCH_CAPS * form.cap_mm if below else _frame(form, font)[1]
    serial_x = _width(identifier.owner, form, font) + form.owner_gap_mm
    check_x = _check_x(identifier, form, font, serial_x + _width(identifier.serial, form, font))
    type_x = {
        "under serial": serial_x,
        "under owner": 0.0,
        "same line": check_x
        + _width(identifier.check, form, font)
        + _frame(form, font)[0]
        + form.owner_gap_mm,
    }[form.type_place]
    return (
        TextPart("owner", identifier.owner, 0.0, line_y),
        TextPart("serial", identifier.serial, serial_x, line_y),
        TextPart("check", identifier.check, check_x, line_y, boxed=form.boxed),
        TextPart("type", identifier.size_type, type_x, 0.0 if below else line_y),
    )


def _block(identifier: Identifier, form: Form, font: Font) -> tuple[TextPart, ...]:
    step = LINE_PITCH_CAPS * form.cap_mm
    check_x = _check_x(identifier, form, font, _width(identifier.serial, form, font))
    return (
        TextPart("owner", identifier.owner, 0.0, 2 * step),
        TextPart("serial", identifier.serial, 0.0, step),
        TextPart("check", identifier.check, check_x, step, boxed=form.boxed),
        TextPart("type", identifier.size_type, 0.0, 0.0),
    )


def least_pitch_mm(identifier: Identifier, form: Form, font: Font) -> float:
    """Return the pitch at which neighbouring letters, or a letter and the frame, touch."""
    lines = identifier.owner, identifier.serial, identifier.size_type
    halves = [[_width(char, form, font) / 2 for char in line] for line in lines]
    check = _frame(form, font)[0] or _width(identifier.check, form, font) / 2
    halves[1].append(check)
    return max(a + b for line in halves for a, b in pairwise(line))


def _spaced(identifier: Identifier, form: Form, font: Font) -> tuple[TextPart, ...]:
    step, pitch = LINE_PITCH_CAPS * form.cap_mm, form.pitch_mm
    serial = len(identifier.owner) + 1 if form.layout == "rows" else 0
    placed = (  # text, column of its first letter, line from below
        ("owner", identifier.owner, 0, 1 if form.layout == "rows" else 2),
        ("serial", identifier.serial, serial, 1),
        ("check", identifier.check, serial + len(identifier.serial), 1),
        ("type", identifier.size_type, serial if form.type_place == "under serial" else 0, 0),
    )
    halves = [_width(text[0], form, font) / 2 for _, text, _, _ in placed]
    left = max(half for half, (_, _, column, _) in zip(halves, placed, strict=True) if not column)
    return tuple(
        TextPart(
            role,
            text,
            left + column * pitch - half,
            line * step,
            pitch_mm=pitch if len(text) > 1 else 0.0,
            boxed=role == "check" and form.boxed,
        )
        for half, (role, text, column, line) in zip(halves, placed, strict=True)
    )


def _column(identifier: Identifier, form: Form, font: Font) -> tuple[TextPart, ...]:
    cap, pitch = form.cap_mm, form.pitch_mm or GLYPH_PITCH_CAPS * form.cap_mm
    aside, up = _frame(form, font)
    letters = [identifier.owner, identifier.serial, identifier.check, identifier.size_type]
    widths = [max(_width(char, form, font) for char in text) for text in letters]
    heights = [(len(text) - 1) * pitch + cap for text in letters]
    half = max(*(width / 2 for width in widths[:3]), aside)
    low = heights[3] + form.owner_gap_mm if form.type_place == "below" else 0.0
    check_y = low + up
    serial_y = check_y + cap + up + form.check_gap_mm
    owner_y = serial_y + heights[1] + form.owner_gap_mm
    type_y = {
        "below": 0.0,
        "beside, top": owner_y + heights[0] - heights[3],
        "beside, bottom": 0.0,
    }[form.type_place]
    type_x = half - widths[3] / 2
    if form.type_place != "below":
        type_x = 2 * half + form.column_gap_mm
    return (
        TextPart("owner", letters[0], half - widths[0] / 2, owner_y, True, pitch),
        TextPart("serial", letters[1], half - widths[1] / 2, serial_y, True, pitch),
        TextPart("check", letters[2], half - widths[2] / 2, check_y, True, boxed=form.boxed),
        TextPart("type", letters[3], type_x, type_y, True, pitch),
    )
