"""Torn sheet: slits, flaps, triangles and Ls with curled lips.

A slit runs along u. Its two lips gape by different amounts, evenly or like a wedge, with ragged
edges. A second slit at its end, across it, makes an L. shaders/damage_torn.glsl is the GLSL twin.
"""

import numpy as np

from fastgen.scene import Damage
from fastgen.scene.damage_kinds import PHASE, Array, Form, Parameter, half_size, millimetres

WEDGE_END = 5.0
"""Steepness of the blunt end of a wedge."""

TEETH_MM = (90.0, 37.0)
"""Wavelengths of the ragged edges."""

ARM_GAPE = 0.7
"""Gape of the second slit, as a share of the first."""

ANYWHERE_MM = 1e6


def _ragged_mm(damage: Damage, u: Array, phase: float) -> Array:
    long, short = (2 * np.pi * u / wave for wave in TEETH_MM)
    # phase modulation keeps the teeth from repeating
    irregular = 1.4 * np.sin(0.31 * long + phase)
    teeth = np.sin(long + phase + irregular) + 0.6 * np.sin(short + 2.3 * phase + 2 * irregular)
    return np.asarray(damage.shape[3] / 1.6 * teeth)


def outside_mm(damage: Damage, u: Array, v: Array) -> Array:
    """Return about the distance [...] in mm from the hole at u and v [...], negative within."""
    _, belly, wedge, _, phase, arm_mm, *_ = damage.shape
    half_length, half_gape = half_size(damage)
    t = u / half_length
    even = np.maximum(1 - t * t, 0.0)
    wedged = np.maximum(np.minimum(0.5 * (1 + t), WEDGE_END * (1 - t)), 0.0)
    gape = even + wedge * (wedged - even)
    teeth = np.minimum(4 * gape, 1.0)
    upper = 2 * half_gape * gape * (1 - belly) + teeth * _ragged_mm(damage, u, phase)
    lower = 2 * half_gape * gape * belly + teeth * _ragged_mm(damage, u, phase + 2.0)
    outside = np.maximum(np.maximum(v - upper, -v - lower), np.abs(u) - half_length)
    half_arm = max(arm_mm, 1.0) / 2
    s = v / half_arm - 1
    gape_mm = ARM_GAPE * half_gape * np.maximum(1 - s * s, 0.0)
    across = np.abs(u - (half_length - half_gape)) - gape_mm
    arm = np.maximum(across, np.abs(v - half_arm) - half_arm)
    return np.asarray(np.minimum(outside, arm + (ANYWHERE_MM if arm_mm < 1 else 0.0)))


def _torn(damage: Damage, u: Array, v: Array, _w: Array) -> Array:
    """The lips bend inward; with `twist` the lower one less, or outward."""
    rim_mm, twist = damage.shape[0], damage.shape[6]
    rim = np.clip(1 - outside_mm(damage, u, v) / rim_mm, 0.0, 1.0)
    upward = v / (np.abs(v) + half_size(damage)[1])
    return np.asarray(damage.depth_mm * rim**2 * (1 - twist * (0.5 - 0.5 * upward)))


def _reach(damage: Damage) -> tuple[float, float]:
    rim_mm, jag_mm, arm_mm = damage.shape[0], damage.shape[3], damage.shape[5]
    half_length, half_gape = half_size(damage)
    across = max(2 * half_gape + jag_mm, arm_mm)
    # a second slit that is wider than the first is long extends beyond the start of the first
    along = half_length + max(half_gape, (1 + ARM_GAPE) * half_gape - 2 * half_length)
    return along + rim_mm, across + rim_mm


_PLACES = 33
"""Places across the lower lip between which its displacement is bounded."""


def _span(damage: Damage) -> tuple[float, float]:
    """Return bounds of the displacement; a lower lip with `twist` above 1 may bend outward.

    Between two places below the slit, the lip bends no more than at the place nearer to the slit,
    and its outward share is no larger than at the farther one.
    """
    rim_mm, belly, _, jag_mm, *_, twist = damage.shape
    _, half_gape = half_size(damage)
    edge_mm = 2 * half_gape * belly + jag_mm
    below = np.linspace(0.0, edge_mm + rim_mm, _PLACES)
    rim = 1 - np.maximum(below[:-1] - edge_mm, 0.0) / rim_mm
    lower = 0.5 + 0.5 * below[1:] / (below[1:] + half_gape)
    least = min(float((rim**2 * (1 - twist * lower)).min()), 0.0)
    upper_mm, lower_mm = damage.depth_mm, damage.depth_mm * least
    return min(upper_mm, lower_mm), max(upper_mm, lower_mm)


TORN = Form(
    name="torn",
    glsl="torn",
    shader="damage_torn.glsl",
    amount=_torn,
    reach=_reach,
    span=_span,
    outline=outside_mm,
    parameters=(
        millimetres("width of the rim"),
        Parameter("share of the gape below the line of the tear", 0.0, 1.0),
        Parameter("likeness to a wedge", 0.0, 1.0),
        millimetres("height of the teeth", 0.0),
        PHASE,
        millimetres("length of the second slit", 0.0),
        Parameter("amount by which the lower lip bends less than the upper", 0.0, 2.0),
    ),
    constants={
        "TORN_WEDGE_END": f"{WEDGE_END:.1f}",
        "TORN_LONG_TEETH_MM": f"{TEETH_MM[0]:.1f}",
        "TORN_SHORT_TEETH_MM": f"{TEETH_MM[1]:.1f}",
        "TORN_ARM_GAPE": f"{ARM_GAPE:g}",
    },
)
