"""Bundle of parallel scratches to primer or steel, or with the paint of another object.

It moves nothing. shaders/damage_scraped.glsl is the GLSL twin.
"""

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.damage_forms.form import Array, Form, half_size
from fastgen.scene import Damage

PROUD_MM = 25.0
"""Distance in front of the face up to which parts are scraped; locking bars stand farther out."""


def _unmoved(_damage: Damage, u: Array, _v: Array, _w: Array) -> Array:
    return np.zeros(np.shape(u))


def _marked(damage: Damage, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
    """The ends are ragged: each height ends elsewhere."""
    pitch_mm, _, contact_mm, ragged_mm, phase, _ = damage.shape
    half_length, half_width = half_size(damage)
    ragged = 0.5 + 0.3 * np.sin(v / (3.1 * pitch_mm) + phase) + 0.2 * np.sin(v / pitch_mm - phase)
    outside = np.maximum(np.abs(v) - half_width, np.abs(u) - half_length + ragged_mm * ragged)
    return np.asarray((outside < 0) & (w < contact_mm) & (w > -PROUD_MM))


SCRAPED = Form("scrape", "plain", "scraped", _unmoved, half_size, marked=_marked)
