"""Sampling of a container's decals: brands, identifiers, plates, stickers and markers."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fastgen.classes import MARKER_CLASSES
from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import Brand, Font, brands, glyph_tiles, stickers
from fastgen.decals.iso6346 import Identifier, sample_identifier
from fastgen.decals.lettering import layout
from fastgen.decals.weights import split_entry, weight_lines
from fastgen.sampling.sheet import EDGE_MM, GAP_MM, Sheet, tenth
from fastgen.scene import REC_709, Color, Decal, Vec2
from fastgen.scene.container_kinds import KINDS
from fastgen.validation import Range

Streams = Callable[[str], np.random.Generator]
Flats = Mapping[str, Sequence[tuple[float, float]]]

_LIGHT: Color = (0.76, 0.76, 0.74)
_DARK: Color = (0.018, 0.018, 0.02)
_COLORED: tuple[Color, ...] = ((0.7, 0.45, 0.02), (0.45, 0.02, 0.02), (0.02, 0.08, 0.35))
_YELLOW: Color = (0.72, 0.47, 0.01)

_HIGH_CUBE_SIGNS = ("height_sign", "height_triangle")


@dataclass(frozen=True)
class _Style:
    """Properties that all texts of one container share."""

    font: Font
    albedo: Color
    brand: Brand
    identifier: Identifier


def sample_decals(
    config: MarkingsConfig,
    kind: str,
    sheets: Mapping[str, Vec2],
    paint_albedo: Color,
    streams: Streams,
    flats: Flats | None = None,
) -> tuple[Decal, ...]:
    """Sample all decals of one container.

    Args:
        config: Probabilities and ranges.
        kind: Container kind, a key of `KINDS`.
        sheets: Width and height of the sheet by face, mm.
        paint_albedo: Linear colour of the paint; it decides between light and dark lettering.
        streams: Function from the name of a property to its independent random generator.
        flats: Outer flats of the corrugation by face: intervals (x0, x1) of the sheet, mm.

    Returns:
        Decals in painting order.
    """
    faces = {name: Sheet(name, size) for name, size in sheets.items()}
    style = _style(config, kind, paint_albedo, streams)
    drawn: list[Decal] = []
    drawn += _height_marks(config, kind, faces, streams)
    for sheet in faces.values():
        drawn += _identifiers(config, sheet, style, streams, (flats or {}).get(sheet.face, ()))
    drawn += _weights(config, kind, faces["door"], style, streams)
    markers: list[Decal] = []
    for face in config.marker_faces:
        markers += _markers(config, faces[face], streams(f"markers.{face}"))
    for sheet in faces.values():
        drawn += _brand(config, sheet, style, streams(f"brand.{sheet.face}"))
        drawn += _stickers(config, kind, sheet, streams(f"stickers.{sheet.face}"))
    return (*drawn, *markers)


def _between(rng: np.random.Generator, values: Range) -> float:
    return tenth(values.draw(rng))


def _style(config: MarkingsConfig, kind: str, paint: Color, streams: Streams) -> _Style:
    _, fonts = glyph_tiles()
    names = config.fonts or tuple(sorted(fonts))
    rng = streams("lettering")
    font = fonts[str(rng.choice(names))]
    light = float(np.array(paint) @ REC_709) < 0.22
    albedo = _LIGHT if light else _DARK
    if rng.random() < config.colored_lettering:
        albedo = _COLORED[int(rng.integers(len(_COLORED)))] if not light else _YELLOW
    made = brands()
    brand = made[int(streams("brand").integers(len(made)))]
    identifier = sample_identifier(streams("identifier"), brand.owner_codes, KINDS[kind].size_type)
    return _Style(font, albedo, brand, identifier)


def _text(
    lines: tuple[str, ...], cap_mm: float, style: _Style, wear: float, vertical: bool = False
) -> Decal:
    """Return a text decal with its size and ink; its face and centre are not set yet."""
    size = layout(lines, style.font, cap_mm, vertical).size_mm
    return Decal(
        kind="text",
        class_name="",
        face="",
        center_mm=(0.0, 0.0),
        size_mm=size,
        lines=lines,
        font=style.font.name,
        vertical=vertical,
        cap_mm=cap_mm,
        albedo=style.albedo,
        wear=wear,
    )


def _placed(decal: Decal, sheet: Sheet, center: Vec2, class_name: str = "") -> Decal:
    return replace(decal, face=sheet.face, center_mm=center, class_name=class_name)


def _identifier_lines(identifier: Identifier, form: int) -> tuple[str, ...]:
    owner, serial, check = identifier.owner, identifier.serial, identifier.check
    if form == 0:
        return (f"{owner} {serial} {check}", identifier.size_type)
    if form == 1:
        return (owner, f"{serial} {check}", identifier.size_type)
    return (f"{owner} {serial[:3]}", f"{serial[3:]} {check}", identifier.size_type)


def _identifiers(
    config: MarkingsConfig,
    sheet: Sheet,
    style: _Style,
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
        cap = _between(rng, config.cap_mm)
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
        decal = _text(lines, cap, style, round(float(rng.uniform(*config.text_wear)), 3), upright)
        x = Range(0.99 if slim and upright else 0.86, 1.0) if number == 0 else Range(0.0, 0.12)
        center = None
        if upright and on_flat:
            center = _on_flat(sheet, decal.size_mm, flats, rng)
        center = center or sheet.place(decal.size_mm, rng, x, Range(0.82, 1.0))
        center = center or sheet.place(decal.size_mm, rng, Range(0.0, 1.0), Range(0.4, 1.0))
        if center:
            found.append(_placed(decal, sheet, center, "text"))
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


def _weights(
    config: MarkingsConfig, kind: str, door: Sheet, style: _Style, streams: Streams
) -> list[Decal]:
    rng = streams("weights")
    lines = weight_lines(kind, rng)
    wear = round(float(rng.uniform(*config.text_wear)), 3)
    # Beside a vertical identifier the panel only fits with two or three lines per entry.
    halves, thirds = (tuple(p for line in lines for p in split_entry(line, n)) for n in (2, 3))
    cap = _between(rng, config.weights_cap_mm)
    leaf = door.size[0] / 2 + GAP_MM
    least = config.weights_cap_mm.lo
    for rows, height in ((lines, cap), (halves, cap), (halves, least), (thirds, least)):
        decal = _text(rows, height, style, wear)
        room = door.size[0] - 2 * EDGE_MM - decal.size_mm[0]
        start = (leaf - EDGE_MM) / room if room > 0 else 1.0
        if start < 1.0:
            center = door.place(decal.size_mm, rng, Range(start, 1.0), Range(0.25, 0.75))
            if center:
                return [_placed(decal, door, center)]
    return []


def _brand(
    config: MarkingsConfig, sheet: Sheet, style: _Style, rng: np.random.Generator
) -> list[Decal]:
    """Sample brand and main text with the probabilities of Algorithm A1 (SeaFront paper)."""
    made = []
    small = sheet.face in ("door", "no_door")
    cap = _between(rng, config.brand_cap_mm) * (0.45 if small else 1.0)
    if rng.random() < config.brand.get(sheet.face, 0.0):
        word = _text((style.brand.wordmark,), tenth(cap), style, 0.1)
        emblem = tenth(1.9 * cap)
        size = (max(word.size_mm[0], emblem), word.size_mm[1] + emblem + tenth(0.3 * cap))
        center = sheet.place(size, rng, Range(0.15, 0.85), Range(0.2, 0.8))
        if center:
            top = center[1] + size[1] / 2
            mark = Decal(
                kind="emblem",
                class_name="",
                face=sheet.face,
                center_mm=(center[0], tenth(top - emblem / 2)),
                size_mm=(emblem, emblem),
                art=style.brand.emblem,
                albedo=style.albedo,
                wear=0.1,
            )
            low = tenth(center[1] - size[1] / 2 + word.size_mm[1] / 2)
            made += [mark, _placed(word, sheet, (center[0], low))]
    if rng.random() < config.main_text.get(sheet.face, 0.0):
        line = str(rng.choice(style.brand.main_texts))
        text = _text((line,), _between(rng, Range(70, 130 if small else 240)), style, 0.2)
        center = sheet.place(text.size_mm, rng, Range(0.0, 1.0), Range(0.0, 1.0))
        if center:
            made.append(_placed(text, sheet, center))
    return made


def _stickers(
    config: MarkingsConfig, kind: str, sheet: Sheet, rng: np.random.Generator
) -> list[Decal]:
    """Sample plates and stickers other than markers; they have no label."""
    if sheet.face == "roof":
        return []
    known = {n: s for n, s in stickers().items() if not s.where or sheet.face in s.where}
    if not kind.endswith("HC"):
        known = {n: s for n, s in known.items() if n not in _HIGH_CUBE_SIGNS}
    low, high = config.stickers_per_face
    wanted = [n for n, s in known.items() if s.always]
    free = sorted(set(known) - set(wanted))
    if free:
        wanted += [str(n) for n in rng.choice(free, size=int(rng.integers(low, high + 1)))]
    made = []
    for name in wanted:
        tilt = round(float(rng.normal(0, 1.5)), 2)
        size = known[name].size_mm
        grown = (size[0] * 1.06 + 10, size[1] * 1.06 + 10)
        y = Range(0.0, 0.35) if known[name].always else Range(0.0, 1.0)
        x = Range(0.0, 0.4) if known[name].always else Range(0.0, 1.0)
        center = sheet.place(grown, rng, x, y)
        if center:
            wear = round(float(rng.uniform(*config.sticker_wear)), 3)
            made.append(Decal("sticker", "", sheet.face, center, size, tilt, name, wear=wear))
    return made


def _height_marks(
    config: MarkingsConfig, kind: str, faces: Mapping[str, Sheet], streams: Streams
) -> list[Decal]:
    """Sample the striped bands at the upper corners of high cubes (ISO 6346, mandatory marks)."""
    rng = streams("height_marks")
    if not kind.endswith("HC") or rng.random() >= config.height_marks:
        return []
    made = []
    length = _between(rng, Range(300, 900))
    for face in ("front", "back", "no_door"):
        sheet = faces[face]
        band = (min(length, tenth(sheet.size[0] / 4)), 60.0)
        y = tenth(sheet.size[1] - EDGE_MM - band[1] / 2 - 1)
        for x in (EDGE_MM + band[0] / 2 + 1, sheet.size[0] - EDGE_MM - band[0] / 2 - 1):
            if sheet.claim((tenth(x), y), band):
                made.append(
                    Decal("sticker", "", face, (tenth(x), y), band, art="stripes", albedo=_YELLOW)
                )
    return made


def rhombus_offsets(count: int, width_mm: float, height_mm: float) -> list[Vec2]:
    """Return the marker centres of the two-row rhombus pattern (SeaFront paper, section 3.3.3).

    The paper lets i run from i_b = i_e - N to i_e = N / 2 + 1. It sets x_i = ceil(x + i w / 2);
    y_i is y for even i and y + h / 2 for odd i. The range has N + 1 values for N markers; this
    function skips the last. It follows the paper's text, not Algorithm A2, whose y_i ignores y.

    Args:
        count: Number of markers N.
        width_mm: Width w of a marker and its gap.
        height_mm: Height h of a marker and its gap.

    Returns:
        Offsets (x, y) from the pattern's anchor, mm.
    """
    last = count // 2 + 1
    return [
        (math.ceil(i * width_mm / 2), 0.0 if abs(i) % 2 == 0 else math.ceil(height_mm / 2))
        for i in range(last - count, last)
    ]


def _markers(config: MarkingsConfig, sheet: Sheet, rng: np.random.Generator) -> list[Decal]:
    """Sample the markers of a face; drop markers until the pattern fits."""
    low, high = config.markers_per_face
    count = int(rng.integers(low, high + 1))
    side = _between(rng, config.marker_side_mm)
    gap = _between(rng, config.marker_gap_mm)
    diagonal = tenth(side * math.sqrt(2))
    classes = rng.choice(MARKER_CLASSES, size=count)
    tilts = rng.uniform(*config.marker_tilt_deg, size=count)
    wears = rng.uniform(*config.marker_wear, size=count)
    while count > 0:
        # A square turned by t extends side / 2 * (cos t + sin t) toward its neighbour.
        tilt = math.radians(float(np.abs(tilts).max()))
        step = diagonal * (math.cos(tilt) + math.sin(tilt)) + math.sqrt(2) * gap
        offsets = np.array(rhombus_offsets(count, step, step))
        low_corner, high_corner = offsets.min(axis=0), offsets.max(axis=0)
        size = tuple(float(v) + diagonal * 1.01 for v in high_corner - low_corner)
        center = sheet.place((size[0], size[1]), rng, Range(0.0, 1.0), Range(0.0, 1.0))
        if center:
            shift = np.array(center) - (low_corner + high_corner) / 2
            return [
                Decal(
                    kind="marker",
                    class_name=str(classes[i]),
                    face=sheet.face,
                    center_mm=(tenth(x), tenth(y)),
                    size_mm=(diagonal, diagonal),
                    rotation_deg=round(float(tilts[i]), 2),
                    art=str(classes[i]),
                    wear=round(float(wears[i]), 3),
                )
                for i, (x, y) in enumerate(offsets + shift)
            ]
        count -= 1
    return []
