"""A form of damage, and functions that several forms use.

Local coordinates of a point at rest are u along the damage, v across it and w inward, in mm from
its origin. Every field is zero outside its reach.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.scene import Damage

Array = NDArray[np.floating]

FADE_START_MM, FADE_END_MM = 260.0, 520.0
"""Distances |w| from the face between which a field fades to 0, so that it spares the opposite
wall."""


def depth_span(damage: Damage) -> tuple[float, float]:
    """Return 0 and the depth of a damage, the lower one first."""
    return min(damage.depth_mm, 0.0), max(damage.depth_mm, 0.0)


def full_depth(damage: Damage) -> float:
    """Return the largest displacement of most forms, which reach their depth somewhere."""
    return abs(damage.depth_mm)


@dataclass(frozen=True)
class Form:
    """One form of one kind of damage.

    Attributes:
        kind: One of classes.ALL_DAMAGE_CLASSES.
        name: Value of `Damage.form`.
        glsl: Name in the shaders, such as "star" in `star_field` (its displacement) and
            `outside_star` (its outline).
        amount: Function of a damage and of u, v and w [...] to the displacement along its inward
            axis [...] in mm, without the fade that keeps it off the opposite wall.
        reach: Function of a damage to the distances along and across within which it acts.
        span: Function of a damage to the lowest and the highest displacement of the outermost
            sheet in mm, 0 included. They are bounds that some damages do not reach.
        largest: Function of a damage to the largest magnitude of its displacement in mm.
        outline: Function of a damage and of u and v [...] to the distance [...] in mm outside its
            hole, negative within. None for forms without a hole.
        marked: Function of a damage and of u, v and w [...] to bool [...]: a form without
            displacement changes the surface there. None for other forms.
        along_edge: True for a form that bends an edge of the container. It acts up to its reach
            across in every direction from the edge, and does not fade.
    """

    kind: str
    name: str
    glsl: str
    amount: Callable[[Damage, Array, Array, Array], Array]
    reach: Callable[[Damage], tuple[float, float]]
    span: Callable[[Damage], tuple[float, float]] = depth_span
    largest: Callable[[Damage], float] = full_depth
    outline: Callable[[Damage, Array, Array], Array] | None = None
    marked: Callable[[Damage, Array, Array, Array], NDArray[np.bool_]] | None = None
    along_edge: bool = False


def half_size(damage: Damage) -> tuple[float, float]:
    """Return half of a damage's length and width in mm, the reach of most forms."""
    return damage.size_mm[0] / 2, damage.size_mm[1] / 2


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
