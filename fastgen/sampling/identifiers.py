"""Sampling of identifiers (ISO 6346) and of the weights panel on the door."""

from collections.abc import Sequence

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.iso6346 import Identifier
from fastgen.decals.weights import split_entry, weight_lines
from fastgen.sampling.lettering_style import Streams, Style, placed, text_decal
from fastgen.sampling.sheet import EDGE_MM, GAP_MM, Sheet, between, tenth
from fastgen.scene import Decal, Vec2
from fastgen.validation import Range


def _identifier_lines(identifier: Identifier, form: int) -> tuple[str, ...]:
    owner, serial, check = identifier.owner, identifier.serial, identifier.check
    if form == 0:
        return (f"{owner} {serial} {check}", identifier.size_type)
    if form == 1:
        return (owner, f"{serial} {check}", identifier.size_type)
    return (f"{owner} {serial[:3]}", f"{serial[3:]} {check}", identifier.size_type)


def sample_identifiers(
    config: MarkingsConfig,
    sheet: Sheet,
    style: Style,
    streams: Streams,
    flats: Sequence[tuple[float, float]],
) -> list[Decal]:
    """Sample one identifier at the upper right (ISO 6346, section 7), on long sides maybe two.

    The second one is at the left end. Columns on a corrugated end wall are centred on outer flats.
    """
    rng = streams(f"identifier.{sheet.face}")
    long_side = sheet.face in ("front", "back")
    count = 1 + int(long_side and rng.random() < config.second_identifier)
    found = []
    for number in range(count):
        upright = sheet.face != "roof" and rng.random() < config.vertical
        on_flat = sheet.face == "no_door" and bool(flats)
        slim = on_flat or sheet.face == "door"
        cap = between(rng, config.cap_mm)
        upright = upright or (on_flat and rng.random() < 0.6)
        if upright:
            tallest = tenth((sheet.size[1] - 2 * EDGE_MM) / 15.5)  # 11 letters are 14.5 caps high
            cap = config.cap_mm.lo if slim else max(min(cap, tallest), config.cap_mm.lo)
        i = style.identifier
        lines = _identifier_lines(i, int(rng.integers(3)))
        if upright:
            # An outer flat, or a door leaf beside the weights, has room for one column only. The
            # size-type code then follows below.
            column = f"{i.owner}{i.serial}{i.check}"
            lines = (f"{column} {i.size_type}",) if slim else (column, i.size_type)
        wear = round(float(rng.uniform(*config.text_wear)), 3)
        decal = text_decal(lines, cap, style, wear, upright)
        x = Range(0.99 if slim and upright else 0.86, 1.0) if number == 0 else Range(0.0, 0.12)
        center = None
        if upright and on_flat:
            center = _on_flat(sheet, decal.size_mm, flats, rng)
        center = center or sheet.place(decal.size_mm, rng, x, Range(0.82, 1.0))
        center = center or sheet.place(decal.size_mm, rng, Range(0.0, 1.0), Range(0.4, 1.0))
        if center:
            found.append(placed(decal, sheet, center, "text"))
    return found


def _on_flat(
    sheet: Sheet, size: Vec2, flats: Sequence[tuple[float, float]], rng: np.random.Generator
) -> Vec2 | None:
    for x0, x1 in [flats[i] for i in rng.permutation(len(flats))]:
        y = sheet.size[1] - EDGE_MM - size[1] / 2 - 1
        center = (tenth((x0 + x1) / 2), tenth(y))
        if sheet.claim(center, size):
            return center
    return None


def sample_weights(
    config: MarkingsConfig, kind: str, door: Sheet, style: Style, streams: Streams
) -> list[Decal]:
    rng = streams("weights")
    lines = weight_lines(kind, rng)
    wear = round(float(rng.uniform(*config.text_wear)), 3)
    # Beside a vertical identifier the panel only fits with two or three lines per entry.
    halves, thirds = (tuple(p for line in lines for p in split_entry(line, n)) for n in (2, 3))
    cap = between(rng, config.weights_cap_mm)
    leaf = door.size[0] / 2 + GAP_MM
    least = config.weights_cap_mm.lo
    for rows, height in ((lines, cap), (halves, cap), (halves, least), (thirds, least)):
        decal = text_decal(rows, height, style, wear)
        room = door.size[0] - 2 * EDGE_MM - decal.size_mm[0]
        start = (leaf - EDGE_MM) / room if room > 0 else 1.0
        if start < 1.0:
            center = door.place(decal.size_mm, rng, Range(start, 1.0), Range(0.25, 0.75))
            if center:
                return [placed(decal, door, center)]
    return []
