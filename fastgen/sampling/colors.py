"""Mixtures of colours, and the colour of fresh paint."""

import numpy as np

from fastgen.scene import Color


def mixed(first: Color, second: Color, share: float) -> Color:
    """Return a mixture of linear colours, with `share` of the second one."""
    red, green, blue = (
        round(float(a + share * (b - a)), 4) for a, b in zip(first, second, strict=True)
    )
    return red, green, blue


def fresh_paint(paint: Color, rng: np.random.Generator) -> Color:
    """Return paint of nearly the container's colour: mostly darker, because it has not faded.

    Args:
        paint: Linear colour of the container's paint.
        rng: Random generator of the fresh paint.
    """
    tone = rng.uniform(0.6, 0.88) if rng.random() < 0.7 else rng.uniform(1.08, 1.3)
    return mixed(_scaled(paint, tone), (float(np.mean(paint)),) * 3, float(rng.uniform(0, 0.12)))


def _scaled(color: Color, factor: float) -> Color:
    red, green, blue = (min(float(factor * part), 1.0) for part in color)
    return red, green, blue
