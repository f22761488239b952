"""Limits of ranges and random draws that several kinds of damage share."""

import math
from typing import Annotated

import numpy as np

from fastgen.scene import Color, Vec3
from fastgen.scene.damage_kinds import STEEL, Wear
from fastgen.validation import Bounds, Range

Size = tuple[float, float]

Extent = Annotated[Range, Bounds(5.0, 20000.0, "mm")]
"""Extent that is cut to the size of the face. Fields are divided by it, so it must not vanish."""

MOST_REACH_MM = 2400.0
"""Largest reach of a damage."""

Reach = Annotated[Range, Bounds(5.0, MOST_REACH_MM, "mm")]
"""Extent that is not cut to the size of the face."""

Depth = Annotated[Range, Bounds(0.0, 2400.0, "mm")]
"""Displacement. A container is 2438 mm wide; a deeper dent would come out on the other side."""

MOST_CONTACT_MM = 200.0
"""Largest depth behind the face up to which a damage marks the sheet, four times the depth of the
corrugation. A limit a few times larger would reach the opposite wall."""

Contact = Annotated[Range, Bounds(5.0, MOST_CONTACT_MM, "mm")]
"""Depth behind the outermost sheet up to which it is marked."""

FRAME_MM = 190.0
"""Width of the posts and rails around a face, which sheet damages stay clear of."""

_BARE, _BARE_SHARES = (STEEL, (0.26, 0.26, 0.27), (0.27, 0.09, 0.05)), (0.5, 0.3, 0.2)
"""Linear albedo of bare places, steel and two primers, and how frequent each is."""

_PAINT_LOSS = (0.0, 0.3, 0.7, 1.0)
"""Values of `Wear.paint_loss`, all equally likely."""

_FRESH, _FRESH_SHARES = (0.0, 0.5, 1.0), (0.5, 0.25, 0.25)
"""Values of `Wear.fresh`, and how frequent each is."""


def draw(rng: np.random.Generator, values: Range, most: float = math.inf, digits: int = 2) -> float:
    """Draw a rounded value, at most `most`."""
    return round(min(values.draw(rng), most), digits)


def draw_wear(rng: np.random.Generator) -> Wear:
    """Draw a surface: some damages keep their paint, some are bright, some are rusty."""
    return Wear(
        paint_loss=float(rng.choice(_PAINT_LOSS)),
        fresh=float(rng.choice(_FRESH, p=_FRESH_SHARES)),
        bare_albedo=draw_bare(rng),
    )


def draw_bare(rng: np.random.Generator) -> Color:
    """Draw the albedo of a bare place: steel or a primer."""
    return _BARE[int(rng.choice(len(_BARE), p=_BARE_SHARES))]


def draw_angle(rng: np.random.Generator) -> float:
    """Draw an angle of a full turn, in radians."""
    return round(float(rng.uniform(0, 2 * math.pi)), 4)


def turned(size: Size, turn_deg: float) -> Size:
    """Return the width and height of an upright box around a turned rectangle."""
    cos, sin = (abs(f(math.radians(turn_deg))) for f in (math.cos, math.sin))
    return cos * size[0] + sin * size[1], sin * size[0] + cos * size[1]


def rounded_vector(v: np.ndarray, digits: int = 6) -> Vec3:
    """Return a vector with rounded coordinates."""
    x, y, z = (round(float(c), digits) + 0.0 for c in v)
    return x, y, z


def fitted(extents: Size, face: Size, turn_deg: float = 0.0) -> Size:
    """Return length and width, both shortened if their turned rectangle exceeds the face's sheet.

    Args:
        extents: Length and width, mm.
        face: Width and height of the face, mm.
        turn_deg: Angle of the length against the horizontal.
    """
    box = turned(extents, turn_deg)
    fit = min(1.0, *((side - 2 * FRAME_MM) / e for side, e in zip(face, box, strict=True)))
    return round(fit * extents[0], 2), round(fit * extents[1], 2)
