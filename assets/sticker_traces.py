"""Drawings of logos, chalk, customs seals, inspection labels, residue and streaks."""

from itertools import pairwise
from math import cos, pi, sin

import numpy as np
from drawing import BLACK, WHITE, rect, words
from sticker_plates import RED, fitted, frame, line, path, svg

_CHALK = "#e9e7e0"


def square_logo(fill: str, ink: str, shape: str, name: str) -> str:
    """Square of an invented line: a shape above a name."""
    body = rect(0, 0, 1000, 1000, fill) + path(shape, ink)
    return svg(1000, 1000, body + words(name, 500, 930, 120, ink))


def diamond_logo(fill: str, ink: str, letters: str) -> str:
    """Diamond of an invented line with its letters."""
    field = path("M500 0 L1000 500 L500 1000 L0 500 Z", fill)
    edge = line("M500 70 L930 500 L500 930 L70 500 Z", ink, 24)
    return svg(1000, 1000, field + edge + words(letters, 500, 610, 260, ink))


def leasing_logo(fill: str, ink: str, accent: str, name: str) -> str:
    """Wide logo of an invented leasing company: a name beside stripes."""
    body = rect(0, 0, 1000, 420, fill)
    stripes = "".join(path(f"M{60 + 70 * i} 360 l90 -300 h44 l-90 300 Z", accent) for i in range(3))
    return svg(1000, 420, body + stripes + fitted(name, 650, 280, 150, ink, 600))


def _hand(rng: np.random.Generator, points: list[tuple[float, float]]) -> str:
    """Return a curve near points, as a hand draws it."""
    moved = [(x + rng.normal(0, 6), y + rng.normal(0, 6)) for x, y in points]
    made = f"M{moved[0][0]:.0f} {moved[0][1]:.0f}"
    for (ax, ay), (bx, by) in pairwise(moved):
        bend_x, bend_y = (ax + bx) / 2 + rng.normal(0, 10), (ay + by) / 2 + rng.normal(0, 10)
        made += f" Q{bend_x:.0f} {bend_y:.0f} {bx:.0f} {by:.0f}"
    return made


def _loop(cx: float, cy: float, rx: float, ry: float, turns: float) -> list[tuple[float, float]]:
    angles = [2 * pi * turns * k / 12 - 2 for k in range(13)]
    return [(cx + rx * cos(a) * (1 + 0.02 * a), cy + ry * sin(a)) for a in angles]


_DIGITS = {
    "2": [(0, 30), (30, 0), (80, 10), (90, 60), (10, 190), (0, 200), (110, 195)],
    "4": [(80, 0), (0, 120), (120, 125), (80, 60), (85, 210)],
    "7": [(0, 5), (110, 0), (60, 100), (40, 200)],
    "A": [(0, 200), (55, 0), (110, 200), (85, 130), (20, 130)],
    "K": [(0, 0), (5, 200), (5, 110), (100, 0), (8, 110), (110, 200)],
    "X": [(0, 0), (110, 200), (60, 100), (110, 0), (0, 200)],
}


def chalk(text: str, seed: int, ringed: bool) -> str:
    """Chalk letters, ringed or underlined; every second stroke is fainter."""
    rng = np.random.default_rng(seed)
    strokes = []
    left = 500 - 95 * len(text)
    for i, char in enumerate(text):
        tall = rng.uniform(1.3, 1.7)
        strokes.append([(left + 190 * i + 1.3 * x, 330 + tall * y) for x, y in _DIGITS[char]])
    underline = [(180.0, 760.0), (560.0, 720.0), (830.0, 745.0)]
    strokes.append(_loop(500, 490, 400, 300, 1.08) if ringed else underline)
    return svg(
        1000,
        1000,
        "".join(
            line(
                _hand(rng, stroke),
                _CHALK,
                (24, 17)[i % 2],
                f'stroke-linecap="round" stroke-opacity="{(0.85, 0.6)[i % 2]}" '
                f'stroke-dasharray="{rng.uniform(50, 90):.0f} {rng.uniform(3, 9):.0f}"',
            )
            for i, stroke in enumerate(strokes)
        ),
    )


