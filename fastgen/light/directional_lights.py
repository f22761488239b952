"""The suns of an environment: compact lights, taken out of the maps so that they can cast shadows.

Under an open sky that is the sun; by night and indoors up to MOST_SUNS lamps are.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.light import prefilter
from fastgen.scene import REC_709

CAP_DEG = 3.0
"""Radius about its brightest place that counts as a sun: its disc, blurred by texels and haze."""

MIN_SHARE = 0.1
"""Of the irradiance on a surface that faces it; what brings less casts no shadow worth its time."""

MOST_SUNS = 4

_APART_DEG = 2 * CAP_DEG
"""Between two suns, at least: their caps do not overlap."""

_ROUNDS = 4  # until a cap stands about the centre of a small light
_SEARCH_WIDTH = 256  # texels around of the map that tells where to look

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

    A sun is what exceeds the sky around it, channel by channel, within CAP_DEG of a place where it
    gives MIN_SHARE of the light; all parts together hold the light of the whole. Of two that stand
    closer than twice that only one is, of a disc a little broader than the cap only a part. Of more
    than MOST_SUNS those stay in the map that give the least share. Without any: (), and `radiance`
    itself.
    """
    places = _Places(radiance)
    found: list[_Excess] = []
    while (place := places.next()) is not None:
        excess = places.excess_about(place)
        if excess is not None and all(
            _apart_deg(excess.sun, other.sun) >= _APART_DEG for other in found
        ):
            found.append(excess)
            places.rule_out(np.array(excess.sun.direction), _APART_DEG)
        places.rule_out(place, CAP_DEG)
    if not found:
        return (), radiance
    found.sort(key=lambda excess: -excess.share)
    rest = radiance.copy()
    for excess in found[:MOST_SUNS]:
        rest[excess.at] = np.maximum(rest[excess.at] - excess.radiance, 0.0)
    suns = sorted((excess.sun for excess in found[:MOST_SUNS]), key=_luminance, reverse=True)
    return tuple(suns), rest


def _luminance(sun: Sun) -> float:
    return float(np.dot(sun.light, REC_709))


def _apart_deg(one: Sun, other: Sun) -> float:
    return float(np.degrees(np.arccos(np.clip(np.dot(one.direction, other.direction), -1, 1))))


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
        self._radiance = radiance
        self._directions = prefilter.equirect_directions(height)
        self._solid_angle = prefilter.row_solid_angle(height)[:, None]
        luminance = (radiance @ REC_709.astype(np.float32))[..., None]
        coarse = prefilter.shrink(luminance, _SEARCH_WIDTH)
        self._places = prefilter.equirect_directions(len(coarse))
        texel, cap = np.pi / len(coarse), np.deg2rad(CAP_DEG)

        def within(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
            """1 in a cap, falling to 0 over a texel: no light of a cap is lost between texels."""
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            return np.clip((cap + texel - angle) / texel, 0.0, 1.0)

        solid_angle = np.pi * (cap * cap + cap * texel + texel * texel / 3)  # integral of `within`
        most = prefilter.convolve(coarse, within)[..., 0] * solid_angle
        self._irradiance = np.pi * prefilter.convolve(coarse, prefilter.cosine_lobe)[..., 0]
        self._share = np.where(most > 0, most / np.maximum(self._irradiance, 1e-30), 0.0)

    def next(self) -> NDArray[np.float64] | None:
        """Unit vector to where most of the light may come from within a cap, among what is not
        ruled out; None where it is too little."""
        place = np.unravel_index(np.argmax(self._share), self._share.shape)
        return self._places[place] if self._share[place] >= MIN_SHARE else None

    def rule_out(self, toward: NDArray[np.float64], radius_deg: float) -> None:
        """All places about a unit vector, and the nearest."""
        nearness = self._places @ toward
        self._share[nearness >= min(np.cos(np.deg2rad(radius_deg)), nearness.max())] = 0

    def excess_about(self, toward: NDArray[np.float64]) -> _Excess | None:
        """What is brighter than the sky around, near a unit vector; None if that is too little."""
        height = len(self._radiance)
        reach = int(np.ceil(height * 3 * CAP_DEG / 180))
        middle = int(np.arccos(np.clip(toward[2], -1.0, 1.0)) / np.pi * height)
        first = max(middle - reach, 0)
        rows = slice(first, middle + reach + 1)
        directions, near = self._directions[rows], self._radiance[rows]
        weights = np.broadcast_to(self._solid_angle[rows], directions.shape[:2])
        for _ in range(_ROUNDS):
            cosine = directions @ toward
            cap = cosine > np.cos(np.deg2rad(CAP_DEG))
            around = (cosine > np.cos(np.deg2rad(_APART_DEG))) & ~cap
            if not cap.any() or not around.any():
                return None
            excess = np.maximum(near[cap] - _median(near[around], weights[around]), 0.0)
            flux = excess @ REC_709 * weights[cap]
            if not flux.any():
                return None
            toward = flux @ directions[cap]
            toward /= np.linalg.norm(toward)
        cosine = np.maximum(directions[cap] @ toward, 0.0)
        squared_angle = np.arccos(np.clip(cosine, 0.0, 1.0)) ** 2
        # an even disc of radius r has a mean square of r^2 / 2
        radius = np.sqrt(2 * (flux @ squared_angle) / flux.sum())
        light = (weights[cap] * cosine) @ excess / np.pi
        x, y, z = (float(v) for v in toward)
        red, green, blue = (float(v) for v in light)
        row, column = np.nonzero(cap)
        nearest = np.argmax(self._places @ toward)
        share = float(flux @ cosine) / float(self._irradiance.flat[nearest])
        if share < MIN_SHARE:
            return None
        sun = Sun((x, y, z), (red, green, blue), float(radius))
        return _Excess(sun, share, (row + first, column), excess)


def _median(values: NDArray[np.floating], weights: NDArray[np.float64]) -> NDArray[np.floating]:
    """Of each channel of values [K, C] that count by weights [K]."""
    order = np.argsort(values, axis=0)
    below = np.cumsum(weights[order], axis=0)
    middle = (below < below[-1] / 2).sum(axis=0)
    return np.take_along_axis(values, np.take_along_axis(order, middle[None], axis=0), axis=0)[0]
