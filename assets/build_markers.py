"""Draw the 26 dangerous-goods markers as SVG and convert them to PNG.

    python assets/build_markers.py

Run by hand. Needs fonttools and resvg-py. Colours, symbols and layout follow the UN Model
Regulations, chapter 5.2.2.2. A marker is a square standing on its corner, here inscribed in 1000 x
1000. The inner line is 12.5 / 250 of a side from the edge, and the class number is at the bottom
corner. All symbols are original drawings.
"""

from pathlib import Path

import cv2
import numpy as np
import resvg_py
from fontTools.pens.svgPathPen import SVGPathPen
from fontTools.ttLib import TTFont

ASSETS = Path(__file__).parent
SIZE = 512
RED, GREEN, BLUE, ORANGE, YELLOW = "#d2202e", "#00823f", "#0057a8", "#f07d1a", "#f6c900"
WHITE, BLACK = "#ffffff", "#101010"
FONT = TTFont(ASSETS / "fonts" / "archivo-narrow.woff")

FLAME = (
    "M508 120 C560 190 640 250 640 350 C640 372 634 392 624 408 C622 376 606 350 584 338 "
    "C590 380 574 420 548 446 C556 400 540 352 500 322 C506 372 470 396 456 430 "
    "C446 410 444 396 446 380 C420 400 410 428 412 458 C380 428 362 392 362 352 "
    "C362 270 450 240 470 160 C492 178 500 200 500 226 C516 196 518 156 508 120 Z"
)
FLAME_BASE = '<rect x="352" y="476" width="296" height="22"/>'


def words(text: str, x: float, y: float, height: float, color: str) -> str:
    """Return `text` as outlines, centred on x, baseline at y, with capitals of the given height."""
    glyphs, names = FONT.getGlyphSet(), FONT.getBestCmap()
    scale = height / FONT["OS/2"].sCapHeight
    widths = [glyphs[names[ord(c)]].width * scale for c in text]
    pen_x, parts = x - sum(widths) / 2, []
    for char, width in zip(text, widths, strict=True):
        pen = SVGPathPen(glyphs)
        glyphs[names[ord(char)]].draw(pen)
        move = f"translate({pen_x:.1f} {y}) scale({scale:.4f} {-scale:.4f})"
        parts.append(f'<path transform="{move}" d="{pen.getCommands()}"/>')
        pen_x += width
    return f'<g fill="{color}">{"".join(parts)}</g>'


def width_of(text: str, height: float) -> float:
    """Return the width of `text` with capitals of the given height."""
    glyphs, names = FONT.getGlyphSet(), FONT.getBestCmap()
    return sum(glyphs[names[ord(c)]].width for c in text) * height / FONT["OS/2"].sCapHeight


def words_from(x: float, y: float, text: str, height: float) -> str:
    """Return black `text` that starts at x."""
    return words(text, x + width_of(text, height) / 2, y, height, BLACK)


def caption(text: str, color: str) -> str:
    """Return the hazard in words below the middle; a `|` in `text` starts the second line."""
    parts = []
    for i, line in enumerate(text.split("|")):
        y = 612 + 74 * i
        room = 2 * (950 - y) - 120
        height = min(60.0, 60 * room / width_of(line, 60))
        parts.append(words(line, 500, y, height, color))
    return "".join(parts)


def flame(color: str, dy: float = 0) -> str:
    return f'<g fill="{color}" transform="translate(0 {dy})"><path d="{FLAME}"/>{FLAME_BASE}</g>'


def bomb() -> str:
    rays = "".join(
        f'<path transform="rotate({a} 500 330)" d="M482 235 L500 {tip} L518 235 Z"/>'
        for a, tip in [
            (-75, 155),
            (-45, 150),
            (-20, 165),
            (8, 115),
            (35, 160),
            (60, 150),
            (85, 170),
        ]
    )
    shards = "".join(
        f'<path transform="rotate({a} 500 330)" d="M484 {330 - r} l30 -8 l6 30 l-28 6 Z"/>'
        for a, r in [
            (-98, 185),
            (-60, 180),
            (-32, 195),
            (-6, 205),
            (21, 200),
            (47, 190),
            (73, 180),
            (104, 180),
        ]
    )
    return (
        f'<g fill="{BLACK}"><circle cx="500" cy="355" r="82"/>{rays}{shards}'
        '<path d="M400 455 h200 l24 22 h-248 Z"/></g>'
    )


def cylinder(color: str) -> str:
    return (
        f'<g fill="{color}" transform="translate(15 30) rotate(-58 500 320)">'
        '<rect x="452" y="225" width="96" height="270" rx="40"/>'
        '<rect x="478" y="165" width="44" height="44" rx="8"/>'
        '<rect x="462" y="145" width="76" height="22" rx="8"/></g>'
    )