def customs_seal(color: str, title: str, number: str) -> str:
    """Paper strip that customs pastes over a door gap."""
    body = rect(0, 0, 1000, 300, WHITE)
    body += rect(0, 0, 1000, 56, color) + rect(0, 244, 1000, 56, color)
    body += words(title, 420, 150, 74, color) + words(number, 420, 228, 56, BLACK)
    ring = f'<circle cx="880" cy="150" r="74" fill="none" stroke="{RED}" stroke-width="14"/>'
    return svg(1000, 300, body + ring + words("OK", 880, 176, 60, RED))


def _ragged(rng: np.random.Generator, half: float, corners: int, rough: float) -> str:
    """Return a ragged outline: a diamond for four corners, else a blot."""
    waves = [(rng.normal(0, rough / (k + 1)), rng.uniform(0, 2 * pi)) for k in range(1, 7)]
    made = []
    for step in range(96):
        angle = 2 * pi * step / 96
        reach = half
        if corners == 4:
            reach = half / (abs(cos(angle)) + abs(sin(angle)))
        swing = sum(a * sin((k + 1) * angle + b) for k, (a, b) in enumerate(waves))
        reach *= 1 - min(abs(swing), 0.7) - 0.06 * rough * rng.random()
        made.append(f"{500 + reach * cos(angle):.0f} {500 + reach * sin(angle):.0f}")
    return f"M{' L'.join(made)} Z"


def residue(seed: int, corners: int) -> str:
    """Scraps of torn paper on grey glue; with four corners, those of a removed placard."""
    rng = np.random.default_rng(seed)
    rough = 0.12 if corners else 0.3
    made = path(_ragged(rng, 480, corners, rough), "#8f8b80", 'fill-opacity="0.45"')
    for _ in range(7):
        x, y = rng.uniform(-230, 230, 2)
        d = _ragged(rng, rng.uniform(60, 210), 0, 0.6)
        made += path(d, "#dcd8cb", f'transform="translate({x:.0f} {y:.0f})"')
    tears = "".join(
        f"M{rng.uniform(150, 500):.0f} {rng.uniform(300, 700):.0f} "
        f"l{rng.uniform(120, 320):.0f} {rng.uniform(-160, 160):.0f} "
        for _ in range(6)
    )
    return svg(1000, 1000, made + line(tears, "#7d796f", 12, 'stroke-opacity="0.7"'))


def overpaint(seed: int) -> str:
    """Patch of fresh paint where a placard was; drawn in a darker tone of the container's paint."""
    rng = np.random.default_rng(seed)
    drips = "".join(
        rect(x, 560, rng.uniform(14, 30), rng.uniform(120, 330), WHITE)
        for x in rng.uniform(330, 640, 3)
    )
    return svg(1000, 1000, path(_ragged(rng, 495, 4, 0.08), WHITE) + drips)


def inspection_label(color: str, year: str) -> str:
    """Small label of an inspection with the year."""
    body = rect(0, 0, 1000, 700, color) + frame(1000, 700, WHITE, 24, 40)
    body += words("NEXT EXAM", 500, 240, 110, WHITE)
    return svg(1000, 700, body + words(year, 500, 560, 220, WHITE))


def streaks(seed: int, count: int) -> str:
    """Streaks that run down from the upper edge and fade; the renderer gives them their colour."""
    rng = np.random.default_rng(seed)
    few = count <= 2
    blur = f"<feGaussianBlur stdDeviation='{30 if few else 8} 5'/>"
    made, fades = "", f"<filter id='b' x='-1' width='3'>{blur}</filter>"
    for i in range(count):
        width = 900 / count if few else rng.uniform(150, 560) / count
        length = rng.uniform(750 if few else 350, 950)
        x = rng.uniform(40, 960 - width)
        peak = 0.8 if i == 0 else rng.uniform(0.3, 0.8)
        fades += f"<linearGradient id='f{i}' x2='0' y2='1'>"
        for at, share in ((0, 0.2), (0.07, 0.85), (0.15, 1.0), (0.5, 0.6), (1, 0.0)):
            fades += f"<stop offset='{at}' stop-color='#fff' stop-opacity='{share * peak:.2f}'/>"
        fades += "</linearGradient>"
        # narrower at the lower end
        d = f"M{x:.0f} 0 h{width:.0f} l{-0.3 * width:.0f} {length:.0f} h{-0.4 * width:.0f} Z"
        made += path(d, f"url(#f{i})", "filter='url(#b)'")
    return svg(1000, 1000, f"<defs>{fades}</defs>{made}")
