"""Light of an environment in fog: a dimmer sun and a brighter sky."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.weather import CONTRAST
from fastgen.light import octahedral, prefilter
from fastgen.light.environment import (
    IRRADIANCE_SIZE,
    ROUGHNESS_LEVELS,
    SPECULAR_SIZE,
    Ambient,
    EnvironmentLight,
    half_floats,
)

_LAYER_M = 60.0
"""Assumed thickness of the fog layer, from the ground up."""

_FORWARD = 0.85
"""Mean cosine of the scattering angle in clouds and fog (Bohren 1987, "Multiple Scattering of Light
and Some of Its Observable Consequences", American Journal of Physics 55)."""

_LEAST_SHARE = 0.01
"""Least share of its light that the sun must keep to remain a directional light."""

_GRID_ROWS = 128


def has_sun(light: Ambient) -> bool:
    """Return whether an environment has a sun: one directional light, above the horizon.

    Several lights are lamps. They are near, and their distance is unknown.
    """
    return len(light.lights) == 1 and light.lights[0].direction[2] > 0


def in_fog(light: EnvironmentLight, visibility_mm: float) -> EnvironmentLight:
    """Return the light at the bottom of a level layer of fog.

    The layer attenuates the sun. The part of the lost light that reaches the ground comes evenly
    from the whole sky. The light of the sky itself is not attenuated. `luminance`, which exposure
    meters read, stays that of clear weather.

    Args:
        light: An environment that has a sun, see `has_sun`.
        visibility_mm: Meteorological visibility.
    """
    (sun,) = light.lights
    rise = sun.direction[2]
    direct, total = transmitted(CONTRAST * _LAYER_M * 1e3 / visibility_mm, rise)
    r, g, b = (direct * np.array(sun.light)).tolist()
    scattered = (rise * (total - direct) * np.array(sun.light)).astype(np.float32)
    toward, _ = octahedral.octahedral_texels(light.sky.shape[0])
    above = (1 + np.sign(toward[:, 2].round(6))) / 2  # half of a cell on the horizon is above it
    shown = above.astype(np.float32).reshape(*light.sky.shape[:2], 1)
    return replace(
        light,
        lights=(replace(sun, light=(r, g, b)),) if direct > _LEAST_SHARE else (),
        sky=light.sky + shown * scattered,
        irradiance=_rounded(light.irradiance + _half_sky_irradiance() * scattered),
        specular=_rounded(light.specular + _half_sky_specular() * scattered),
    )


def transmitted(optical_depth: float, cosine: float) -> tuple[float, float]:
    """Return the shares of sunlight that reach the ground through a non-absorbing layer.

    Eddington's approximation over a black ground (Shettle and Weinman 1970, "The Transfer of Solar
    Irradiance through Inhomogeneous Turbid Atmospheres Evaluated by Eddington's Approximation",
    Journal of the Atmospheric Sciences 27).

    Args:
        optical_depth: Vertical optical depth of the layer.
        cosine: Cosine of the angle between the sun and the vertical, above 0.

    Returns:
        The direct share (Beer-Lambert), and the total share of direct and scattered light.
    """
    direct = float(np.exp(-optical_depth / cosine))
    total = (2 / 3 + cosine + (2 / 3 - cosine) * direct) / (4 / 3 + (1 - _FORWARD) * optical_depth)
    return direct, min(max(total, direct), 1.0)


def _rounded(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return radiance in the precision of an EnvironmentLight."""
    return half_floats(radiance).astype(np.float32)


@cache
def _half_sky() -> NDArray[np.float32]:
    """Return equirectangular radiance [H, 2H, 3]: 1 above the horizon, 0 below."""
    sky = np.zeros((_GRID_ROWS, 2 * _GRID_ROWS, 3), np.float32)
    sky[: _GRID_ROWS // 2] = 1
    return sky


@cache
def _half_sky_irradiance() -> NDArray[np.float32]:
    """Return irradiance / pi under `_half_sky`, [M, M, 3], as EnvironmentLight.irradiance."""
    diffuse = prefilter.convolve(_half_sky(), prefilter.cosine_lobe)
    return octahedral.resample_octahedral(diffuse, IRRADIANCE_SIZE, 1)


@cache
def _half_sky_specular() -> NDArray[np.float32]:
    """Return `_half_sky` convolved as EnvironmentLight.specular, [L, N, N, 3]."""
    layers = [
        octahedral.resample_octahedral(
            prefilter.convolve(_half_sky(), prefilter.ggx_lobe(roughness)), SPECULAR_SIZE, 4
        )
        for roughness in ROUGHNESS_LEVELS
    ]
    return np.stack(layers)