def skull() -> str:
    bones = "".join(
        f'<g transform="rotate({a} 500 430)"><rect x="330" y="418" width="340" height="24"/>'
        '<circle cx="330" cy="414" r="20"/><circle cx="330" cy="446" r="20"/>'
        '<circle cx="670" cy="414" r="20"/><circle cx="670" cy="446" r="20"/></g>'
        for a in (-20, 20)
    )
    return (
        f'<g fill="{BLACK}">{bones}<path d="M500 160 C592 160 640 220 632 296 C628 334 606 344 600 '
        "366 C596 392 588 402 560 402 L440 402 C412 402 404 392 400 366 C394 344 372 334 368 296 "
        'C360 220 408 160 500 160 Z"/></g>'
        f'<g fill="{WHITE}"><ellipse cx="446" cy="290" rx="36" ry="40"/>'
        '<ellipse cx="554" cy="290" rx="36" ry="40"/><path d="M500 320 l20 40 h-40 Z"/>'
        '<rect x="452" y="376" width="8" height="26"/><rect x="496" y="376" width="8" height="26"/>'
        '<rect x="540" y="376" width="8" height="26"/></g>'
    )


def flame_over_circle() -> str:
    return (
        '<g transform="translate(-50 -51) scale(1.1)">'
        f'<g transform="translate(125 68) scale(0.75)"><path fill="{BLACK}" d="{FLAME}"/></g>'
        f'<circle cx="500" cy="432" r="62" fill="none" stroke="{BLACK}" stroke-width="22"/>'
        f'<rect x="400" y="512" width="200" height="18" fill="{BLACK}"/></g>'
    )


def trefoil(cy: float = 290, r: float = 30) -> str:
    """Return a disc of radius r and three blades from 1.5 r to 5 r (49 CFR 172, appendix B)."""
    near, far = 1.5 * r, 5 * r
    cos = 0.75**0.5
    blade = (
        f'd="M{500 - near / 2} {cy + near * cos:.1f} A{near} {near} 0 0 0 {500 + near / 2} '
        f"{cy + near * cos:.1f} L{500 + far / 2} {cy + far * cos:.1f} "
        f'A{far} {far} 0 0 1 {500 - far / 2} {cy + far * cos:.1f} Z"'
    )
    blades = "".join(f'<path transform="rotate({a} 500 {cy})" {blade}/>' for a in (0, 120, 240))
    return f'<g fill="{BLACK}"><circle cx="500" cy="{cy}" r="{r}"/>{blades}</g>'


def infectious() -> str:
    rings = "".join(
        f'<g transform="rotate({a} 500 330)"><path d="M500 330 C430 300 420 215 470 165 '
        'C440 220 462 270 500 276 C538 270 560 220 530 165 C580 215 570 300 500 330 Z"/>'
        "</g>"
        for a in (0, 120, 240)
    )
    return (
        '<g transform="translate(-150 -91) scale(1.3)">'
        f'<g fill="{BLACK}">{rings}<circle cx="500" cy="330" r="26"/></g>'
        f'<circle cx="500" cy="330" r="92" fill="none" stroke="{BLACK}" stroke-width="20"/></g>'
    )


def corrosion() -> str:
    """Return liquids that spill from two glass vessels and attack a metal and a hand."""
    tube = (
        '<path d="M0 -25 H150 V-33 H166 V33 H150 V25 H0 A25 25 0 0 1 0 -25 Z"/>'
        f'<path fill="{WHITE}" d="M18 -13 H138 V-2 H18 Z"/>'
    )
    drops = "".join(
        f'<path d="M{x} {y} q16 28 0 42 q-16 -14 0 -42 Z"/>'
        for x, y in [(328, 312), (340, 362), (672, 312), (660, 362)]
    )
    return (
        f'<g fill="{BLACK}"><g transform="translate(463 190) rotate(142)">{tube}</g>'
        f'<g transform="translate(537 190) rotate(38) scale(1 -1)">{tube}</g>{drops}'
        '<path d="M180 418 H296 Q300 444 318 438 Q334 452 348 440 Q366 444 372 418 H446 V458 H180 Z"/>'
        '<path d="M822 404 L742 392 Q712 386 698 402 Q680 428 662 420 Q646 426 634 408 L576 416 '
        "Q552 422 560 438 L640 442 L602 446 Q584 452 592 468 L704 470 Q762 466 822 450 "
        'Z"/></g>'
    )


