"""Sky maps: Blender's Nishita sky, and ray-marched clouds.

Maps are equirectangular in fastgen's convention: the middle column looks along +x, and +y is a
quarter turn to the left. Radiance is linear Rec. 709 in Blender's units, where sunlight above the
atmosphere is about 1e3.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SUN_RADIUS = np.radians(0.2666)
"""Mean apparent radius of the sun (Astronomical Almanac: 959.63 arc seconds)."""

EARTH_KM = 6371.0

_TILE = 128
_STEPS, _LIGHT_STEPS = 24, 3


@dataclass(frozen=True)
class Clouds:
    """A cloud layer.

    Attributes:
        cover: Share of the sky.
        base_km: Height of the base.
        thick_km: Thickness.
        extinction: Extinction per kilometre.
        size_km: Size of the noise pattern.
        seed: Seed of the noise.
    """

    cover: float = 0.0
    base_km: float = 1.2
    thick_km: float = 0.7
    extinction: float = 9.0
    size_km: float = 6.0
    seed: int = 1


def directions(height: int) -> NDArray[np.float64]:
    """Return the unit directions [H, 2H, 3] of the texel centres."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    phi = np.pi - np.pi * (np.arange(2 * height) + 0.5) / height
    z = np.broadcast_to(np.cos(theta), (height, 2 * height))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), z], axis=-1)


def noise_tile(seed: int) -> NDArray[np.float32]:
    """Return tileable cloud-like noise [N, N, N], with values uniform in 0 to 1.

    Gaussian noise has a spectrum near Kolmogorov's. Folding it to 1 - |n| gives rounded heaps like
    Worley noise (Schneider 2015, The Real-time Volumetric Cloudscapes of Horizon Zero Dawn). Two
    scales are combined.
    """
    rng = np.random.default_rng(seed)
    f = np.fft.fftfreq(_TILE) * _TILE
    k = np.sqrt(
        f[:, None, None] ** 2 + f[None, :, None] ** 2 + f[None, None, : _TILE // 2 + 1] ** 2
    )
    k[0, 0, 0] = np.inf
    k = np.maximum(k, 2.0)

    def field(slope: float) -> NDArray[np.float64]:
        white = np.fft.rfftn(rng.standard_normal((_TILE,) * 3))
        n = np.fft.irfftn(white * k**slope, s=(_TILE,) * 3, axes=(0, 1, 2))
        return n / n.std()

    heaps = field(-11 / 6 - 0.4) - 0.45 * np.abs(field(-11 / 6))
    rank = np.argsort(np.argsort(heaps, axis=None)).reshape(heaps.shape)
    return (rank / rank.size).astype(np.float32)


def _sample(tile: NDArray[np.float32], p: NDArray[np.float32]) -> NDArray[np.float32]:
    low = np.floor(p).astype(np.int32)
    f = p - low
    a, b = low % _TILE, (low + 1) % _TILE
    fx, fy, fz = f[..., 0], f[..., 1], f[..., 2]

    def plane(z: NDArray[np.int32]) -> NDArray[np.float32]:
        x0 = tile[a[..., 0], a[..., 1], z] * (1 - fx) + tile[b[..., 0], a[..., 1], z] * fx
        x1 = tile[a[..., 0], b[..., 1], z] * (1 - fx) + tile[b[..., 0], b[..., 1], z] * fx
        return x0 * (1 - fy) + x1 * fy

    return plane(a[..., 2]) * (1 - fz) + plane(b[..., 2]) * fz


def cloud_layer(
    clouds: Clouds, height: int, sun: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """March rays through the layer for all texels above the horizon.

    The sun's part follows Henyey and Greenstein's phase function with two lobes.

    Returns:
        Transmittance [H/2, 2H], and the share of unit light that reaches the eye from the sun and
        from the surrounding sky.
    """
    view = directions(height)[: height // 2].astype(np.float32)
    tile = noise_tile(clouds.seed)
    # distance to a shell of radius R + h: on a round earth, rays at the horizon reach it, too
    rise = view[..., 2]
    near = -EARTH_KM * rise + np.sqrt((EARTH_KM * rise) ** 2 + 2 * EARTH_KM * clouds.base_km)
    top = clouds.base_km + clouds.thick_km
    far = -EARTH_KM * rise + np.sqrt((EARTH_KM * rise) ** 2 + 2 * EARTH_KM * top)
    far = np.minimum(far, near + 6 * clouds.thick_km)
    step = (far - near) / _STEPS
    per_km = _TILE / clouds.size_km / 2

    def density(p: NDArray[np.float32]) -> NDArray[np.float32]:
        level = np.clip((p[..., 2] - clouds.base_km) / clouds.thick_km, 0, 1)
        shape = _sample(tile, p * per_km)
        shape = 0.82 * shape + 0.18 * _sample(tile, p * (3.7 * per_km))
        edge = 1 - clouds.cover + 0.35 * np.abs(level - 0.25) ** 1.5
        return np.clip((shape - edge) / 0.16, 0, 1)

    cosine = (view @ sun.astype(np.float32)).astype(np.float32)

    def lobe(g: float) -> NDArray[np.float32]:
        return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)

    phase = 0.35 * lobe(0.75) + 0.65 * lobe(-0.1)
    through = np.ones_like(near)
    from_sun, from_sky = np.zeros_like(near), np.zeros_like(near)
    toward = sun.astype(np.float32).copy()
    toward[2] = max(toward[2], 0.12)
    middle = view * (near + 0.5 * (far - near))[..., None]
    # thicker and thinner places, so that an overcast sky is not uniformly grey
    vary = 0.5 + 1.0 * _sample(tile, middle * (0.45 * per_km))
    start = np.random.default_rng(0).random(near.shape, np.float32)
    for i in range(_STEPS):
        distance = near + (i + start) * step
        p = view * distance[..., None]
        p[..., 2] += distance**2 / (2 * EARTH_KM) * (1 - rise**2)  # curvature of the earth
        d = density(p)
        shade = np.zeros_like(d)
        full = d > 0
        for j in range(_LIGHT_STEPS):
            reach = clouds.thick_km * 0.14 * (2.2**j)
            shade[full] += density(p[full] + toward * reach) * reach
        depth = clouds.extinction * shade
        # approximation of second-order scattering by Wrenninge et al. 2013
        lit = np.exp(-depth) * phase + 0.5 * np.exp(-0.3 * depth) / (4 * np.pi)
        level = np.clip((p[..., 2] - clouds.base_km) / clouds.thick_km, 0, 1)
        here = 1 - np.exp(-clouds.extinction * d * step)
        from_sun += vary * through * here * lit
        from_sky += vary * through * here * (0.45 + 0.55 * level)
        through = through * (1 - here)
    return smooth(through), smooth(from_sun), smooth(from_sky)


def smooth(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Apply a binomial blur over 3 x 3 texels, which removes the noise of few samples."""
    around = 0.5 * image + 0.25 * (np.roll(image, 1, 1) + np.roll(image, -1, 1))
    above = np.concatenate([around[:1], around[:-1]])
    below = np.concatenate([around[1:], around[-1:]])
    return 0.5 * around + 0.25 * (above + below)
