"""Sampling of identifiers (ISO 6346)."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.identifier_layout import (
    LAYOUTS,
    Form,
    identifier_lines,
    identifier_parts,
    least_pitch_mm,
    row_widths,
)
from fastgen.decals.lettering import GLYPH_PITCH_CAPS, Lettering
from fastgen.sampling.lettering_style import BAR_GAP_MM, Style, in_any_font, part_text, placed
from fastgen.sampling.sheet import EDGE_MM, Sheet, between, tenth
from fastgen.sampling.streams import Streams, weighted_choice
from fastgen.scene import Decal, Vec2
from fastgen.validation import Range

_TRIES = 12
"""Positions tried for rows on both sides of a locking bar."""

_FLATS = 4
"""Flats that are tried for the first letter where letters are spaced by half waves."""

_LEAST_GAP_CAPS = 0.08
"""Least gap between letters that are spaced by half waves, in cap heights."""

_COLUMN_CAPS = 17.0
"""Height of the tallest column in cap heights."""


def sample_identifiers(
    config: MarkingsConfig, sheet: Sheet, style: Style, streams: Streams
) -> list[Decal]:
    """Sample one identifier at the upper right (ISO 6346, section 7), on long sides maybe two.

    The second one is at the left end. Letters that are spaced by half waves stand on the flats of
    their wall, and columns on a corrugated end wall on an outer flat. Nothing on a door is covered
    by its gear. If a layout finds no room, the others are tried.
    """
    rng = streams(f"identifier.{sheet.face}")
    long_side = sheet.face in ("front", "back")
    count = 1 + int(long_side and rng.random() < config.second_identifier)
    found = []
    for number in range(count):
        wear = round(float(rng.uniform(*config.text_wear)), 3)
        for form in _forms(config, sheet, rng):
            if sheet.clearance and form.layout == "rows":
                decal = _across_bar(sheet, in_any_font(config, style, rng), form, rng)
            else:
                decal = _in_one_piece(sheet, style, form, number, rng)
            if decal:
                found.append(replace(decal, class_name="text", wear=wear))
                break
    return found


def _forms(config: MarkingsConfig, sheet: Sheet, rng: np.random.Generator) -> list[Form]:
    """Return forms to try, the drawn one first, then smaller ones and other layouts."""
    settings = config.identifiers
    weights = settings.layouts.get(sheet.face, {"rows": 1.0})
    first = weighted_choice(rng, {name: weights.get(name, 0.0) for name in LAYOUTS})
    boxed = bool(rng.random() < settings.check_digit_box)
    cap = config.cap_mm.lo if sheet.clearance else between(rng, config.cap_mm)
    on_ribs = sheet.face != "door" and rng.random() < settings.rib_pitch
    steep = sheet.face == "no_door"  # letter strokes on its flanks are hardly visible
    pitch = sheet.half_wave_mm if (on_ribs or steep) and sheet.face != "roof" else 0.0
    made = [_form(first, cap, boxed, pitch, rng)]
    others = [name for name in LAYOUTS if name != first]
    if sheet.face == "roof":
        others.remove("column")
    for name in (first, *others):
        made.append(_form(name, config.cap_mm.lo, boxed, pitch if steep else 0.0, rng))
    made += [replace(form, pitch_mm=0.0) for form in made if form.spaced]
    tallest = tenth((sheet.size[1] - 2 * EDGE_MM) / _COLUMN_CAPS)
    return [
        replace(form, cap_mm=max(min(form.cap_mm, tallest), config.cap_mm.lo))
        if form.layout == "column"
        else form
        for form in made
    ]


def _form(
    layout: str, cap_mm: float, boxed: bool, pitch_mm: float, rng: np.random.Generator
) -> Form:
    type_place = weighted_choice(rng, _TYPE_PLACES[layout])
    upright = layout == "column"
    if upright:
        pitch_mm = float(rng.uniform(GLYPH_PITCH_CAPS - 0.1, GLYPH_PITCH_CAPS + 0.1)) * cap_mm
    elif pitch_mm < 0.8 * cap_mm:
        pitch_mm = 0.0
    elif type_place == "same line":
        type_place = "under serial"  # the line would be longer than most end walls
    return Form(
        layout=layout,
        type_place=type_place,
        cap_mm=cap_mm,
        boxed=boxed,
        owner_gap_mm=tenth(cap_mm * rng.uniform(0.5, 1.0)),
        check_gap_mm=tenth(cap_mm * rng.uniform(0.2, 0.5)),
        column_gap_mm=tenth(cap_mm * rng.uniform(0.4, 1.8)),
        pitch_mm=tenth(pitch_mm),
    )


_TYPE_PLACES = {
    "rows": {"under serial": 0.6, "under owner": 0.25, "same line": 0.15},
    "block": {"below": 1.0},
    "column": {"beside, top": 0.5, "beside, bottom": 0.25, "below": 0.25},
}
"""Probabilities of the places of the size-type code, by layout."""


def _written(style: Style, form: Form) -> tuple[Decal, Lettering]:
    lines = identifier_lines(style.identifier, form)
    parts = identifier_parts(style.identifier, form, style.font)
    return part_text(lines, parts, form.cap_mm, style, form.layout == "column")


def _in_one_piece(
    sheet: Sheet, style: Style, form: Form, number: int, rng: np.random.Generator
) -> Decal | None:
    """Place an identifier at the upper right or, if it is the second one, at the left."""
    if form.spaced:
        least = least_pitch_mm(style.identifier, form, style.font) + _LEAST_GAP_CAPS * form.cap_mm
        if form.pitch_mm < least:
            return None
        text, lettering = _written(style, form)
        center = _on_flats(sheet, lettering, number, rng)
        return placed(text, sheet, center) if center else None
    text, lettering = _written(style, form)
    center = None
    if form.layout == "column" and sheet.face == "no_door":
        center = _on_flat(sheet, lettering, rng)
    if not center:
        x = Range(0.86, 1.0) if number == 0 else Range(0.0, 0.12)
        x = Range(0.5, 1.0) if sheet.clearance else x
        size, boxes = lettering.size_mm, lettering.parts
        center = sheet.place(size, rng, x, Range(0.82, 1.0), boxes)
        center = center or sheet.place(size, rng, Range(0.0, 1.0), Range(0.3, 1.0), boxes)
    return placed(text, sheet, center) if center else None


def _across_bar(
    sheet: Sheet, styles: Sequence[Style], form: Form, rng: np.random.Generator
) -> Decal | None:
    """Place rows on a door, the owner code left of a locking bar and the serial number right of it.

    The first of `styles` that fits is taken.
    """
    assert sheet.clearance is not None
    if form.type_place == "same line":
        form = replace(form, type_place="under serial")
    bars = [(-np.inf, 0.0), *sheet.clearance.bars, (sheet.size[0], np.inf)]
    places = list(zip(bars, bars[1:], bars[2:], strict=False))[::-1]
    for style in styles:
        owner, number = row_widths(style.identifier, form, style.font)
        for (_, low), (x0, x1), (high, _) in places:
            left, right = between(rng, BAR_GAP_MM), between(rng, BAR_GAP_MM)
            start, end = x0 - left - owner, x1 + right + number
            if not (low < start and end < high and sheet.holds_lettering(start, end)):
                continue
            text, lettering = _written(style, replace(form, owner_gap_mm=left + x1 - x0 + right))
            width, height = lettering.size_mm
            x = x0 - left - lettering.parts[0].x1 + width / 2
            for _ in range(_TRIES):
                y = rng.uniform(0.6, 0.93) * sheet.size[1]
                center = (tenth(x), tenth(y - height / 2))
                if sheet.claim(center, lettering.size_mm, lettering.parts):
                    return placed(text, sheet, center)
    return None


def _on_flats(sheet: Sheet, text: Lettering, number: int, rng: np.random.Generator) -> Vec2 | None:
    """Place letters with a pitch of half a wave on the flats, high and near the right end.

    The second text of a wall is near the left end.
    """
    first = (text.glyphs[0].x0 + text.glyphs[0].x1) / 2
    flat, pitch_mm = sum(sheet.flats[0]) / 2, sheet.half_wave_mm
    least, most = EDGE_MM, sheet.size[0] - EDGE_MM - text.size_mm[0]
    low = math.ceil((least + first - flat) / pitch_mm)
    high = math.floor((most + first - flat) / pitch_mm)
    places = range(low, high + 1)[:: 1 if number else -1]
    room = sheet.size[1] - 2 * EDGE_MM - text.size_mm[1]
    for lowest, place in itertools.product((0.82, 0.3), places[:_FLATS]):
        x = flat + place * pitch_mm - first + text.size_mm[0] / 2
        y = EDGE_MM + text.size_mm[1] / 2 + room * rng.uniform(lowest, 1.0)
        if sheet.claim((tenth(x), tenth(y)), text.size_mm, text.parts):
            return tenth(x), tenth(y)
    return None


def _on_flat(sheet: Sheet, text: Lettering, rng: np.random.Generator) -> Vec2 | None:
    """Center the letters of the owner code on a free outer flat."""
    owner = text.parts[0]
    aside = text.size_mm[0] / 2 - (owner.x0 + owner.x1) / 2
    for x0, x1 in [sheet.flats[i] for i in rng.permutation(len(sheet.flats))]:
        y = sheet.size[1] - EDGE_MM - text.size_mm[1] / 2 - 1
        center = (tenth((x0 + x1) / 2 + aside), tenth(y))
        if sheet.claim(center, text.size_mm, text.parts):
            return center
    return None
