"""Graffiti: a tag of one sprayed line with drips.

It moves nothing. shaders/damage_graffiti.glsl is the GLSL twin.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from fastgen.damages.draws import (
    MOST_CONTACT_MM,
    Contact,
    Extent,
    Size,
    draw,
    draw_angle,
    fitted,
)
from fastgen.damages.fields import in_contact
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import (
    PHASE,
    Array,
    Form,
    Kind,
    Parameter,
    SheetForm,
    Wear,
    half_size,
    millimetres,
)
from fastgen.validation import Bounds, Range

PIECES = 48
"""Straight pieces of the line."""

DRIP_EVERY, DRIP_WIDTH = 7, 0.16
"""Number of pieces between drips, and width of a drip as a share of the width of the line."""

SLOW, FAST = 0.37, 1.83
"""Frequencies of the waves that make the letters differ, relative to one wave per letter."""

_PAINTS = (
    *((0.012, 0.012, 0.014), (0.72, 0.72, 0.7), (0.5, 0.5, 0.52), (0.45, 0.02, 0.03)),
    *((0.02, 0.06, 0.4), (0.02, 0.28, 0.06), (0.75, 0.45, 0.02), (0.55, 0.03, 0.28)),
)
"""Linear albedo of spray paints; all are equally likely."""

_LOOP = Range(0.1, 0.8)
"""Width of the loops, as a share of the letters' height."""

_OPACITY = Range(0.8, 1.0)
"""Share of the surface that the paint covers."""


@dataclass(frozen=True)
class GraffitiConfig:
    """Tag of one sprayed line.

    Attributes:
        length_mm: Length of the tag.
        height_mm: Height of its letters.
        letters: Number of its loops, which stand for letters.
        line_mm: Width of the line.
        drip_mm: Length of the longest drip.
        contact_mm: Depth behind the outermost sheet that paint reaches.
        turn_deg: Angle between the tag and the horizontal.
    """

    length_mm: Extent = Range(600, 2600)
    height_mm: Extent = Range(300, 900)
    letters: Annotated[Range, Bounds(1.0, 12.0)] = Range(3, 7)
    line_mm: Annotated[Range, Bounds(5.0, 200.0, "mm")] = Range(35, 90)
    drip_mm: Annotated[Range, Bounds(0.0, 1000.0, "mm")] = Range(0, 200)
    contact_mm: Contact = Range(60, 120)
    turn_deg: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(-10, 10)


def outside_mm(damage: Damage, u: Array, v: Array) -> Array:
    """Return the distance [...] in mm at u and v [...] from the line, negative on it."""
    line_mm, _, _, _, _, drip_mm, _ = damage.shape
    drawn = np.full(np.shape(u), np.inf)
    points = _line(damage)
    for k in range(PIECES):
        (x0, y0), (x1, y1) = points[k], points[k + 1]
        x, y = x1 - x0, y1 - y0
        t = np.clip(((u - x0) * x + (v - y0) * y) / max(x * x + y * y, 1e-12), 0.0, 1.0)
        drawn = np.minimum(drawn, np.hypot(u - x0 - t * x, v - y0 - t * y))
        if k % DRIP_EVERY == DRIP_EVERY // 2:
            run = drip_mm * (0.5 + 0.5 * math.sin(1.7 * k + damage.shape[3]))
            drop = np.hypot(u - x0, v - np.clip(v, y0 - run, y0))
            drawn = np.minimum(drawn, drop + 0.5 * (1 - DRIP_WIDTH) * line_mm)
    return drawn - 0.5 * line_mm


def _line(damage: Damage) -> NDArray[np.float64]:
    """Return the ends [PIECES + 1, 2] of the pieces, in mm along and across."""
    line_mm, letters, loop, phase, uneven, drip_mm, _ = damage.shape
    half_length, half_width = half_size(damage)
    high = max(half_width - 0.5 * (line_mm + drip_mm), 1.0)
    wide = max(half_length - 0.5 * line_mm - loop * high, 1.0)
    t = np.linspace(-1.0, 1.0, PIECES + 1)
    angle = np.pi * letters * t + phase
    slow, fast = SLOW * angle + 2 * phase, FAST * angle
    large = (1 - uneven) * np.sin(angle) + uneven * np.sin(slow)
    x = wide * t + loop * high * (0.6 * np.cos(angle) + 0.4 * np.cos(fast))
    y = high * (0.7 * large + 0.3 * np.sin(fast))
    return np.stack([x, y + 0.5 * drip_mm], axis=-1)


def _marked(damage: Damage, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
    u, v, w = np.broadcast_arrays(u, v, w)
    half_length, half_width = half_size(damage)
    marked = (np.abs(u) < half_length) & (np.abs(v) < half_width) & in_contact(w, damage.shape[6])
    marked[marked] = outside_mm(damage, u[marked], v[marked]) < 0
    return np.asarray(marked)


def _draw(c: GraffitiConfig, _face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    turn, line, drip = draw(rng, c.turn_deg), draw(rng, c.line_mm), draw(rng, c.drip_mm)
    height = draw(rng, c.height_mm) + line + drip
    length, height = fitted((draw(rng, c.length_mm), height), size, turn)
    shape = (
        line,
        draw(rng, c.letters),
        draw(rng, _LOOP, digits=3),
        draw_angle(rng),
        draw(rng, Range(0.0, 0.6), digits=3),
        min(drip, round(0.5 * height, 2)),
        draw(rng, c.contact_mm),
    )
    paint = _PAINTS[int(rng.integers(len(_PAINTS)))]
    wear = Wear(draw(rng, _OPACITY, digits=3), fresh=1.0, bare_albedo=paint)
    return SheetForm((length, round(height, 2)), shape=shape, turn_deg=turn, wear=wear)


KIND = Kind(
    "graffiti",
    (
        Form(
            name="plain",
            glsl="graffiti",
            shader="damage_graffiti.glsl",
            marked=_marked,
            parameters=(
                millimetres("width of the line"),
                Parameter("number of loops", 0.1, 12.0),
                Parameter("width of the loops, as a share of their height", 0.0, 2.0),
                PHASE,
                Parameter("unevenness of the height", 0.0, 1.0),
                millimetres("length of the longest drip", 0.0),
                millimetres("depth behind the face that paint reaches", high=MOST_CONTACT_MM),
            ),
            constants={
                "GRAFFITI_PIECES": PIECES,
                "GRAFFITI_SLOW": SLOW,
                "GRAFFITI_FAST": FAST,
                "GRAFFITI_DRIP_EVERY": DRIP_EVERY,
                "GRAFFITI_DRIP_WIDTH": DRIP_WIDTH,
            },
        ),
    ),
    GraffitiConfig,
    _draw,
)
