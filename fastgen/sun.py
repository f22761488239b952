"""The suns of an environment: compact lights, taken out of the maps so that they can cast shadows.

By day that is the sun; by night up to MOST_SUNS lamps are.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen import prefilter
from fastgen.scene import REC_709

CAP_DEG = 3.0
"""Radius about its brightest place that counts as a sun: its disc, blurred by texels and haze."""

MIN_SHARE = 0.1
"""Of the irradiance on a surface that faces it; what brings less casts no shadow worth its time."""

MOST_SUNS = 4

_TRIES = 16  # bright places that are looked at
_COARSE_WIDTH = 64  # texels around of what tells the irradiance from all sides

Radiance = NDArray[np.float32]


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


def split_suns(radiance: Radiance) -> tuple[tuple[Sun, ...], Radiance]:
    """The suns of equirectangular radiance [H, 2H, 3], brightest first, and the radiance without.

    A sun is what exceeds the sky around it, channel by channel, near a bright texel; all parts
    together hold the light of the whole. Of more than MOST_SUNS those stay in the map that make up
    the least of the light where they come from. Without any: (), and `radiance` itself.
    """
    places = _Places(radiance)
    rest = radiance.copy()
    found = []
    for _ in range(_TRIES):
        brightest = places.brightest()
        if brightest is None:
            break
        excess = places.excess_about(brightest, rest)
        if excess is not None and excess.share >= MIN_SHARE:
            rest[excess.at] -= excess.radiance
            found.append(excess)
    found.sort(key=lambda excess: -excess.share)
    for excess in found[MOST_SUNS:]:
        rest[excess.at] += excess.radiance
    suns = sorted((excess.sun for excess in found[:MOST_SUNS]), key=_luminance, reverse=True)
    return tuple(suns), rest if suns else radiance


def _luminance(sun: Sun) -> float:
    return float(np.dot(sun.light, REC_709))


@dataclass(frozen=True, eq=False)
class _Excess:
    """What a sun has above the sky around it: radiance [K, 3] in the texels (rows, columns) `at`;
    share: of the irradiance on what faces it."""

    sun: Sun
    share: float
    at: tuple[NDArray[np.intp], ...]
    radiance: Radiance


class _Places:
    """Where suns may stand in a map [H, 2H, 3]."""

    def __init__(self, radiance: Radiance) -> None:
        height = radiance.shape[0]
        self._directions = prefilter.equirect_directions(height)
        self._solid_angle = prefilter.row_solid_angle(height)[:, None]
        self._untried = radiance @ REC_709
        coarse = prefilter.shrink(radiance, _COARSE_WIDTH)
        weight = prefilter.row_solid_angle(len(coarse))[:, None]
        self._coarse = (coarse @ REC_709) * weight
        self._coarse_directions = prefilter.equirect_directions(len(coarse))

    def _irradiance(self, normal: NDArray[np.float64]) -> float:
        """Of a surface, its luminance."""
        cosine = np.maximum(self._coarse_directions @ normal, 0.0)
        return float((self._coarse * cosine).sum())

    def brightest(self) -> tuple[int, int] | None:
        """The brightest texel not yet asked about, None if it is too dark for a sun."""
        row, column = divmod(int(np.argmax(self._untried)), self._untried.shape[1])
        solid_angle = 2 * np.pi * (1 - np.cos(np.deg2rad(CAP_DEG)))
        most = float(self._untried[row, column]) * solid_angle
        least = MIN_SHARE * self._irradiance(self._directions[row, column])
        return (row, column) if most > 0 and most >= least else None

    def excess_about(self, brightest: tuple[int, int], radiance: Radiance) -> _Excess | None:
        """What is brighter about a texel than the sky around; None if nothing is."""
        toward = self._directions[brightest]
        reach = int(np.ceil(len(radiance) * 3 * CAP_DEG / 180))
        first = max(brightest[0] - reach, 0)
        rows = slice(first, brightest[0] + reach + 1)
        directions, near = self._directions[rows], radiance[rows]
        weights = np.broadcast_to(self._solid_angle[rows], directions.shape[:2])
        self._untried[rows][directions @ toward > np.cos(np.deg2rad(CAP_DEG))] = 0
        for _ in range(2):  # the second time around the centre of its light, not one texel
            cosine = directions @ toward
            cap = cosine > np.cos(np.deg2rad(CAP_DEG))
            around = (cosine > np.cos(np.deg2rad(2 * CAP_DEG))) & ~cap
            excess = np.maximum(near[cap] - np.median(near[around], axis=0), 0.0)
            flux = excess @ REC_709 * weights[cap]
            if not flux.any():
                return None
            toward = flux @ directions[cap]
            toward /= np.linalg.norm(toward)
        self._untried[rows][cap] = 0
        cosine = np.maximum(directions[cap] @ toward, 0.0)
        squared_angle = np.arccos(np.clip(cosine, 0.0, 1.0)) ** 2
        # an even disc of radius r has a mean square of r^2 / 2
        radius = np.sqrt(2 * (flux @ squared_angle) / flux.sum())
        light = (weights[cap] * cosine) @ excess / np.pi
        x, y, z = (float(v) for v in toward)
        red, green, blue = (float(v) for v in light)
        row, column = np.nonzero(cap)
        share = float(flux @ cosine) / self._irradiance(toward)
        sun = Sun((x, y, z), (red, green, blue), float(radius))
        return _Excess(sun, share, (row + first, column), excess)
