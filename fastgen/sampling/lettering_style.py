"""Sampling of what all texts of one container share, and text decals in that style."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import Brand, Font, brands, glyph_tiles
from fastgen.decals.iso6346 import Identifier, sample_identifier
from fastgen.decals.lettering import layout
from fastgen.sampling.sheet import Sheet
from fastgen.scene import REC_709, Color, Decal, Vec2
from fastgen.scene.container_kinds import KINDS

Streams = Callable[[str], np.random.Generator]
"""Function from the name of a property to its independent random generator."""

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
    _, fonts = glyph_tiles()
    names = config.fonts or tuple(sorted(fonts))
    rng = streams("lettering")
    font = fonts[str(rng.choice(names))]
    light = float(np.array(paint) @ REC_709) < 0.22
    albedo = _LIGHT if light else _DARK
    if rng.random() < config.colored_lettering:
        albedo = _COLORED[int(rng.integers(len(_COLORED)))] if not light else YELLOW
    made = brands()
    brand = made[int(streams("brand").integers(len(made)))]
    identifier = sample_identifier(streams("identifier"), brand.owner_codes, KINDS[kind].size_type)
    return Style(font, albedo, brand, identifier)


def text_decal(
    lines: tuple[str, ...], cap_mm: float, style: Style, wear: float, vertical: bool = False
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


def placed(decal: Decal, sheet: Sheet, center: Vec2, class_name: str = "") -> Decal:
    """Return a decal at a place of a sheet."""
    return replace(decal, face=sheet.face, center_mm=center, class_name=class_name)