def stripes(count: int, color: str, upper_only: bool) -> str:
    """Return `count` vertical stripes over the diamond, with gaps of the same width."""
    width = 1000 / (2 * count + 1)
    height = 500 if upper_only else 1000
    bars = "".join(
        f'<rect x="{(2 * i + 1) * width:.1f}" y="0" width="{width:.1f}" height="{height}"/>'
        for i in range(count)
    )
    return f'<g fill="{color}" clip-path="url(#inner)">{bars}</g>'


def lower_half(color: str) -> str:
    return f'<path fill="{color}" d="M0 500 L1000 500 L500 1000 Z"/>'


def bordered(color: str, half: str) -> str:
    """Fill the "upper" or "lower" half within the inner line; the field remains as a border."""
    tip = {"upper": 0, "lower": 1000}[half]
    return f'<path fill="{color}" clip-path="url(#inner)" d="M0 500 L1000 500 L500 {tip} Z"/>'


def frame(x: float, y: float, width: float, height: float, line: float) -> str:
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" fill="none" '
        f'stroke="{BLACK}" stroke-width="{line}"/>'
    )


def rule(y: float, height: float) -> str:
    """Return a horizontal line from inner line to inner line."""
    return (
        f'<rect x="0" y="{y}" width="1000" height="{height}" fill="{BLACK}" '
        'clip-path="url(#inner)"/>'
    )


def radioactive(bars: int) -> str:
    """Return the body of category I to III: a red bar per category, and an index box from II on."""
    word = width_of("RADIOACTIVE", 44)
    left = 500 - (word + 22 + 58 * bars - 24) / 2
    marks = "".join(
        f'<rect x="{left + word + 22 + 58 * i:.1f}" y="526" width="34" height="104" fill="{RED}"/>'
        for i in range(bars)
    )
    fields = "".join(
        words_from(310, y, text, 26) + f'<rect x="490" y="{y - 4}" width="200" height="4"/>'
        for text, y in (("CONTENTS", 660), ("ACTIVITY", 698))
    )
    index = frame(356, 716, 288, 50, 6) + words_from(368, 750, "TRANSPORT INDEX", 20)
    return (
        trefoil()
        + rule(497, 8)
        + words_from(left, 600, "RADIOACTIVE", 44)
        + marks
        + fields
        + (index if bars > 1 else "")
    )


def fissile() -> str:
    box = frame(262, 545, 476, 124, 10)
    title = words("FISSILE", 500, 440, 112, BLACK)
    lines = words_from(282, 598, "CRITICALITY", 34) + words_from(282, 648, "SAFETY INDEX", 34)
    return title + rule(485, 10) + box + lines


def explosive(division: str, letter: str) -> str:
    return words(division, 500, 440, 210, BLACK) + words(letter, 500, 690, 120, BLACK)


def marker(
    field: str,
    ink: str,
    body: str,
    number: str,
    hazard: str = "",
    over: str = "",
    symbol_ink: str = "",
) -> str:
    """Return the SVG of one marker.

    The inner line has the symbol's colour in the upper half and the number's in the lower half (UN
    Model Regulations 5.2.2.2.1.1.2).

    Args:
        field: Background colour.
        ink: Colour of number and words.
        body: SVG of the symbol.
        number: Class number at the bottom corner.
        hazard: Hazard in words.
        over: SVG of a second field, drawn beneath the inner line.
        symbol_ink: Colour of the symbol if it differs from `ink`.
    """
    text = caption(hazard, ink) if hazard else ""
    line = "M500 50 L950 500 L500 950 L50 500 Z"
    height, baseline = (92, 884) if len(number) == 1 else (76, 866)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1000 1000">\n'
        '<clipPath id="outer"><path d="M500 0 L1000 500 L500 1000 L0 500 Z"/></clipPath>'
        f'<clipPath id="inner"><path d="{line}"/></clipPath>'
        '<clipPath id="upper"><rect width="1000" height="500"/></clipPath>\n'
        f'<g clip-path="url(#outer)"><rect width="1000" height="1000" fill="{field}"/>{over}'
        f'<g fill="none" stroke-width="14"><path d="{line}" stroke="{ink}"/>'
        f'<path d="{line}" stroke="{symbol_ink or ink}" clip-path="url(#upper)"/></g>\n'
        f"{body}{text}{words(number, 500, baseline, height, ink)}</g>\n</svg>\n"
    )


def under_line(ink: str) -> str:
    return f'<rect x="470" y="892" width="60" height="9" fill="{ink}"/>'


