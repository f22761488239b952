"""Sheet that is pushed in or out and breaks into flat parts between sharp folds.

The displacement is a pyramid with five uneven sides, and the corrugation is flattened within.
shaders/damage_creased.glsl is the GLSL twin.
"""

from functools import lru_cache

import numpy as np

from fastgen.damages.fields import DEEPEST_MM, FLAT_MM, SOFTNESS, above_zero, lesser, to_flat
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import PHASE, Array, Form, Parameter, depth_span, half_size

SIDES = 5
EDGE_STEEPNESS = 2.5
"""Height at the centre of the planes that bring the pyramid to 0 at the edges of its size; its apex
is at 1."""

FLATTENED_AT = 0.4
"""Height of the pyramid, as a share of its apex, from which the corrugation is fully flattened."""


def _folded(shape: tuple[float, ...], x: Array, y: Array) -> Array:
    """Return the height [...] of the pyramid at x and y [...] in half sizes, below 0 outside it."""
    phase, softness = shape[0], shape[1 + SIDES]
    height = EDGE_STEEPNESS * lesser(1 - np.abs(x), 1 - np.abs(y), softness)
    for k in range(SIDES):
        angle = phase + 2 * np.pi * k / SIDES
        side = 1 - (np.cos(angle) * x + np.sin(angle) * y) / shape[1 + k]
        height = lesser(height, side, softness)
    return height


def _creased(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    half_length, half_width = half_size(damage)
    height = above_zero(
        _folded(damage.shape, u / half_length, v / half_width), damage.shape[1 + SIDES]
    )
    flattened = damage.shape[2 + SIDES] * np.minimum(height / FLATTENED_AT, 1.0)
    return np.asarray(damage.depth_mm * height + flattened * to_flat(w))


def _span(damage: Damage) -> tuple[float, float]:
    low, high = depth_span(damage)
    return low, high + damage.shape[2 + SIDES] * FLAT_MM


def _largest(damage: Damage) -> float:
    """Return the largest displacement, evaluated at the rounded apex and at FLATTENED_AT.

    The displacement is linear in the height of the pyramid below FLATTENED_AT and above it. Rounded
    folds lower the apex by up to nine tenths.
    """
    apex = _apex(damage.shape)
    height = np.array([[min(FLATTENED_AT, apex)], [apex]])
    flattened = damage.shape[2 + SIDES] * height / FLATTENED_AT
    ends = to_flat(np.array([0.0, DEEPEST_MM]))
    moved = damage.depth_mm * height + np.minimum(flattened, damage.shape[2 + SIDES]) * ends
    return float(np.abs(moved).max())


@lru_cache(256)
def _apex(shape: tuple[float, ...]) -> float:
    """Return the height of the rounded apex: at most 1, and 1 for sharp folds.

    Three grids, each finer and around the highest point so far, find it within 0.2 % in 0.3 ms.
    """
    softness = shape[1 + SIDES]
    # in every direction a side falls by 0.4 or more per half size, and folds round off `softness`
    half = min(1.0, 2.5 * softness)
    x = y = height = 0.0
    for width, count in ((half, 17), (half / 4, 13), (half / 16, 13)):
        step = np.linspace(-width, width, count)
        heights = _folded(shape, (x + step)[:, None], y + step)
        i, j = divmod(int(heights.argmax()), count)
        x, y, height = x + float(step[i]), y + float(step[j]), float(heights[i, j])
    return float(above_zero(np.array(height), softness))


CREASED = Form(
    name="creased",
    glsl="creased",
    shader="damage_creased.glsl",
    amount=_creased,
    span=_span,
    largest=_largest,
    parameters=(
        PHASE,
        *(
            Parameter(f"distance of side {k + 1}, as a share of half the size", 0.1, 2.0)
            for k in range(SIDES)
        ),
        SOFTNESS,
        Parameter("share by which the corrugation is flattened", 0.0, 1.0),
    ),
    constants={
        "CREASED_EDGE": f"{EDGE_STEEPNESS:.1f}",
        "CREASED_FLATTENED_AT": f"{FLATTENED_AT:g}",
    },
)
