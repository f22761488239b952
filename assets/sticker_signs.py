"""Drawings of signs with dimensions and warnings, of "ic" marks and of class-society seals."""

from math import cos, pi, radians, sin

from drawing import BLACK, WHITE, rect, words
from sticker_plates import YELLOW, fitted, frame, line, path, svg


def height_sign(metres: str, feet: str) -> str:
    """Yellow sign with the height in metres above that in feet."""
    body = f'<rect width="700" height="900" rx="70" fill="{BLACK}"/>'
    body += f'<rect x="28" y="28" width="644" height="844" rx="52" fill="{YELLOW}"/>'
    body += fitted(metres, 350, 390, 240, BLACK, 560)
    return svg(700, 900, body + fitted(feet, 350, 740, 240, BLACK, 540))


def width_sign() -> str:
    """Wide yellow sign of pallet-wide containers."""
    body = rect(0, 0, 1000, 480, YELLOW) + frame(1000, 480, BLACK, 30, 22)
    arrows = path("M70 360 l90 -55 v110 Z M930 360 l-90 -55 v110 Z", BLACK)
    arrows += rect(160, 348, 680, 24, BLACK)
    return svg(1000, 480, body + words("2.5 m  WIDE", 500, 240, 130, BLACK) + arrows)


def height_triangle() -> str:
    """Corner sign of high cubes."""
    body = rect(0, 0, 1000, 1000, YELLOW) + path("M0 0 L1000 0 L0 1000 Z", BLACK)
    body += words("2.9 M", 640, 760, 130, BLACK)
    return svg(1000, 1000, body + words("HC", 300, 300, 190, YELLOW))


def _yellow_triangle(body: str) -> str:
    outer = path("M500 20 Q540 20 562 58 L985 800 Q1000 880 930 880 H70 Q0 880 15 800 L438 58 "
                 "Q460 20 500 20 Z", BLACK)  # fmt: skip
    inner = path("M500 66 Q516 66 526 84 L936 806 Q944 836 916 836 H84 Q56 836 64 806 L474 84 "
                 "Q484 66 500 66 Z", YELLOW)  # fmt: skip
    return svg(1000, 900, outer + inner + body)


def super_heavy(weight: str) -> str:
    """Triangle that warns of a high gross weight."""
    body = words("SUPER", 500, 480, 90, BLACK) + words("HEAVY", 500, 610, 110, BLACK)
    return _yellow_triangle(body + words(weight, 500, 780, 120, BLACK))


def caution_load() -> str:
    """Caution triangle with a box that falls from a tilted one."""
    box = rect(-70, -55, 140, 110, BLACK, 'transform="translate(450 440) rotate(24)"')
    small = rect(-38, -38, 76, 76, BLACK, 'transform="translate(620 500) rotate(50)"')
    floor = line("M330 640 H690", BLACK, 26) + line("M620 560 V600", BLACK, 14)
    return _yellow_triangle(box + small + floor + words("CAUTION", 500, 780, 92, BLACK))


def caution_doors() -> str:
    """Caution triangle with an exclamation mark."""
    mark = path("M455 280 H545 L525 570 H475 Z", BLACK)
    dot = f'<circle cx="500" cy="640" r="44" fill="{BLACK}"/>'
    return _yellow_triangle(mark + dot + words("OPEN WITH CARE", 500, 790, 58, BLACK))


def ic_mark(number: str) -> str:
    """Letters "ic" in a box with a cut corner above the number of a railway."""
    box = line("M40 40 H860 L960 140 V560 H40 Z", WHITE, 46) + line("M430 40 V560", WHITE, 40)
    letters = rect(185, 250, 80, 250, WHITE) + rect(185, 120, 80, 80, WHITE)
    letters += line("M820 255 A140 140 0 1 0 820 420", WHITE, 76)
    return svg(1000, 1000, box + letters + words(number, 500, 950, 300, WHITE))


def _around(text: str, radius: float, height: float, color: str, step_deg: float) -> str:
    """Return letters on a circle around (500, 500), centred at the top."""
    first = -step_deg * (len(text) - 1) / 2
    made = ""
    for i, char in enumerate(text):
        angle = first + i * step_deg
        x, y = 500 + radius * sin(radians(angle)), 500 - radius * cos(radians(angle))
        turn = f"translate({x:.1f} {y:.1f}) rotate({angle:.1f})"
        if char != " ":
            made += f'<g transform="{turn}">{words(char, 0, 0, height, color)}</g>'
    return made


def seal(text: str, color: str, emblem: str) -> str:
    """Round seal of an invented class society: its name around an emblem."""
    disc = f'<circle cx="500" cy="500" r="480" fill="{WHITE}"/>'
    rings = "".join(
        f'<circle cx="500" cy="500" r="{r}" fill="none" stroke="{color}" stroke-width="{w}"/>'
        for r, w in ((455, 26), (315, 14))
    )
    return svg(1000, 1000, disc + rings + _around(text, 352, 70, color, 330 / len(text)) + emblem)


def anchor(color: str) -> str:
    """Anchor in the middle of a seal."""
    ring = f'<circle cx="500" cy="320" r="40" fill="none" stroke="{color}" stroke-width="24"/>'
    stock = rect(484, 360, 32, 330, color) + rect(400, 420, 200, 28, color)
    return ring + stock + line("M340 560 Q370 710 500 710 Q630 710 660 560", color, 34)


def sextant(color: str) -> str:
    """Arc with a pointer."""
    arc = line("M330 600 A240 240 0 0 0 670 600 L500 300 Z", color, 32)
    return arc + line("M500 300 L560 690", color, 24)


def star_shield(color: str) -> str:
    """Shield with a star."""
    tips = " L".join(
        f"{500 + r * sin(pi * k / 5):.0f} {470 - r * cos(pi * k / 5):.0f}"
        for k in range(10)
        for r in ((110, 46)[k % 2],)
    )
    shield = path("M340 320 H660 V520 Q640 660 500 720 Q360 660 340 520 Z", color)
    return shield + path(f"M{tips} Z", WHITE)
