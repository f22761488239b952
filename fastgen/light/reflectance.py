"""Fresnel reflectance and GGX specular albedo; the numpy twin of shaders/reflectance.glsl."""

import functools

import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache

VERSION = 1  # raise when the stored arrays change

DIELECTRIC_INDEX = 1.5
"""Refractive index of non-metals, typical of paints and plastics."""

DIELECTRIC_F0 = ((DIELECTRIC_INDEX - 1) / (DIELECTRIC_INDEX + 1)) ** 2
"""Reflectance of a dielectric at normal incidence, by Fresnel's equations."""

WATER_INDEX = 1.333
"""Refractive index of water."""

WATER_F0 = ((WATER_INDEX - 1) / (WATER_INDEX + 1)) ** 2
"""Reflectance of water at normal incidence."""

POROUS_LOSS = 0.8
"""Share of its albedo that a rough non-metal loses when it is soaked, see shaders/wetness.glsl."""

_POINTS = 4096


def fresnel_climb(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Fresnel reflectance, rescaled to 0 at normal and 1 at grazing incidence.

    Fresnel's equations for unpolarized light on a dielectric of DIELECTRIC_INDEX, in the form of
    Cook and Torrance 1982, A Reflectance Model for Computer Graphics. At 50 to 60 degrees Schlick's
    approximation is 20 % too low. Metals use the same curve.

    Args:
        cosine: Cosine of the angle between light and normal, 0..1.
    """
    g = np.sqrt(cosine**2 + DIELECTRIC_INDEX**2 - 1)
    ratio = (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    reflected = 0.5 * ((g - cosine) / (g + cosine)) ** 2 * (1 + ratio**2)
    return np.asarray((reflected - DIELECTRIC_F0) / (1 - DIELECTRIC_F0))


@functools.cache
def dfg_table(size: int = 32) -> NDArray[np.float32]:
    """Return the split-sum table of scale A and bias B: specular albedo = A F0 + B.

    GGX with height-correlated Smith masking, `fresnel_climb` between F0 and 1, single scattering.
    Karis 2013, Real Shading in Unreal Engine 4, environment BRDF; Heitz 2014, Understanding the
    Masking-Shadowing Function, eq. 72 and 99. Integrated over a lattice of visible normals, mapped
    as in Dupuy and Benyoub 2023, Sampling Visible GGX Normals with Spherical Caps.

    Returns:
        float32 [size, size, 2], read-only. Row r is at roughness (r + 0.5) / size, column c at n.v
        (c + 0.5) / size. These are texel centres for OpenGL's linear sampling with clamping.
    """
    layout = {"table": f"float32 {size} {size} 2"}
    found = disk_cache.cached(
        "dfg", VERSION, size, lambda: {"table": _integrated(size)}, layout=layout
    )
    return found["table"]


def mean_specular_albedo(f0: float, roughness: float) -> float:
    """Return the specular albedo of a surface, averaged over the cosine-weighted hemisphere.

    This is the share of uniform light from all around that the surface reflects specularly.
    """
    table = dfg_table()
    size = len(table)
    scale, bias = table[min(int(roughness * size), size - 1)].T
    n_dot_v = (np.arange(size) + 0.5) / size
    return float(n_dot_v @ (scale * f0 + bias)) * 2 / size


def _integrated(size: int) -> NDArray[np.float32]:
    center = (np.arange(size) + 0.5) / size
    n_dot_v = center[:, None]
    view = np.stack([np.sqrt(1 - n_dot_v**2), n_dot_v])
    # golden-ratio lattice over half the circle, because the other half is symmetric
    point = np.arange(_POINTS)
    height = ((point + 0.5) / _POINTS)[None]
    phi = np.pi * (point * (5**0.5 - 1) / 2 % 1.0)[None]
    table = np.empty((size, size, 2), np.float32)
    for row, alpha in enumerate(center**2):
        stretched = view * np.array([alpha, 1.0])[:, None, None]
        stretched /= np.sqrt((stretched**2).sum(0))
        cap_z = 1.0 - height * (1.0 + stretched[1])
        cap_r = np.sqrt(1.0 - cap_z**2)
        hx, hy = alpha * (cap_r * np.cos(phi) + stretched[0]), alpha * cap_r * np.sin(phi)
        hz = cap_z + stretched[1]
        v_dot_h = (view[0] * hx + view[1] * hz) / np.sqrt(hx**2 + hy**2 + hz**2)
        n_dot_h = hz / np.sqrt(hx**2 + hy**2 + hz**2)
        n_dot_l = 2.0 * v_dot_h * n_dot_h - n_dot_v
        lit = n_dot_l > 0
        masked_v = _smith_lambda(n_dot_v, alpha)
        masked_l = _smith_lambda(np.where(lit, n_dot_l, 1.0), alpha)
        weight = lit * (1.0 + masked_v) / (1.0 + masked_v + masked_l)  # G2 / G1
        fresnel = fresnel_climb(np.clip(v_dot_h, 0.0, 1.0))
        table[row] = np.stack([weight * (1.0 - fresnel), weight * fresnel]).mean(-1).T
    return table


def _smith_lambda(cosine: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)) - 1.0)
