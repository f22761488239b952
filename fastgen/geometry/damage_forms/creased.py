"""Sheet that is pushed in or out and breaks into flat parts between sharp folds.

The displacement is a pyramid with five uneven sides, and the corrugation is flattened within.
shaders/damage_creased.glsl is the GLSL twin.
"""

import numpy as np

from fastgen.geometry.damage_forms.form import Array, Form, above_zero, half_size, lesser
from fastgen.scene import Damage

SIDES = 5
EDGE_STEEPNESS = 2.5
"""Height at the centre of the planes that bring the pyramid to 0 at the edges of its size; its apex
is at 1."""

FLATTENED_AT = 0.4
"""Height of the pyramid, as a share of its apex, from which the corrugation is fully flattened."""

LEVEL_MM, DEEPEST_MM = 18.0, 48.0
"""Depth behind the outermost sheet to which the corrugation is flattened, and depth of the deepest
sheet that is flattened. Gear in front of the sheet moves like the crests of the sheet."""


def _pyramid(damage: Damage, u: Array, v: Array) -> Array:
    """Return the height [...] of the pyramid, 0..1, at u and v [...]."""
    half_length, half_width = half_size(damage)
    phase, softness = damage.shape[0], damage.shape[1 + SIDES]
    x, y = u / half_length, v / half_width
    height = EDGE_STEEPNESS * lesser(1 - np.abs(x), 1 - np.abs(y), softness)
    for k in range(SIDES):
        angle = phase + 2 * np.pi * k / SIDES
        side = 1 - (np.cos(angle) * x + np.sin(angle) * y) / damage.shape[1 + k]
        height = lesser(height, side, softness)
    return above_zero(height, softness)


def _creased(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    height = _pyramid(damage, u, v)
    flattened = damage.shape[2 + SIDES] * np.minimum(height / FLATTENED_AT, 1.0)
    level = LEVEL_MM - np.clip(w, 0.0, DEEPEST_MM)
    return np.asarray(damage.depth_mm * height + flattened * level)


CREASED = Form("concave", "creased", _creased, half_size)
