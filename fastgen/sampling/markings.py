"""Sampling of a container's decals. Brands, plates and stickers are sampled here."""

from collections.abc import Mapping, Sequence

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import stickers
from fastgen.sampling.identifiers import sample_identifiers, sample_weights
from fastgen.sampling.lettering_style import (
    YELLOW,
    Streams,
    Style,
    placed,
    sample_style,
    text_decal,
)
from fastgen.sampling.markers import sample_markers
from fastgen.sampling.sheet import EDGE_MM, Sheet, between, tenth
from fastgen.scene import Color, Decal, Vec2
from fastgen.validation import Range

Flats = Mapping[str, Sequence[tuple[float, float]]]

_HIGH_CUBE_SIGNS = ("height_sign", "height_triangle")


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
    style = sample_style(config, kind, paint_albedo, streams)
    drawn: list[Decal] = []
    drawn += _height_marks(config, kind, faces, streams)
    for sheet in faces.values():
        outer_flats = (flats or {}).get(sheet.face, ())
        drawn += sample_identifiers(config, sheet, style, streams, outer_flats)
    drawn += sample_weights(config, kind, faces["door"], style, streams)
    markers: list[Decal] = []
    for face in config.marker_faces:
        markers += sample_markers(config, faces[face], streams)
    for sheet in faces.values():
        drawn += _brand(config, sheet, style, streams(f"brand.{sheet.face}"))
        drawn += _stickers(config, kind, sheet, streams(f"stickers.{sheet.face}"))
    return (*drawn, *markers)


def _brand(
    config: MarkingsConfig, sheet: Sheet, style: Style, rng: np.random.Generator
) -> list[Decal]:
    """Sample brand and main text with the probabilities of Algorithm A1 (SeaFront paper)."""
    made = []
    small = sheet.face in ("door", "no_door")
    cap = between(rng, config.brand_cap_mm) * (0.45 if small else 1.0)
    if rng.random() < config.brand.get(sheet.face, 0.0):
        word = text_decal((style.brand.wordmark,), tenth(cap), style, 0.1)
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
            made += [mark, placed(word, sheet, (center[0], low))]
    if rng.random() < config.main_text.get(sheet.face, 0.0):
        line = str(rng.choice(style.brand.main_texts))
        text = text_decal((line,), between(rng, Range(70, 130 if small else 240)), style, 0.2)
        center = sheet.place(text.size_mm, rng, Range(0.0, 1.0), Range(0.0, 1.0))
        if center:
            made.append(placed(text, sheet, center))
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
    length = between(rng, Range(300, 900))
    for face in ("front", "back", "no_door"):
        sheet = faces[face]
        band = (min(length, tenth(sheet.size[0] / 4)), 60.0)
        y = tenth(sheet.size[1] - EDGE_MM - band[1] / 2 - 1)
        for x in (EDGE_MM + band[0] / 2 + 1, sheet.size[0] - EDGE_MM - band[0] / 2 - 1):
            if sheet.claim((tenth(x), y), band):
                made.append(
                    Decal("sticker", "", face, (tenth(x), y), band, art="stripes", albedo=YELLOW)
                )
    return made
