"""Damages with random parameters from the ranges that scenes allow, for tests of every form."""

import numpy as np

from fastgen.classes import BUNDLED_DAMAGE_CLASSES
from fastgen.geometry.damage_law import reach_mm
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import forms_of, kind_named

LONGEST_MM = 2000.0
"""Largest size, depth and parameter in millimetres; scenes may have longer ones."""

_NAMES = {
    form.glsl: (kind, form.name)
    for kind in BUNDLED_DAMAGE_CLASSES
    for form in kind_named(kind).forms
}
FORMS = {_NAMES[form.glsl]: form for form in forms_of(BUNDLED_DAMAGE_CLASSES)}
"""Forms by kind and name, in the order in which the shaders go through them."""

FORM_NAMES = list(FORMS)
AXES = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))


def random_damage(rng, kind, form):
    """Return a damage at the origin; some of its parameters have their lowest or highest value."""
    return Damage(
        kind=kind,
        face="front.underside" if kind == "axis" else "front",
        origin_mm=(0.0, 0.0, 0.0),
        along=AXES[0],
        across=AXES[1],
        inward=AXES[2],
        size_mm=(_length(rng, 5.0), _length(rng, 5.0)),
        depth_mm=float(rng.choice([-1, 1, 1])) * _length(rng, 1.0),
        shape=tuple(_drawn(rng, each.low, each.high) for each in FORMS[kind, form].parameters),
        form=form,
    )


def _length(rng, least):
    return float(np.exp(rng.uniform(np.log(least), np.log(LONGEST_MM))))


def _drawn(rng, low, high):
    low, high = max(low, -LONGEST_MM), min(high, LONGEST_MM)
    if rng.random() < 0.3:
        return float(rng.choice([low, high]))
    if low > 0 and high / low > 100:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return float(rng.uniform(low, high))


def points_around(rng, damage, count):
    """Return points in and around the reach, mostly near its limits.

    They are given as local coordinates [N, 3] and as positions [N, 3].
    """
    share = rng.uniform(-1.1, 1.1, (count, 3))
    edge = rng.integers(4, size=count)  # 3 leaves all three coordinates as they are
    rows = np.flatnonzero(edge < 3)
    sign = rng.choice([-1.0, 1.0], len(rows))
    share[rows, edge[rows]] = sign * rng.choice([0.999, 1.001, 1.2, 2.0], len(rows))
    local = share * np.array(reach_mm(damage))
    return local, local @ np.array(AXES)
