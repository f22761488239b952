"""Sampling of a container's decals. Brands and height marks are sampled here."""

from collections.abc import Mapping

import numpy as np

from fastgen.classes import MARK_CLASSES
from fastgen.config.markings import MarkingsConfig
from fastgen.sampling.identifiers import sample_identifiers
from fastgen.sampling.lettering_style import (
    YELLOW,
    Style,
    placed,
    sample_style,
    text_decal,
)
from fastgen.sampling.marker_fittings import sample_fittings, sample_removed_markers
from fastgen.sampling.markers import sample_markers
from fastgen.sampling.marks import sample_marks
from fastgen.sampling.painted_over import sample_painted_over
from fastgen.sampling.sheet import EDGE_MM, Sheet, between, tenth
from fastgen.sampling.stickers import sample_patches, sample_stickers, stickers_of
from fastgen.sampling.streams import Streams, one_of
from fastgen.sampling.weights_panel import sample_weights
from fastgen.scene import Color, Decal
from fastgen.validation import Range


def sample_decals(
    config: MarkingsConfig,
    kind: str,
    faces: Mapping[str, Sheet],
    paint_albedo: Color,
    streams: Streams,
) -> tuple[Decal, ...]:
    """Sample all decals of one container.

    Args:
        config: Probabilities and ranges.
        kind: Container kind, a key of `KINDS`.
        faces: Sheets without decals by face.
        paint_albedo: Linear colour of the paint; it decides between light and dark lettering.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Decals in painting order.
    """
    style = sample_style(config, kind, paint_albedo, streams)
    drawn: list[Decal] = []
    drawn += _height_marks(config, kind, faces, streams)
    for sheet in faces.values():
        drawn += sample_identifiers(config, sheet, style, streams)
    drawn += sample_weights(config, kind, faces["door"], style, streams)
    labelled: list[Decal] = []
    held: list[Decal] = []
    if streams("marked").random() < config.marked_containers:
        for face in config.marker_faces:
            labelled += sample_markers(config, faces[face], streams)
    labelled += sample_marks(config, faces, streams)
    for face in config.marker_faces:
        sheet = faces[face]
        markers = [d for d in labelled if d.face == face and d.class_name not in MARK_CLASSES]
        below, above = sample_fittings(config, sheet, markers, streams)
        drawn += sample_removed_markers(config, sheet, paint_albedo, streams) + below
        held += above
    known = stickers_of(config, kind, streams("stickers"))
    inks = {"lettering": style.albedo, "overpaint": paint_albedo}
    for sheet in faces.values():
        drawn += _brand(config, sheet, style, streams(f"brand.{sheet.face}"))
        drawn += sample_stickers(config, known, sheet, inks, streams(f"stickers.{sheet.face}"))
        rng = streams(f"patches.{sheet.face}")
        drawn += sample_patches(config.patches_per_face, sheet, paint_albedo, rng)
    decals = [*drawn, *labelled, *held]
    # last, so that nothing makes room for it
    older = sample_painted_over(config, faces, style, paint_albedo, decals, streams)
    return (*older, *decals)


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
                kind="emblem" if style.brand.ink == "lettering" else "sticker",
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
        line = one_of(rng, style.brand.main_texts)
        text = text_decal((line,), between(rng, Range(70, 130 if small else 240)), style, 0.2)
        center = sheet.place(text.size_mm, rng, Range(0.0, 1.0), Range(0.0, 1.0))
        if center:
            made.append(placed(text, sheet, center))
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