def all_markers() -> dict[str, str]:
    """Return the SVG of every class, in the order of fastgen.classes.MARKER_CLASSES."""
    half_bars = stripes(7, BLACK, upper_only=True)
    return {
        "C1.1": marker(ORANGE, BLACK, bomb() + words("1.1 D", 500, 640, 110, BLACK), "1"),
        "C1.2": marker(ORANGE, BLACK, explosive("1.4", "S"), "1"),
        "C1.3": marker(ORANGE, BLACK, explosive("1.5", "D"), "1"),
        "C1.4": marker(ORANGE, BLACK, explosive("1.6", "N"), "1"),
        "C2.1": marker(RED, BLACK, flame(BLACK), "2", "FLAMMABLE GAS"),
        "C2.2": marker(RED, WHITE, flame(WHITE), "2", "FLAMMABLE GAS"),
        "C2.3": marker(GREEN, BLACK, cylinder(BLACK), "2", "NON-FLAMMABLE|GAS"),
        "C2.4": marker(GREEN, WHITE, cylinder(WHITE), "2", "NON-FLAMMABLE|GAS"),
        "C2.5": marker(WHITE, BLACK, skull(), "2", "TOXIC GAS"),
        "C3.1": marker(RED, BLACK, flame(BLACK), "3", "FLAMMABLE|LIQUID"),
        "C3.2": marker(RED, WHITE, flame(WHITE), "3", "FLAMMABLE|LIQUID"),
        "C4.1": marker(WHITE, BLACK, flame(BLACK), "4", over=stripes(7, RED, upper_only=False)),
        "C4.2": marker(WHITE, BLACK, flame(BLACK, -40), "4", over=lower_half(RED)),
        "C4.3": marker(BLUE, BLACK, flame(BLACK), "4", "DANGEROUS|WHEN WET"),
        "C4.4": marker(BLUE, WHITE, flame(WHITE), "4", "DANGEROUS|WHEN WET"),
        "C5.1": marker(YELLOW, BLACK, flame_over_circle(), "5.1", "OXIDIZER"),
        "C5.2": marker(
            RED, BLACK, flame(BLACK, -40), "5.2", "ORGANIC|PEROXIDE", lower_half(YELLOW)
        ),
        "C5.3": marker(
            *(RED, BLACK, flame(WHITE, -40), "5.2", "ORGANIC|PEROXIDE", lower_half(YELLOW)),
            symbol_ink=WHITE,
        ),
        "C6.1": marker(WHITE, BLACK, skull(), "6", "TOXIC"),
        "C6.2": marker(WHITE, BLACK, infectious(), "6", "INFECTIOUS|SUBSTANCE"),
        "C7.1": marker(WHITE, BLACK, radioactive(1), "7"),
        "C7.2": marker(WHITE, BLACK, radioactive(2), "7", over=bordered(YELLOW, "upper")),
        "C7.3": marker(WHITE, BLACK, fissile(), "7"),
        "C7.4": marker(WHITE, BLACK, radioactive(3), "7", over=bordered(YELLOW, "upper")),
        "C8.1": marker(
            *(WHITE, WHITE, corrosion(), "8", "", bordered(BLACK, "lower")), symbol_ink=BLACK
        ),
        "C9.1": marker(WHITE, BLACK, half_bars + under_line(BLACK), "9"),
    }


def bake(svg: str) -> np.ndarray:
    """Render an SVG to RGBA uint8 [SIZE, SIZE, 4]; edge colours extend into transparent pixels."""
    png = bytes(resvg_py.svg_to_bytes(svg_string=svg, width=SIZE, height=SIZE))
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    if image.shape[:2] != (SIZE, SIZE):  # drawings with another aspect ratio are stretched
        image = cv2.resize(image, (SIZE, SIZE), interpolation=cv2.INTER_CUBIC)
    alpha = image[..., 3:].astype(np.float32) / 255
    color = image[..., :3].astype(np.float32)
    known = (alpha > 0.5).astype(np.float32)
    color, weight = color * known, known
    while (weight == 0).any():
        grown, spread = cv2.blur(color, (9, 9)), cv2.blur(weight, (9, 9))[..., None]
        fresh = (weight == 0) & (spread > 0)
        color = np.where(fresh, grown / np.maximum(spread, 1e-6), color)
        weight = np.where(fresh, 1.0, weight)
    return np.concatenate([np.rint(color).astype(np.uint8), image[..., 3:]], axis=2)


def main() -> None:
    """Write markers/*.svg and markers/*.png."""
    for name, svg in all_markers().items():
        (ASSETS / "markers" / f"{name}.svg").write_text(svg, encoding="utf-8")
        cv2.imwrite(
            str(ASSETS / "markers" / f"{name}.png"), bake(svg), [cv2.IMWRITE_PNG_COMPRESSION, 9]
        )


if __name__ == "__main__":
    main()
