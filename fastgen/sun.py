"""The sun of an environment: a compact light, taken out of the maps so that it can cast shadows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen import prefilter
from fastgen.scene import REC_709

CAP_DEG = 3.0
"""Radius about the brightest place that counts as the sun: its disc, blurred by texels and haze."""

MIN_SHARE = 0.15
"""Of the irradiance on a surface that faces it; what brings less casts no shadow worth its time."""


@dataclass(frozen=True)
class Sun:
    """A light from one direction, in the frame of the environment's map.

    direction: unit vector toward it. light: linear RGB, irradiance / pi on a surface that faces it,
    the unit of EnvironmentLight.irradiance. radius: angular radius in radians of the even disc that
    spreads as much.
    """

    direction: tuple[float, float, float]
    light: tuple[float, float, float]
    radius: float


def split_sun(radiance: NDArray[np.float32]) -> tuple[Sun | None, NDArray[np.float32]]:
    """The sun of equirectangular radiance [H, 2H, 3], and the radiance without it.

    The sun is what exceeds the sky around it, channel by channel, near the brightest texel; both
    parts together hold the light of the whole. Without a strong sun: None, and `radiance` itself.
    """
    height = radiance.shape[0]
    directions = prefilter.equirect_directions(height)
    weights = prefilter.row_solid_angle(height)[:, None]
    luminance = radiance @ REC_709
    brightest = np.unravel_index(int(np.argmax(luminance)), luminance.shape)
    toward = directions[brightest]
    for _ in range(2):  # the second time around the centre of its light, not one texel
        cosine = directions @ toward
        cap = cosine > np.cos(np.deg2rad(CAP_DEG))
        around = (cosine > np.cos(np.deg2rad(2 * CAP_DEG))) & ~cap
        excess = np.maximum(radiance[cap] - np.median(radiance[around], axis=0), 0.0)
        weight = np.broadcast_to(weights, cap.shape)[cap]
        share = excess @ REC_709 * weight
        if not share.any():
            return None, radiance
        toward = share @ directions[cap]
        toward /= np.linalg.norm(toward)
    cosine = np.maximum(directions @ toward, 0.0)
    whole = (luminance * cosine).sum(axis=1) @ weights[:, 0]
    cosine = cosine[cap]
    if share @ cosine < MIN_SHARE * whole:
        return None, radiance
    squared_angle = np.arccos(np.clip(cosine, 0.0, 1.0)) ** 2
    # an even disc of radius r has a mean square of r^2 / 2
    radius = np.sqrt(2 * (share @ squared_angle) / share.sum())
    light = (weight * cosine) @ excess / np.pi
    rest = radiance.copy()
    rest[cap] -= excess
    x, y, z = (float(v) for v in toward)
    red, green, blue = (float(v) for v in light)
    return Sun((x, y, z), (red, green, blue), float(radius)), rest
