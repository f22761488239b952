"""Crush marks on the outer ribs of corrugated sheet, in a row at one height.

A stiff object, such as a fork's tine, a neighbour or a lashing, is pressed against the wall. It
pushes in the crests of the corrugation and leaves the troughs alone.
shaders/damage_ribs.glsl is the GLSL twin.
"""

import numpy as np

from fastgen.geometry.damage_forms.form import Array, Form, above_zero, bump, half_size
from fastgen.scene import Damage


def _pressed(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    """The object is a round bar along u; sheet that it reaches moves to its surface."""
    softness_mm, ramp_mm, wobble, wavelength_mm, phase, give = damage.shape
    half_length, half_width = half_size(damage)
    beyond = np.maximum(np.abs(u) - (half_length - ramp_mm), 0.0) / ramp_mm
    uneven = (1 + wobble * np.sin(2 * np.pi * u / wavelength_mm + phase)) / (1 + wobble)
    object_mm = damage.depth_mm * np.maximum(uneven * bump(v / half_width) - beyond**2, 0.0)
    return give * above_zero(object_mm - np.maximum(w, 0.0), softness_mm)


RIBS = Form("dented", "ribs", _pressed, half_size)
