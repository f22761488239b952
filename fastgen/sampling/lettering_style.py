"""Sampling of what all texts of one container share, and text decals in that style."""

from dataclasses import dataclass, replace

import numpy as np

from fastgen.config.identifiers import IdentifierConfig
from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import Brand, brands
from fastgen.decals.glyphs import Font, font_named
from fastgen.decals.iso6346 import Identifier, sample_identifier
from fastgen.decals.lettering import Lettering, TextPart, layout
from fastgen.sampling.sheet import Sheet
from fastgen.sampling.streams import Streams, one_of, weighted_choice
from fastgen.scene import REC_709, Color, Decal, Vec2
from fastgen.scene.container_kinds import SIZE_TYPES
from fastgen.validation import Range

BAR_GAP_MM = Range(15, 60)
"""Distance of letters from a locking bar between them."""

_LIGHT: Color = (0.76, 0.76, 0.74)
_DARK: Color = (0.018, 0.018, 0.02)
_COLORED: tuple[Color, ...] = ((0.7, 0.45, 0.02), (0.45, 0.02, 0.02), (0.02, 0.08, 0.35))
YELLOW: Color = (0.72, 0.47, 0.01)


@dataclass(frozen=True)
class Style:
    """Properties that all texts of one container share."""

    font: Font
    albedo: Color
    brand: Brand
    identifier: Identifier


def sample_style(config: MarkingsConfig, kind: str, paint: Color, streams: Streams) -> Style:
    """Sample font, colour, brand and identifier of a container."""
    rng = streams("lettering")
    names, _ = config.drawn_fonts()
    font = font_named(one_of(rng, names))
    light = float(np.array(paint) @ REC_709) < 0.22
    albedo = _LIGHT if light else _DARK
    if rng.random() < config.colored_lettering:
        albedo = _COLORED[int(rng.integers(len(_COLORED)))] if not light else YELLOW
    brand = _brand(config, streams("brand"))
    identifier = _identifier(config.identifiers, kind, brand, streams)
    return Style(font, albedo, brand, identifier)


def _brand(config: MarkingsConfig, rng: np.random.Generator) -> Brand:
    """Sample a brand of fastgen or of the configuration."""
    bundled = brands()
    if not config.brands and config.bundled_brand_weight > 0:
        return bundled[int(rng.integers(len(bundled)))]
    own = [
        Brand(
            name,
            f"emblem/{name}",
            each.owner_codes,
            each.wordmark,
            each.main_texts or (each.wordmark,),
            each.ink,
        )
        for name, each in config.brands.items()
    ]
    weights = [config.bundled_brand_weight] * len(bundled)
    weights += [each.weight for each in config.brands.values()]
    return weighted_choice(rng, dict(zip((*bundled, *own), weights, strict=True)))


def _identifier(config: IdentifierConfig, kind: str, brand: Brand, streams: Streams) -> Identifier:
    size_type = weighted_choice(streams("size_type"), SIZE_TYPES[kind])
    owners = config.owner_codes
    if not owners and streams("owner").random() < config.brand_codes:
        owners = brand.owner_codes
    return sample_identifier(streams("identifier"), owners, size_type)


def in_any_font(config: MarkingsConfig, style: Style, rng: np.random.Generator) -> list[Style]:
    """Return the style, then the same with other fonts, for places where only a narrow one fits."""
    names, condensed = config.drawn_fonts()
    others = (*rng.permutation(names), *condensed)
    return [style, *(replace(style, font=font_named(str(name))) for name in others)]


def text_decal(lines: tuple[str, ...], cap_mm: float, style: Style, wear: float) -> Decal:
    """Return a text decal with its size and ink; its face and centre are not set yet."""
    return replace(part_text(lines, (), cap_mm, style, False)[0], wear=wear)


def part_text(
    lines: tuple[str, ...],
    parts: tuple[TextPart, ...],
    cap_mm: float,
    style: Style,
    vertical: bool,
) -> tuple[Decal, Lettering]:
    """Return a text decal whose parts have places of their own, and its layout.

    Args:
        lines: The text in reading order.
        parts: Its parts, or none for left-aligned lines.
        cap_mm: Height of the capitals.
        style: Font and ink.
        vertical: Whether the letters are below one another.
    """
    lettering = layout(lines, style.font, cap_mm, vertical, parts)
    decal = Decal(
        kind="text",
        class_name="",
        face="",
        center_mm=(0.0, 0.0),
        size_mm=lettering.size_mm,
        lines=lines,
        parts=parts,
        font=style.font.name,
        vertical=vertical,
        cap_mm=cap_mm,
        albedo=style.albedo,
    )
    return decal, lettering


def placed(
    decal: Decal, sheet: Sheet, center: Vec2, class_name: str = "", wear: float | None = None
) -> Decal:
    """Return a decal at a place of a sheet."""
    worn = decal.wear if wear is None else wear
    return replace(decal, face=sheet.face, center_mm=center, class_name=class_name, wear=worn)
