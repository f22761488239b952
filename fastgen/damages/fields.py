"""Functions that several forms of damage share. shaders/damage_field.glsl is the GLSL twin."""

import numpy as np
from numpy.typing import NDArray

from fastgen.scene import Damage
from fastgen.scene.damage_kinds import (
    LEAST,
    PHASE,
    Array,
    Parameter,
    half_size,
    millimetres,
)

FADE_START_MM, FADE_END_MM = 260.0, 520.0
"""Distances |w| from the face between which a field fades to 0, so that it spares the opposite
wall."""

SOFTNESS = Parameter("softness of the folds, as a share of the depth", LEAST, 1.0)
"""Parameter of forms with rounded folds."""


def bump(t: Array) -> Array:
    """Return a smooth hill: 1 at t = 0, 0 for |t| >= 1, with zero slope at both."""
    return np.asarray(np.maximum(1 - t * t, 0.0) ** 2)


def smoothstep(low: float, high: float, x: Array) -> Array:
    """Return GLSL's smoothstep."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def above_zero(x: Array, softness: float) -> Array:
    """Return max(x, 0), with a parabola of length `softness` instead of the crease at 0."""
    x = np.maximum(x, 0.0)
    return np.asarray(np.where(x < softness, x * x / (2 * softness), x - softness / 2))


def lesser(a: Array, b: Array, softness: float) -> Array:
    """Return min(a, b), rounded where the two differ by less than `softness`.

    The quadratic smooth minimum of Inigo Quilez, https://iquilezles.org/articles/smin
    """
    t = np.clip(0.5 + 0.5 * (b - a) / softness, 0.0, 1.0)
    return np.asarray(b + (a - b) * t - softness * t * (1 - t))


FLAT_MM, DEEPEST_MM = 18.0, 48.0
"""Depth behind the outermost sheet to which corrugation is flattened, and depth of the deepest
sheet that is flattened. Gear in front of the sheet moves like the crests of the sheet."""


def to_flat(w: Array) -> Array:
    """Return the displacement [...] that flattens corrugation, for sheet at w [...]."""
    return np.asarray(FLAT_MM - np.clip(w, 0.0, DEEPEST_MM))


PROUD_MM = 25.0
"""Distance in front of the face up to which parts are marked; locking bars stand farther out."""


def in_contact(w: Array, contact_mm: float) -> NDArray[np.bool_]:
    """Test which points at w [...] are near enough to the face to be marked; bool [...]."""
    return np.asarray((w < contact_mm) & (w > -PROUD_MM))


def ripples(u: Array, v: Array, scale_mm: float, phase: float) -> Array:
    """Return smooth noise [...] between -1 and 1 at u and v [...].

    It is a sum of products of waves in five directions, whose wavelengths fall from 6 times
    `scale_mm`, on bent coordinates, so that it does not look periodic.
    """
    x, y = u / scale_mm, v / scale_mm
    x, y = x + 0.7 * np.sin(1.3 * y + phase), y + 0.7 * np.sin(1.1 * x - 2 * phase)
    total, size = np.zeros(np.shape(x)), 0.327
    for k in range(5):
        cos, sin = np.cos(2.4 * k + phase), np.sin(2.4 * k + phase)
        total = total + size * np.sin(cos * x - sin * y + 1.7 * k) * np.cos(
            sin * x + cos * y + phase
        )
        x, y, size = 1.53 * x, 1.53 * y, 0.75 * size
    return total


def patch(damage: Damage, u: Array, v: Array) -> Array:
    """Return a field [...] at u and v [...] that is above 0 in a patch with a ragged outline.

    The first three numbers of `Damage.shape` are those of PATCH. Nothing is above 0 outside the
    ellipse of the damage's size.
    """
    scale_mm, phase, cover, *_ = damage.shape
    half_length, half_width = half_size(damage)
    inside = 1 - (u / half_length) ** 2 - (v / half_width) ** 2
    return ripples(u, v, scale_mm, phase) - 1 + (1 + cover) * inside


def in_patch(damage: Damage, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
    """Test which points at u, v and w [...] are in such a patch and near enough to the face.

    The last number of `Damage.shape` is the depth up to which the patch reaches. bool [...].
    """
    return np.asarray((patch(damage, u, v) > 0) & in_contact(w, damage.shape[-1]))


PATCH = (
    millimetres("scale of the outline", 5.0),
    PHASE,
    Parameter("height of the middle of the patch", 0.0, 2.0),
)
"""Parameters of `patch`."""
