"""SVG building blocks of the drawn artwork, and its conversion to pixels.

Needs fastgen, fonttools, brotli and resvg-py. Drawings are squares of 1000 x 1000 units, y
downward.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import resvg_py
from fontTools.pens.svgPathPen import SVGPathPen
from fontTools.ttLib import TTFont

from fastgen.decals.artwork import ART_SIZE as SIZE
from fastgen.decals.artwork import mip_levels

ASSETS = Path(__file__).parent
WHITE, BLACK = "#ffffff", "#101010"
FONTS = ("archivo-narrow", "roboto-condensed", "barlow-condensed")


@lru_cache
def _font(name: str) -> tuple[Any, dict[int, str], float]:
    font = TTFont(ASSETS / "fonts" / f"{name}.woff")
    return font.getGlyphSet(), font.getBestCmap(), font["OS/2"].sCapHeight


def width_of(text: str, height: float, font: str = FONTS[0], spacing: float = 0.0) -> float:
    """Return the width of `text` with capitals of the given height.

    Args:
        text: Text of one line.
        height: Height of the capitals.
        font: Name of a font in `assets/fonts`.
        spacing: Extra distance between letters, in cap heights.
    """
    glyphs, names, cap = _font(font)
    advance = sum(glyphs[names[ord(char)]].width for char in text) / cap
    return height * (advance + spacing * (len(text) - 1))


def words(
    text: str,
    x: float,
    y: float,
    height: float,
    color: str,
    *,
    font: str = FONTS[0],
    stretch: float = 1.0,
    weight: float = 0.0,
    spacing: float = 0.0,
) -> str:
    """Return `text` as outlines, centred on x, with its baseline at y.

    Args:
        text: Text of one line.
        x: Middle of the line.
        y: Baseline.
        height: Height of the capitals.
        color: Fill colour.
        font: Name of a font in `assets/fonts`.
        stretch: Horizontal scale of the letters.
        weight: Growth of every stroke, in cap heights.
        spacing: Extra distance between letters, in cap heights.
    """
    glyphs, names, cap = _font(font)
    scale = height / cap
    pen_x, parts = -width_of(text, height, font, spacing) / 2, []
    for char in text:
        pen = SVGPathPen(glyphs, ntos=lambda value: f"{value:g}")
        glyphs[names[ord(char)]].draw(pen)
        move = f"translate({pen_x:.1f} 0) scale({scale:.4f} {-scale:.4f})"
        parts.append(f'<path transform="{move}" d="{pen.getCommands()}"/>')
        pen_x += glyphs[names[ord(char)]].width * scale + spacing * height
    grown = f' stroke="{color}" stroke-width="{weight * cap:.0f}"' if weight else ""
    place = f"translate({x:.1f} {y:.1f}) scale({stretch:.3f} 1)"
    return f'<g fill="{color}"{grown} transform="{place}">{"".join(parts)}</g>'


def rect(x: float, y: float, w: float, h: float, fill: str, more: str = "") -> str:
    """Return a filled rectangle with its corner at (x, y); `more` are further attributes."""
    return f'<rect x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" fill="{fill}" {more}/>'


def bake(svg: str) -> np.ndarray:
    """Render an SVG to BGRA uint8 [SIZE, SIZE, 4]; edge colours extend into transparent pixels."""
    png = bytes(resvg_py.svg_to_bytes(svg_string=svg, width=2 * SIZE, height=2 * SIZE))
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    if image.shape[:2] != (2 * SIZE, 2 * SIZE):  # drawings with another aspect ratio are stretched
        image = cv2.resize(image, (2 * SIZE, 2 * SIZE), interpolation=cv2.INTER_CUBIC)
    half = mip_levels(image)[0]
    color, alpha = half[..., :3].astype(np.float32), half[..., 3:]
    known = (alpha > 127).astype(np.float32)
    color, weight = color * known, known
    while (weight == 0).any():
        grown, spread = cv2.blur(color, (9, 9)), cv2.blur(weight, (9, 9))[..., None]
        fresh = (weight == 0) & (spread > 0)
        color = np.where(fresh, grown / np.maximum(spread, 1e-6), color)
        weight = np.where(fresh, 1.0, weight)
    return np.concatenate([np.rint(color).astype(np.uint8), alpha], axis=2)
