"""Sampling of plates, signs and stickers other than markers.

They have no label unless the configuration gives them one.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import Sticker, stickers
from fastgen.sampling.sheet import Sheet, between
from fastgen.scene import Color, Decal
from fastgen.validation import Range

_OVERPAINT = 0.6
"""Albedo of fresh paint relative to the faded paint around it."""


def stickers_of(config: MarkingsConfig, kind: str, rng: np.random.Generator) -> list[Sticker]:
    """Return the stickers that one container may carry.

    Args:
        config: Weights of stickers, and new ones.
        kind: Container kind, a key of `KINDS`.
        rng: Random generator that picks one sticker of each group.
    """
    known = [s for s in _all_stickers(config) if not s.kinds or kind in s.kinds]
    groups: dict[str, list[Sticker]] = {}
    for each in known:
        if each.group:
            groups.setdefault(each.group, []).append(each)
    picked = [group[int(rng.integers(len(group)))] for group in groups.values()]
    return [s for s in known if not s.group] + picked


def _all_stickers(config: MarkingsConfig) -> list[Sticker]:
    """Return the stickers of fastgen with the configuration's weights, then its own stickers."""
    factors = config.sticker_weights
    found = [s for _, s in sorted(stickers().items()) if factors.get(s.name, 1.0) > 0]
    if factors:
        scaled = ((s, factors.get(s.name, 1.0)) for s in found)
        found = [replace(s, weight=f * s.weight, share=min(f * s.share, 1.0)) for s, f in scaled]
    for name, own in config.stickers.items():
        sticker = Sticker(
            name=name,
            size_mm=own.size_mm,
            where=own.faces,
            always=own.always,
            weight=own.weight,
            share=own.share,
            kinds=own.kinds,
            place=(*own.across, *own.up),
            art=f"sticker/{name}",
        )
        found.append(sticker)
    return found


def sample_stickers(
    config: MarkingsConfig,
    known: list[Sticker],
    sheet: Sheet,
    inks: Mapping[str, Color],
    rng: np.random.Generator,
) -> list[Decal]:
    """Sample the stickers of one face.

    Args:
        config: Number and wear of stickers.
        known: Stickers of the container, see `stickers_of`.
        sheet: Sheet of the face.
        inks: Colours of the container's lettering and paint, the latter as 'overpaint'.
        rng: Random generator of the face's stickers.
    """
    here = [sticker for sticker in known if sheet.face in sticker.where]
    if not here:
        return []
    luck = rng.random(len(here))
    wanted = [s for s, drawn in zip(here, luck, strict=True) if s.always or drawn < s.share]
    weights = np.array([0.0 if s.always else s.weight for s in here])
    low, high = config.stickers_per_face
    count = int(rng.integers(low, high + 1))
    if weights.any():
        chosen = rng.choice(len(here), size=count, p=weights / weights.sum())
        wanted += [here[int(i)] for i in chosen]
    made = [_placed(config, sticker, sheet, inks, rng) for sticker in wanted]
    return [decal for decal in made if decal is not None]


def _placed(
    config: MarkingsConfig,
    sticker: Sticker,
    sheet: Sheet,
    inks: Mapping[str, Color],
    rng: np.random.Generator,
) -> Decal | None:
    """Return a sticker at a free place of a sheet, None if there is none."""
    tilt_deg = round(float(rng.normal(0, 1.5)), 2)
    width, height = sticker.size_mm
    left, right, low, high = sticker.place
    center = sheet.place(
        (width * 1.06 + 10, height * 1.06 + 10), rng, Range(left, right), Range(low, high)
    )
    if center is None:
        return None
    wear = round(float(rng.uniform(*config.sticker_wear)), 3)
    size = (width, height)
    class_name = sticker.name if sticker.name in config.labelled_stickers else ""
    art = sticker.art or sticker.name
    decal = Decal("sticker", class_name, sheet.face, center, size, tilt_deg, art, wear=wear)
    if sticker.ink == "art":
        return decal
    red, green, blue = inks[sticker.ink]
    tone = _OVERPAINT if sticker.ink == "overpaint" else 1.0
    albedo = (tone * red, tone * green, tone * blue)
    return replace(decal, kind="emblem", albedo=albedo)


def sample_patches(
    number: tuple[int, int], sheet: Sheet, paint: Color, rng: np.random.Generator
) -> list[Decal]:
    """Sample the repainted rectangles of one face, beside everything that is already on it.

    Args:
        number: Least and greatest number of rectangles.
        sheet: Sheet of the face.
        paint: Linear albedo of the paint.
        rng: Random generator of the face's patches.
    """
    anywhere = Range(0.0, 1.0)
    made = []
    for _ in range(int(rng.integers(number[0], number[1] + 1))):
        size = (between(rng, Range(200, 900)), between(rng, Range(200, 700)))
        # The new paint is darker or lighter, and not bleached.
        tone, grey = rng.uniform(0.75, 1.15), rng.uniform(0.0, 0.1)
        wear = round(float(rng.uniform(0.0, 0.3)), 3)
        center = sheet.place(size, rng, anywhere, anywhere)
        if center is not None:
            red, green, blue = (
                min(float(tone * (1 - grey) * c + grey * np.mean(paint)), 1.0) for c in paint
            )
            albedo = (red, green, blue)
            made.append(
                Decal(
                    "sticker", "", sheet.face, center, size, art="patch", albedo=albedo, wear=wear
                )
            )
    return made
