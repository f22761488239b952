"""Sampling of holders, rivets and orange panels of markers, and of traces of removed markers."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import un_numbers
from fastgen.decals.glyphs import glyph_tiles
from fastgen.decals.lettering import layout
from fastgen.sampling.sheet import GAP_MM, Sheet, between, tenth
from fastgen.sampling.streams import Streams, one_of
from fastgen.scene import Color, Decal, Vec2
from fastgen.validation import Range

_HOLDER_MM = Range(7, 18)
"""Width of a holder's frame around its marker."""

_PANELS: tuple[tuple[str, Vec2, float], ...] = (
    ("un_panel", (400.0, 300.0), 95.0),  # two rows of digits
    ("un_panel_small", (300.0, 120.0), 66.0),  # one row
)
"""Artwork, size and height of the digits: ADR 5.3.2.2.1 and IMDG Code 5.3.2.1.3."""

_INK: Color = (0.01, 0.01, 0.01)
_FONT = "roboto-condensed"

_REMOVED_ART = ("overpaint_1", "overpaint_2", "placard_residue")


def sample_fittings(
    config: MarkingsConfig,
    sheet: Sheet,
    markers: Sequence[Decal],
    streams: Streams,
) -> tuple[list[Decal], list[Decal]]:
    """Sample holders, rivets and an orange panel for the markers of a face.

    Args:
        config: Probabilities.
        sheet: Sheet of the face with its markers.
        markers: Markers of the face.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Decals to paint below the markers, and decals to paint above them. They have no label.
    """
    rng = streams(f"marker_fittings.{sheet.face}")
    with_holder = rng.random() < config.marker_holder
    with_rivets = rng.random() < config.marker_rivets
    with_panel = rng.random() < config.marker_un_panel
    frame_mm = min(between(rng, _HOLDER_MM), _frame_limit_mm(markers))
    wear = round(float(rng.uniform(*config.sticker_wear)), 3)
    below: list[Decal] = []
    above: list[Decal] = []
    for marker in markers:
        metal = replace(marker, kind="sticker", class_name="", wear=wear, fade=0.0, torn=(0.0,) * 4)
        if with_holder and frame_mm >= _HOLDER_MM.lo:
            side = tenth(marker.size_mm[0] + 2 * math.sqrt(2) * frame_mm)
            below.append(replace(metal, art="marker_holder", size_mm=(side, side)))
        elif with_rivets:
            above.append(replace(metal, art="marker_rivets"))
    if with_panel and markers:
        below += _panel(config, sheet, markers, wear, rng)
    return below, above


def _frame_limit_mm(markers: Sequence[Decal]) -> float:
    """Return the widest frame that does not reach half-way to another marker."""
    side = markers[0].size_mm[0] / math.sqrt(2) if markers else 0.0
    centers = [marker.center_mm for marker in markers]
    turns = [abs(math.radians(marker.rotation_deg)) for marker in markers]
    widest = side * (math.cos(max(turns, default=0)) + math.sin(max(turns, default=0)))
    apart = [math.dist(a, b) for i, a in enumerate(centers) for b in centers[:i]]
    return (min(apart) - widest) / 2 if apart else _HOLDER_MM.hi


def _panel_numbers(config: MarkingsConfig, class_name: str) -> tuple[str, tuple[str, ...]]:
    """Return the hazard number and the UN numbers of a marker; none for some of a configuration."""
    own = config.markers.get(class_name)
    if own is not None and own.un_numbers:
        return own.hazard_number, own.un_numbers
    return un_numbers().get(class_name, ("", ()))


def _panel(
    config: MarkingsConfig,
    sheet: Sheet,
    markers: Sequence[Decal],
    wear: float,
    rng: np.random.Generator,
) -> list[Decal]:
    """Return an orange panel and its digits beside the markers, or nothing without room."""
    art, size, cap_mm = _PANELS[int(rng.integers(len(_PANELS)))]
    marker = markers[int(rng.integers(len(markers)))]
    hazard, numbers = _panel_numbers(config, marker.class_name)
    if not numbers:
        return []
    number = one_of(rng, numbers)
    reach = np.array(marker.size_mm) / 2
    low = np.array([m.center_mm for m in markers]).min(axis=0) - reach
    high = np.array([m.center_mm for m in markers]).max(axis=0) + reach
    gap = GAP_MM + 20
    beside = np.array(size) / 2 + gap
    middle = (low + high) / 2
    for x, y in (
        *((high[0] + beside[0], middle[1]), (low[0] - beside[0], middle[1])),
        *((middle[0], low[1] - beside[1]), (middle[0], high[1] + beside[1])),
    ):
        center = (tenth(x), tenth(y))
        if sheet.claim(center, size):
            break
    else:
        return []
    plate = Decal("sticker", "", sheet.face, center, size, art=art, wear=wear)
    rows = {"un_panel": ((hazard, 0.25), (number, -0.25)), "un_panel_small": ((number, 0.0),)}
    digits = [
        _digits(text, cap_mm, sheet, (center[0], tenth(center[1] + share * size[1])))
        for text, share in rows[art]
        if text
    ]
    return [plate, *digits]


def _digits(text: str, cap_mm: float, sheet: Sheet, center: Vec2) -> Decal:
    """Return the black digits of an orange panel."""
    size = layout((text,), glyph_tiles()[1][_FONT], cap_mm, False).size_mm
    return Decal(
        kind="text",
        class_name="",
        face=sheet.face,
        center_mm=center,
        size_mm=size,
        lines=(text,),
        font=_FONT,
        cap_mm=cap_mm,
        albedo=_INK,
    )


def sample_removed_markers(
    config: MarkingsConfig, sheet: Sheet, paint_albedo: Color, streams: Streams
) -> list[Decal]:
    """Sample what removed markers leave on a face: fresh dark paint, or residue of glue and paper.

    Args:
        config: Number of removed markers and size of markers.
        sheet: Sheet of the face.
        paint_albedo: Linear colour of the paint.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Decals without a label.
    """
    rng = streams(f"removed_markers.{sheet.face}")
    low, high = config.removed_markers
    made = []
    for _ in range(int(rng.integers(low, high + 1))):
        art = _REMOVED_ART[int(rng.integers(len(_REMOVED_ART)))]
        painted = art.startswith("overpaint")
        diagonal = between(rng, config.marker_side_mm) * math.sqrt(2)
        # Fresh paint is put on with a margin.
        size = tenth(diagonal * (rng.uniform(1.05, 1.35) if painted else rng.uniform(0.95, 1.05)))
        center = sheet.place((size, size), rng, Range(0.0, 1.0), Range(0.0, 1.0))
        tone, tilt = rng.uniform(0.35, 0.75), rng.normal(0, 3)
        if center is None:
            continue
        red, green, blue = (round(float(tone * part), 4) for part in paint_albedo)
        made.append(
            Decal(
                kind="emblem" if painted else "sticker",
                class_name="",
                face=sheet.face,
                center_mm=center,
                size_mm=(size, size),
                rotation_deg=round(float(tilt), 2),
                art=art,
                albedo=(red, green, blue),
            )
        )
    return made
