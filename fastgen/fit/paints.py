"""Weights of paints from the colours of photographs, in closed form."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fastgen.config.fields import linear_color
from fastgen.config.surface import SurfaceConfig
from fastgen.fit.statistics import Pixels, planes_of, sky_like
from fastgen.srgb import DECODED

Array = NDArray[np.float64]

_COLORED = 0.5
"""Least distance from grey in stops, above which a paint can be told from its surroundings."""

_FLOOR = 0.02
_LARGEST_FACTOR = 6.0
_EACH = 7
"""Only every seventh pixel counts; neighbours have the same colour."""


def paint_weights(
    surface: SurfaceConfig, photographs: Iterable[Pixels], renders: Iterable[Pixels]
) -> dict[str, float]:
    """Return weights of paints that bring the colours of renders to those of photographs.

    Each coloured pixel counts for the paint with the nearest ratios of red and blue to green, which
    hardly depend on brightness. The weight of a paint changes by the ratio of its share in the
    photographs to that in the renders; the surroundings occur in both and cancel out. Grey paints
    cannot be told from ground and sky, and keep their weight.

    Args:
        surface: Paints with their present weights.
        photographs: Photographs, uint8 [H, W, 3].
        renders: Pictures rendered with these weights.

    Returns:
        Weight of every paint; the sum over coloured paints is as before.
    """
    ratios = {name: _ratios(np.array(linear_color(c))) for name, c in surface.colors.items()}
    old = dict(zip(surface.colors, surface.weights, strict=True))
    names = [n for n, r in ratios.items() if np.hypot(*r) >= _COLORED and old[n] > 0]
    if len(names) < 2:
        return old
    palette = np.array([ratios[name] for name in names])
    real, ours = (_shares(pictures, palette) for pictures in (photographs, renders))
    factor = np.clip((real + _FLOOR) / (ours + _FLOOR), 1 / _LARGEST_FACTOR, _LARGEST_FACTOR)
    changed = np.array([old[name] for name in names]) * factor
    changed *= sum(old[name] for name in names) / changed.sum()
    return old | {name: float(f"{w:.3g}") for name, w in zip(names, changed, strict=True)}


def _ratios(light: Array) -> Array:
    """Return red and blue over green in stops, [..., 2], of linear light [..., 3]."""
    stops = np.log2(np.maximum(light, 2e-3))
    return np.asarray(stops[..., [0, 2]] - stops[..., [1]])


def _shares(pictures: Iterable[Pixels], palette: Array) -> Array:
    """Return the mean over pictures of the share of pixels nearest to each color of a palette."""
    total, count = np.zeros(len(palette)), 0
    for pixels in pictures:
        p = planes_of(pixels)
        seen = (p.grey > 0.08) & (p.saturation > 0.25) & ~sky_like(p)
        found = _ratios(DECODED[pixels[seen][::_EACH]].astype(np.float64))
        if len(found):
            nearest = np.argmin(((found[:, None] - palette) ** 2).sum(axis=2), axis=1)
            total += np.bincount(nearest, minlength=len(palette)) / len(found)
            count += 1
    return total / max(count, 1)
