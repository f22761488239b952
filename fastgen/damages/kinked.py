"""A local kink of an edge: a notch in a rail, or a post that is bent at one height.

shaders/damage_kinked.glsl is the GLSL twin.
"""

import numpy as np

from fastgen.damages.fields import SOFTNESS, above_zero, bump, lesser
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import Array, Form, Parameter, half_size


def _kinked(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    """The notch has two straight flanks; its deepest point is at `apex` half lengths."""
    apex, softness = damage.shape
    half_length, half_width = half_size(damage)
    t = u / half_length
    notch = lesser((1 + t) / (1 + apex), (1 - t) / (1 - apex), softness)
    away = np.hypot(v, w) / half_width
    return np.asarray(damage.depth_mm * above_zero(notch, softness) * bump(away))


def _largest(damage: Damage) -> float:
    """Return the displacement at the rounded tip of the notch, where its slope is 0."""
    apex, softness = damage.shape
    tip = above_zero(np.array(1 - softness * (1 - apex * apex) / 4), softness)
    return abs(damage.depth_mm) * float(tip)


KINKED = Form(
    name="kinked",
    glsl="kinked",
    shader="damage_kinked.glsl",
    amount=_kinked,
    largest=_largest,
    along_edge=True,
    parameters=(
        Parameter("place of the deepest point, in half lengths from the middle", -0.9, 0.9),
        SOFTNESS,
    ),
)
