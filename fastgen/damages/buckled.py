"""Corrugated sheet whose ribs buckle along one line.

A rib is stiff along its length. Pushed in, it bends at one place, where its crest is crushed, and
stays nearly straight on both sides. Adjacent ribs bend at about the same height, so the bends form
a line across the ribs. shaders/damage_buckled.glsl is the GLSL twin.
"""

import numpy as np

from fastgen.damages.fields import DEEPEST_MM, FLAT_MM, above_zero, bump, lesser, to_flat
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import LEAST, PHASE, Array, Form, Parameter, depth_span, half_size

_PLACES = 1025
"""Number of distances from the line, up to the length of the crushed part, at which `_largest`
evaluates the displacement."""


def _height(damage: Damage, u: Array, off: Array) -> Array:
    """Return the displacement as a share of the depth, before rounding; below 0 outside.

    Args:
        damage: The damage.
        u: Distance along the damage, across the ribs, [...] in mm.
        off: Distance from the line along the ribs, [...] in half widths.
    """
    rounding, _, tilt, wobble, *_ = damage.shape
    # farthest bend from the line in half widths; the tilted line then stays within the width
    reach = 1 - abs(tilt) - wobble
    sides = lesser(-off, off, 2 * rounding * reach)
    return np.asarray(bump(u / half_size(damage)[0]) + sides / reach)


def _off(damage: Damage, u: Array, v: Array) -> Array:
    """Return the distance [...] from the line along the ribs, in half widths."""
    _, _, tilt, wobble, wavelength_mm, phase, *_ = damage.shape
    half_length, half_width = half_size(damage)
    line = tilt * u / half_length + wobble * np.sin(2 * np.pi * u / wavelength_mm + phase)
    return np.asarray(v / half_width - line)


def _moved(damage: Damage, u: Array, off: Array, w: Array) -> Array:
    _, softness, *_, crushed, crushed_mm = damage.shape
    height = above_zero(_height(damage, u, off), softness)
    here = crushed * bump(off * half_size(damage)[1] / crushed_mm) * height
    return np.asarray(damage.depth_mm * height + here * to_flat(w))


def _buckled(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    return _moved(damage, u, _off(damage, u, v), w)


def _span(damage: Damage) -> tuple[float, float]:
    low, high = depth_span(damage)
    return low, high + damage.shape[6] * FLAT_MM


def _largest(damage: Damage) -> float:
    """Return the largest displacement, which is that of the middle rib, near the line."""
    _, half_width = half_size(damage)
    off = np.linspace(0, min(damage.shape[7] / half_width, 1.0), _PLACES)[:, None]
    moved = _moved(damage, np.zeros(1), off, np.array([0.0, DEEPEST_MM]))
    return float(np.abs(moved).max())


BUCKLED = Form(
    name="buckled",
    glsl="buckled_ribs",
    shader="damage_buckled.glsl",
    amount=_buckled,
    span=_span,
    largest=_largest,
    parameters=(
        Parameter("length of the rounded bend at the line, as a share of the reach", LEAST, 0.5),
        Parameter("length over which the bend fades out, as a share of the reach", LEAST, 1.0),
        Parameter("offset of the line at the end of the length, in half widths", -0.5, 0.5),
        Parameter("amplitude of the line's swings, in half widths", 0.0, 0.4),
        Parameter("wavelength of the swings in mm", 20.0, 1e5),
        PHASE,
        Parameter("share by which the corrugation is crushed at the line", 0.0, 1.0),
        Parameter("length of the crushed part to each side of the line in mm", 5.0, 1e4),
    ),
)
