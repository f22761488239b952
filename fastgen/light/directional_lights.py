"""Directional lights extracted from an HDRI: compact lights that cast shadows.

Under an open sky the only one is the sun. At night and indoors there are up to MAX_LIGHTS lamps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.light import prefilter
from fastgen.scene import REC_709

CAP_DEG = 3.0
"""Radius of a light around its brightest point: its disc, blurred by texels and haze."""

MIN_SHARE = 0.1
"""Least share of the irradiance on a surface that faces the light. Shadows of weaker lights are not
worth their cost."""

MAX_LIGHTS = 4

_APART_DEG = 2 * CAP_DEG
"""Least angle between two lights, so that their caps do not overlap."""

_ROUNDS = 4  # iterations that centre a cap on a small light
_SEARCH_WIDTH = 256  # width in texels of the map in which candidates are found

Radiance = NDArray[np.float32]


@dataclass(frozen=True)
class DirectionalLight:
    """Light from one direction, in the frame of the environment map where nothing else is said.

    Attributes:
        direction: Unit vector toward the light.
        light: Linear RGB, irradiance / pi on a surface that faces the light.
        radius: Angular radius in radians of a uniform disc with the same spread.
    """

    direction: tuple[float, float, float]
    light: tuple[float, float, float]
    radius: float


def extract_lights(radiance: Radiance) -> tuple[tuple[DirectionalLight, ...], Radiance]:
    """Split radiance into directional lights and the rest.

    A light is the excess over the surrounding sky, per channel, within CAP_DEG of a point where it
    gives at least MIN_SHARE of the irradiance. The lights and the rest add up to the input.
    Only one of two candidates closer than twice CAP_DEG is extracted, and only a part of a disc
    wider than the cap. With more than MAX_LIGHTS candidates, the weakest remain in the map.

    Args:
        radiance: float32 [H, 2H, 3], equirectangular.

    Returns:
        The lights, brightest first, and the remaining radiance float32 [H, 2H, 3]. Without a light,
        () and `radiance` itself.
    """
    places = _Places(radiance)
    found: list[_Excess] = []
    while (place := places.next()) is not None:
        excess = places.excess_about(place)
        if excess is not None and all(
            _apart_deg(excess.source, other.source) >= _APART_DEG for other in found
        ):
            found.append(excess)
            places.rule_out(np.array(excess.source.direction), _APART_DEG)
        places.rule_out(place, CAP_DEG)
    if not found:
        return (), radiance
    found.sort(key=lambda excess: -excess.share)
    rest = radiance.copy()
    for excess in found[:MAX_LIGHTS]:
        rest[excess.at] = np.maximum(rest[excess.at] - excess.radiance, 0.0)
    lights = sorted((excess.source for excess in found[:MAX_LIGHTS]), key=_luminance, reverse=True)
    return tuple(lights), rest


def _luminance(source: DirectionalLight) -> float:
    return float(np.dot(source.light, REC_709))


def _apart_deg(one: DirectionalLight, other: DirectionalLight) -> float:
    return float(np.degrees(np.arccos(np.clip(np.dot(one.direction, other.direction), -1, 1))))


@dataclass(frozen=True, eq=False)
class _Excess:
    """Radiance of a light above the surrounding sky.

    Attributes:
        source: The light.
        share: Its share of the irradiance on a surface that faces it.
        at: Rows and columns [K] of its texels.
        radiance: [K, 3], excess in these texels.
    """

    source: DirectionalLight
    share: float
    at: tuple[NDArray[np.intp], ...]
    radiance: Radiance


class _Places:
    """Candidate directions of lights in a map [H, 2H, 3]."""

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
            """Return 1 inside the cap, falling to 0 over one texel to lose no light in between."""
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            share: NDArray[np.float64] = np.clip((cap + texel - angle) / texel, 0.0, 1.0)
            return share

        solid_angle = np.pi * (cap * cap + cap * texel + texel * texel / 3)  # integral of `within`
        most = prefilter.convolve(coarse, within)[..., 0] * solid_angle
        self._irradiance = np.pi * prefilter.convolve(coarse, prefilter.cosine_lobe)[..., 0]
        self._share = np.where(most > 0, most / np.maximum(self._irradiance, 1e-30), 0.0)

    def next(self) -> NDArray[np.float64] | None:
        """Return the remaining direction whose cap may give the largest share of the light.

        None if that share is below MIN_SHARE.
        """
        place = np.unravel_index(np.argmax(self._share), self._share.shape)
        return self._places[place] if self._share[place] >= MIN_SHARE else None

    def rule_out(self, toward: NDArray[np.float64], radius_deg: float) -> None:
        """Remove all candidates within an angle of a unit vector, at least the nearest one."""
        nearness = self._places @ toward
        self._share[nearness >= min(np.cos(np.deg2rad(radius_deg)), nearness.max())] = 0

    def excess_about(self, toward: NDArray[np.float64]) -> _Excess | None:
        """Return the excess over the surrounding sky near a unit vector, None if it is too weak."""
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
        # the mean squared angle of a uniform disc of radius r is r^2 / 2
        radius = np.sqrt(2 * (flux @ squared_angle) / flux.sum())
        light = (weights[cap] * cosine) @ excess / np.pi
        x, y, z = (float(v) for v in toward)
        red, green, blue = (float(v) for v in light)
        row, column = np.nonzero(cap)
        nearest = np.argmax(self._places @ toward)
        share = float(flux @ cosine) / float(self._irradiance.flat[nearest])
        if share < MIN_SHARE:
            return None
        source = DirectionalLight((x, y, z), (red, green, blue), float(radius))
        return _Excess(source, share, (row + first, column), excess)


def _median(values: NDArray[np.floating], weights: NDArray[np.float64]) -> NDArray[np.floating]:
    """Return the weighted median of each channel of values [K, C]; weights: [K]."""
    order = np.argsort(values, axis=0)
    below = np.cumsum(weights[order], axis=0)
    middle = (below < below[-1] / 2).sum(axis=0)
    place = np.take_along_axis(order, middle[None], axis=0)
    median: NDArray[np.floating] = np.take_along_axis(values, place, axis=0)[0]
    return median
