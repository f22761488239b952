"""The four kinds as section 3.3.2 of the SeaFront paper describes them.

Bent edges and bowed faces are smooth hills, dents are winding folds, and holes are stars.
shaders/damage_plain.glsl is the GLSL twin.
"""

import numpy as np

from fastgen.damages.fields import bump, smoothstep
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import PHASE, Array, Form, Parameter, half_size, millimetres

LOBES = 5
"""Harmonics of a hole's outline; higher ones would be finer than the mesh and most pixels."""

LOBE_LIMIT = 0.19
"""Largest amplitude of each harmonic, as a share of the mean radius. The sum of all harmonics then
stays below the radius, so the outline runs once around its centre."""

HOLE_REACH = 1 + LOBES * LOBE_LIMIT
"""Largest distance of a star's outline from its centre, in mean radii."""


def _edge(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    half_length, half_width = half_size(damage)
    return damage.depth_mm * bump(u / half_length) * bump(np.hypot(v, w) / half_width)


def _bow(damage: Damage, u: Array, v: Array, _w: Array) -> Array:
    half_length, half_width = half_size(damage)
    return damage.depth_mm * bump(u / half_length) * bump(v / half_width)


def _fold(damage: Damage, u: Array, v: Array, _w: Array) -> Array:
    half_length, half_width = half_size(damage)
    crease_mm, sink_share, *_ = damage.shape
    away = np.abs(v - fold_path_mm(damage, u))
    crease = np.maximum(1 - away / crease_mm, 0.0) ** 1.5
    sink = bump(away / half_width)
    taper = np.maximum(1 - (u / half_length) ** 2, 0.0)
    profile = (1 - sink_share) * crease + sink_share * sink
    return np.asarray(damage.depth_mm * taper * profile)


def fold_path_mm(damage: Damage, u: Array) -> Array:
    """Return v [...] in mm of a dent's fold at u [...]; it alternates between straight and
    sinusoidal stretches."""
    _, _, amplitude_mm, wavelength_mm, phase, stretch_mm = damage.shape[:6]
    # 0 on straight stretches, 1 on sinusoidal ones
    turn = smoothstep(-0.25, 0.25, np.sin(np.pi * u / stretch_mm + phase))
    path: Array = amplitude_mm * turn * np.sin(2 * np.pi * u / wavelength_mm)
    return path


def _fold_reach(damage: Damage) -> tuple[float, float]:
    u, v = half_size(damage)
    crease_mm, _, amplitude_mm, *_ = damage.shape
    return u, max(v, crease_mm) + abs(amplitude_mm)  # the fold swings aside


def hole_radius_mm(damage: Damage, angle: Array) -> Array:
    """Return the radius [...] in mm of a star's outline at angles [...] in radians."""
    ratio = np.ones_like(np.asarray(angle, np.float64))
    for k in range(LOBES):
        size, phase = damage.shape[1 + 2 * k], damage.shape[2 + 2 * k]
        ratio = ratio + size * np.cos((2 + k) * angle + phase)
    return damage.size_mm[0] / 2 * ratio


def _outside_star(damage: Damage, u: Array, v: Array) -> Array:
    outside: Array = np.hypot(u, v) - hole_radius_mm(damage, np.arctan2(v, u))
    return outside


def _star(damage: Damage, u: Array, v: Array, _w: Array) -> Array:
    rim = np.clip(1 - _outside_star(damage, u, v) / damage.shape[0], 0.0, 1.0)
    return np.asarray(damage.depth_mm * rim**2)


def _star_reach(damage: Damage) -> tuple[float, float]:
    reach = damage.size_mm[0] / 2 * HOLE_REACH + damage.shape[0]
    return reach, reach


_SHADER = "damage_plain.glsl"

STAR = Form(
    name="plain",
    glsl="star",
    shader=_SHADER,
    amount=_star,
    reach=_star_reach,
    outline=_outside_star,
    parameters=(
        millimetres("width of the rim"),
        *(
            parameter
            for k in range(2, 2 + LOBES)
            for parameter in (
                Parameter(f"share of harmonic {k}", -LOBE_LIMIT, LOBE_LIMIT),
                Parameter(f"phase in radians of harmonic {k}", PHASE.low, PHASE.high),
            )
        ),
    ),
)
FOLD = Form(
    name="plain",
    glsl="fold",
    shader=_SHADER,
    amount=_fold,
    reach=_fold_reach,
    parameters=(
        millimetres("half width of the crease"),
        Parameter("depth of the sunken area, as a share of the depth", 0.0, 1.0),
        millimetres("amplitude", PHASE.low),
        millimetres("wavelength"),
        PHASE,
        millimetres("stretch length"),
    ),
)
BOW = Form(name="plain", glsl="bow", shader=_SHADER, amount=_bow)
EDGE = Form(name="plain", glsl="edge", shader=_SHADER, amount=_edge, along_edge=True)
