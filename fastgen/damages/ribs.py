"""Crush marks on the outer ribs of corrugated sheet, in a row at one height.

A stiff object, such as a fork's tine, a neighbour or a lashing, is pressed against the wall. It
pushes in the crests of the corrugation and leaves the troughs alone.
shaders/damage_ribs.glsl is the GLSL twin.
"""

import numpy as np

from fastgen.damages.fields import above_zero, bump
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import PHASE, Array, Form, Parameter, half_size, millimetres

_PLACES = 129
"""Places along a row at which its largest displacement is looked for."""


def _profile(damage: Damage, u: Array, across: Array | float = 1.0) -> Array:
    """Return how far the object reaches in at u [...], as a share of the depth."""
    _, ramp_mm, wobble, wavelength_mm, phase, _ = damage.shape
    half_length, _ = half_size(damage)
    beyond = np.maximum(np.abs(u) - (half_length - ramp_mm), 0.0) / ramp_mm
    uneven = (1 + wobble * np.sin(2 * np.pi * u / wavelength_mm + phase)) / (1 + wobble)
    return np.asarray(np.maximum(uneven * across - beyond**2, 0.0))


def _pressed(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    """The object is a round bar along u; sheet that it reaches moves to its surface."""
    softness_mm, *_, give = damage.shape
    _, half_width = half_size(damage)
    object_mm = damage.depth_mm * _profile(damage, u, bump(v / half_width))
    return give * above_zero(object_mm - np.maximum(w, 0.0), softness_mm)


def _largest(damage: Damage) -> float:
    """Return the displacement where the bar reaches in farthest.

    This is near the crest of the unevenness closest to the middle of the row. A row without a crest
    is searched at evenly spaced places.
    """
    softness_mm, _, _, wavelength_mm, phase, give = damage.shape
    half_length, _ = half_size(damage)
    turns = (0.5 * np.pi - phase) / (2 * np.pi)
    crest = (turns - np.rint(turns)) * wavelength_mm
    u = np.append(np.linspace(-half_length, half_length, _PLACES), crest)
    object_mm = damage.depth_mm * _profile(damage, u).max()
    return float(give * above_zero(object_mm, softness_mm))


RIBS = Form(
    name="ribs",
    glsl="ribs",
    shader="damage_ribs.glsl",
    amount=_pressed,
    largest=_largest,
    parameters=(
        millimetres("length over which the edge of a mark is rounded"),
        millimetres("length over which the row runs out at its ends"),
        Parameter("unevenness of the depth along the row", 0.0, 1.0),
        millimetres("wavelength of the unevenness"),
        PHASE,
        Parameter("displacement, as a share of how far the object reaches in", 0.0, 1.0),
    ),
)
