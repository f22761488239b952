"""Sampling of older identifiers that were painted over; they have no label."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.iso6346 import Identifier, sample_identifier
from fastgen.sampling.colors import fresh_paint, mixed
from fastgen.sampling.lettering_style import Style
from fastgen.sampling.sheet import GAP_MM, Sheet, between, has_slots, tenth
from fastgen.sampling.streams import Streams
from fastgen.scene import Color, Decal, Vec2
from fastgen.validation import Range

_BESIDE = 0.4
"""Probability that the present identifier was written beside the old one instead of over it."""

_SHOWS = 0.6
"""Probability that the old letters show through the paint."""

_MARGIN_MM = Range(25, 70)
"""Distance that the fresh paint reaches beyond the old letters."""

_ROLLER_MM = 230.0
"""Width of a paint roller. A rolled patch is a row of strips with uneven ends."""

_BORDER_MM = 5.0
"""Least distance of fresh paint from the border of a sheet."""


def sample_painted_over(
    config: MarkingsConfig,
    faces: Mapping[str, Sheet],
    style: Style,
    paint_albedo: Color,
    decals: Sequence[Decal],
    streams: Streams,
) -> list[Decal]:
    """Sample an older identifier of a container under fresh paint, at each present identifier.

    Args:
        config: Probabilities; `identifiers.painted_over` decides.
        faces: Sheets by face, after all other decals have been placed.
        style: Lettering of the container.
        paint_albedo: Linear colour of the paint.
        decals: All other decals of the container.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Decals to paint before all others. They have no label.
    """
    rng = streams("painted_over")
    if rng.random() >= config.identifiers.painted_over:
        return []
    old = sample_identifier(rng, config.identifiers.owner_codes, style.identifier.size_type)
    fresh = fresh_paint(paint_albedo, rng)
    shown = float(rng.uniform(0.05, 0.25)) if rng.random() < _SHOWS else 0.0
    ink = mixed(fresh, style.albedo, shown)
    rolled = bool(rng.random() < 0.5)
    made: list[Decal] = []
    for present in decals:
        if not any(part.role == "owner" for part in present.parts):
            continue
        here = [each for each in (*decals, *made) if each.face == present.face]
        letters = _respelled(present, old, ink)
        margin = between(rng, _MARGIN_MM)
        beside = rng.random() < _BESIDE
        sheet = faces[present.face]
        center = _beside(sheet, present, letters, margin, rng) if beside else None
        letters = replace(letters, center_mm=center or _shifted(sheet, letters, margin, rng))
        patch = _patch(sheet, letters, margin, fresh, rng)
        added = [*(_strips(patch, rng) if rolled else [patch]), *([letters] if shown else [])]
        if has_slots(added, here):
            made += added
    return made


def _respelled(present: Decal, old: Identifier, ink: Color) -> Decal:
    """Return an unlabelled copy of an identifier with the letters of another one."""
    spelled = {
        "owner": old.owner,
        "serial": old.serial,
        "check": old.check,
        "type": old.size_type,
    }
    parts = tuple(replace(part, text=spelled[part.role]) for part in present.parts)
    letters = iter("".join(part.text for part in parts))
    lines = tuple(
        "".join(char if char == " " else next(letters) for char in line) for line in present.lines
    )
    decal = replace(
        present, class_name="", lines=lines, parts=parts, albedo=ink, wear=max(present.wear, 0.3)
    )
    return replace(decal, size_mm=decal.lettering.size_mm)


def _shifted(sheet: Sheet, letters: Decal, margin_mm: float, rng: np.random.Generator) -> Vec2:
    """Return a centre less than a cap height from the present one, with room for the margin."""
    angle, distance = rng.uniform(0, 2 * math.pi), rng.uniform(0.2, 0.8) * letters.cap_mm
    shift = distance * np.array([math.cos(angle), math.sin(angle)])
    least = np.array(letters.size_mm) / 2 + margin_mm + _BORDER_MM
    x, y = np.clip(shift + letters.center_mm, least, sheet.size - least)
    return tenth(x), tenth(y)


def _beside(
    sheet: Sheet, present: Decal, letters: Decal, margin_mm: float, rng: np.random.Generator
) -> Vec2 | None:
    """Return a free place left of a column or below rows, None if there is none."""
    axis = 0 if present.vertical else 1
    gap = GAP_MM + 1 + margin_mm + float(rng.uniform(0, 1.5)) * present.cap_mm
    center = list(present.center_mm)
    center[axis] -= present.size_mm[axis] / 2 + gap + letters.size_mm[axis] / 2
    width, height = (side + 2 * margin_mm for side in letters.size_mm)
    x, y = map(tenth, center)
    return (x, y) if sheet.claim((x, y), (width, height)) else None


def _patch(
    sheet: Sheet, letters: Decal, margin_mm: float, fresh: Color, rng: np.random.Generator
) -> Decal:
    """Return a rectangle of fresh paint over old letters, within the sheet."""
    center, size = [], []
    for middle, side, whole in zip(letters.center_mm, letters.size_mm, sheet.size, strict=True):
        low = max(middle - side / 2 - margin_mm, _BORDER_MM)
        high = min(middle + side / 2 + margin_mm, whole - _BORDER_MM)
        center.append(tenth((low + high) / 2))
        size.append(tenth(high - low))
    return Decal(
        kind="sticker",
        class_name="",
        face=sheet.face,
        center_mm=(center[0], center[1]),
        size_mm=(size[0], size[1]),
        art="patch",
        albedo=fresh,
        wear=round(float(rng.uniform(0.0, 0.25)), 3),
    )


def _strips(patch: Decal, rng: np.random.Generator) -> Iterator[Decal]:
    """Yield the strips of a roller along the longer side of a patch, with uneven ends."""
    along = int(patch.size_mm[1] > patch.size_mm[0])
    count = math.ceil(patch.size_mm[1 - along] / _ROLLER_MM)
    width = patch.size_mm[1 - along] / count
    for i in range(count):
        starts, ends = rng.uniform(0, 22, 2)
        center, size = list(patch.center_mm), list(patch.size_mm)
        center[along] += (starts - ends) / 2
        size[along] -= starts + ends
        center[1 - along] += (i + 0.5) * width - patch.size_mm[1 - along] / 2
        # strips overlap a little
        size[1 - along] = width + 2
        x, y = map(tenth, center)
        yield replace(patch, center_mm=(x, y), size_mm=(tenth(size[0]), tenth(size[1])))
