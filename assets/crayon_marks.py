"""Drawings of surveyors' crayon marks: rings, arrows, crosses, ticks, slashes and short codes.

All strokes are white; the renderer gives them their colour.
"""

from itertools import pairwise
from math import cos, pi, sin

import numpy as np
from drawing import WHITE
from sticker_plates import line, svg

_Stroke = list[tuple[float, float]]

_LETTERS: dict[str, list[_Stroke]] = {
    "1": [[(20, 50), (62, 0)], [(62, 0), (58, 200)]],
    "2": [[(0, 45), (25, -15), (110, 0), (90, 90), (0, 200)], [(0, 200), (105, 192)]],
    "3": [[(5, 15), (70, -15), (110, 50), (30, 90)], [(30, 88), (125, 110), (90, 215), (0, 180)]],
    "4": [[(70, 0), (0, 125)], [(0, 125), (115, 120)], [(82, 60), (85, 205)]],
    "5": [[(95, 0), (15, 5)], [(15, 5), (10, 90)], [(10, 88), (110, 70), (115, 190), (0, 190)]],
    "7": [[(0, 5), (110, 0)], [(110, 0), (60, 100), (40, 200)]],
    "B": [
        [(5, 0), (0, 200)],
        [(5, 0), (110, 20), (80, 90), (5, 95)],
        [(5, 95), (130, 120), (90, 205), (0, 200)],
    ],
    "D": [[(5, 0), (0, 200)], [(0, 0), (110, 20), (125, 160), (0, 200)]],
    "H": [[(0, 0), (5, 200)], [(100, 0), (95, 205)], [(5, 100), (100, 95)]],
    "K": [[(0, 0), (5, 200)], [(100, 0), (5, 110)], [(5, 105), (110, 200)]],
    "O": [[(60, 0), (0, 40), (0, 190), (80, 220), (120, 110), (95, -5), (45, 5)]],
    "R": [[(5, 0), (0, 200)], [(5, 0), (120, 20), (90, 105), (5, 100)], [(20, 98), (105, 200)]],
    "X": [[(0, 0), (110, 200)], [(110, 5), (0, 195)]],
}
"""Strokes of hand-written characters, 110 x 200 units."""

_CROSS: list[_Stroke] = [[(90, 110), (430, 520), (900, 880)], [(880, 90), (560, 470), (100, 900)]]
_TICK: list[_Stroke] = [[(90, 520), (240, 660), (340, 880)], [(340, 890), (500, 480), (910, 100)]]
_SLASHES: list[_Stroke] = [
    [(60, 880), (230, 500), (370, 90)],
    [(330, 910), (520, 520), (640, 110)],
    [(620, 890), (760, 540), (930, 140)],
]
_ARROWS: list[list[_Stroke]] = [
    [[(60, 520), (500, 470), (930, 505)], [(640, 240), (935, 505)], [(930, 500), (620, 790)]],
    [[(60, 300), (380, 620), (930, 500)], [(720, 240), (940, 505)], [(935, 495), (680, 740)]],
]
"""Arrows that point to the right."""


def _curve(rng: np.random.Generator, points: _Stroke, spread: float) -> str:
    """Return a smooth curve near points, as an unsteady hand draws it."""
    moved = [(x + rng.normal(0, spread), y + rng.normal(0, spread)) for x, y in points]
    made = f"M{moved[0][0]:.0f} {moved[0][1]:.0f}"
    for (ax, ay), (bx, by) in pairwise(moved[1:]):
        made += f" Q{ax:.0f} {ay:.0f} {(ax + bx) / 2:.0f} {(ay + by) / 2:.0f}"
    return made + f" L{moved[-1][0]:.0f} {moved[-1][1]:.0f}"


def _crayon(strokes: list[_Stroke], seed: int, width: float, spread: float = 9.0) -> str:
    """Return strokes of a wax crayon, which leaves gaps on rough paint.

    Args:
        strokes: Points of each stroke on a square of 1000 x 1000 units.
        seed: Seed of the hand and of the grain.
        width: Width of the strokes.
        spread: Standard deviation of the hand from each point.
    """
    rng = np.random.default_rng(seed)
    grain = (
        "<filter id='g' x='0' y='0' width='1000' height='1000' filterUnits='userSpaceOnUse'>"
        f"<feTurbulence type='fractalNoise' baseFrequency='0.03' numOctaves='4' seed='{seed}'/>"
        "<feColorMatrix values='0 0 0 0 1  0 0 0 0 1  0 0 0 0 1  0 0 0 4.5 -1.15'/>"
        "<feComposite in='SourceGraphic' operator='in'/></filter>"
    )
    drawn = "".join(
        line(
            _curve(rng, stroke, spread),
            WHITE,
            width * rng.uniform(0.85, 1.15),
            f'stroke-linecap="round" stroke-opacity="{rng.uniform(0.75, 1.0):.2f}"',
        )
        for stroke in strokes
    )
    return svg(1000, 1000, f"<defs>{grain}</defs><g filter='url(#g)'>{drawn}</g>")


def _ring(seed: int, width: float, turns: float) -> str:
    """Return a ring whose ends cross or leave a gap.

    It encloses a circle around its middle with 3/4 of the drawing's width.
    """
    rng = np.random.default_rng(seed)
    steps = round(24 * turns)
    start, drift = rng.uniform(0, 2 * pi), rng.choice([-1, 1]) * rng.uniform(15, 35)
    lobes = [(n, rng.uniform(8, 20), rng.uniform(0, 2 * pi)) for n in (1.5, 2, 2.7)]
    points = []
    for k in range(steps + 1):
        angle = start + 2 * pi * turns * k / steps
        # several turns do not lie on one another
        radius = 440 + drift * (k / steps - 0.5)
        radius += sum(size * sin(n * angle + shift) for n, size, shift in lobes)
        points.append((500 + radius * cos(angle), 500 + radius * sin(angle)))
    return _crayon([points], seed, width, 3.0)


def _code(text: str, seed: int) -> str:
    """Return a short hand-written code that fills the drawing."""
    rng = np.random.default_rng(seed)
    step = 900 / len(text)
    strokes = []
    for i, char in enumerate(text):
        wide, tall = step * rng.uniform(0.6, 0.75) / 110, rng.uniform(3.4, 4.1)
        left, top = 70 + i * step, rng.uniform(60, 110)
        strokes += [[(left + wide * x, top + tall * y) for x, y in s] for s in _LETTERS[char]]
    return _crayon(strokes, seed, 55, 7.0)


CRAYON = {
    "crayon_ring_1": _ring(21, 30, 1.06),
    "crayon_ring_2": _ring(22, 30, 1.9),
    "crayon_ring_3": _ring(23, 27, 0.96),
    "crayon_ring_small_1": _ring(24, 50, 1.08),
    "crayon_ring_small_2": _ring(25, 55, 0.97),
    "crayon_arrow_1": _crayon(_ARROWS[0], 31, 50),
    "crayon_arrow_2": _crayon(_ARROWS[1], 32, 45),
    "crayon_cross": _crayon(_CROSS, 33, 50),
    "crayon_tick": _crayon(_TICK, 34, 55),
    "crayon_slashes": _crayon(_SLASHES, 35, 45),
    "crayon_code_1": _code("D2", 41),
    "crayon_code_2": _code("OK", 42),
    "crayon_code_3": _code("H", 43),
    "crayon_code_4": _code("15", 44),
    "crayon_code_5": _code("BR", 45),
    "crayon_code_6": _code("37", 46),
    "crayon_code_7": _code("X4", 47),
}
