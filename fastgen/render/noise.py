"""Tileable mip-mapped noise for the material layers.

Most channels are uniformly distributed on 0..1, so that `noise > 1 - c` covers the fraction c of a
surface. Rust and run-off are normally distributed: 0..1 spans NORMAL_REACH standard deviations to
either side of the mean. Scratches are 0 or 1.

Averaging in a mip level narrows a distribution, by `lost_deviation`. The shader softens its
thresholds by the same amount, so that near and far views show the same share of rust and nothing
shimmers. Olano and Baker 2010, LEAN mapping, have this idea: variance that filtering removes
returns as softness. It is exact for a normal field: if its mean over a footprint is m and its
deviation within the footprint is s, the share Phi((m - t) / s) of the footprint exceeds t. Channels
that the shader reads as the sum of two lookups (shaders/noise.glsl) are no longer uniform.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache

VERSION = 1  # raise when the stored arrays change

NOISE_SIZE = 1024
"""Width and height of a tile in texels."""

NOISE_LEVELS = NOISE_SIZE.bit_length()
"""Number of mip levels of a tile."""

NORMAL_REACH = 3.2
"""Largest deviation from the mean in a normal channel, in standard deviations. About one value in
600 is clipped."""

_RUN_TEXELS = 110.0
"""Length in texels over which run-off below a rust spot fades to 1 / e."""

_SEED = 20262

_BINS = 8191
"""Resolution of ranks."""


@dataclass(frozen=True, eq=False)
class NoiseTiles:
    """Two layers of noise with four channels each.

    Layer 0 holds tone, rust, run-off and grain; layer 1 holds scratches, wear, dirt and fine grain.

    Attributes:
        levels: Mip levels, uint8 [2, S, S, 4] with S = NOISE_SIZE, NOISE_SIZE / 2, ... 1. Row 0 is
            at texture coordinate v = 0.
        scratched: Share of the tile that scratches cover.
        lost_deviation: float32 [2, NOISE_LEVELS, 4], the standard deviation that bilinear lookups
            in a level lose compared with level 0.
    """

    levels: tuple[NDArray[np.uint8], ...]
    scratched: float
    lost_deviation: NDArray[np.float32]


def _uniform(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return the ranks of values [S, S], scaled to 0..1."""
    low, high = values.min(), values.max()
    bins = ((values - low) * (_BINS / (high - low))).astype(np.int32)
    share = np.cumsum(np.bincount(bins.ravel(), minlength=_BINS + 1), dtype=np.float64)
    ranks: NDArray[np.float32] = (share / values.size)[bins].astype(np.float32)
    return ranks


def _looked_up_variance(channel: NDArray[np.floating]) -> float:
    """Return the variance of bilinear lookups at random places of a tile [S, S]."""
    apart = channel - channel.mean(dtype=np.float64)
    # Along an axis the two weights are t and 1 - t. The mean of t^2 is 1/3, of t (1 - t) 1/6.
    smooth = apart
    for axis in (0, 1):
        smooth = 2 / 3 * smooth + 1 / 3 * np.roll(smooth, 1, axis=axis)
    return float((apart * smooth).mean())


def _normal(ranks: NDArray[np.float32]) -> NDArray[np.float32]:
    """Turn ranks [S, S] in 0..1 into values with normally distributed lookups and mean 0.5."""
    from scipy.special import ndtri  # Slow to import, and only needed if the noise is not cached.

    deviations = np.clip(ndtri(ranks.astype(np.float64)), -NORMAL_REACH, NORMAL_REACH)
    deviations /= np.sqrt(_looked_up_variance(deviations))
    values = np.clip(0.5 + deviations / (2 * NORMAL_REACH), 0, 1)
    rounded: NDArray[np.float32] = values.astype(np.float32)
    return rounded


def _spectral(
    rng: np.random.Generator, slope: float, low: float, high: float, stretch: float = 1.0
) -> NDArray[np.float32]:
    """Return periodic Gaussian noise [S, S] with power frequency ** -slope between two cut-offs.

    The cut-offs `low` and `high` are in cycles per tile; `stretch` above 1 elongates the pattern
    along y. Ebert et al. 2002, Texturing and Modeling, chapter 2 (spectral synthesis).
    """
    fx = np.fft.rfftfreq(NOISE_SIZE, 1 / NOISE_SIZE)[None, :]
    fy = np.fft.fftfreq(NOISE_SIZE, 1 / NOISE_SIZE)[:, None] * stretch
    frequency = np.maximum(np.hypot(fx, fy), 1e-3)
    amplitude = frequency ** (-slope / 2)
    amplitude *= np.exp(-((low / frequency) ** 4)) * np.exp(-((frequency / high) ** 2))
    white = np.fft.rfft2(rng.standard_normal((NOISE_SIZE, NOISE_SIZE), np.float32))
    shaped = white * amplitude.astype(np.float32)
    return np.asarray(np.fft.irfft2(shaped, s=(NOISE_SIZE, NOISE_SIZE)))


def _run_off(rust: NDArray[np.float32], streaks: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return ranks [S, S] of the rusty water that runs down a wall, toward -y, in streaks.

    It starts at the rustiest fifth. `rust` and `streaks` are ranks [S, S].
    """
    spots = np.clip((rust - 0.8) / 0.2, 0, 1)
    drag = np.exp(-np.arange(NOISE_SIZE) / _RUN_TEXELS)
    dragged = np.fft.irfft(
        np.fft.rfft(spots, axis=0) * np.conj(np.fft.rfft(drag))[:, None], n=NOISE_SIZE, axis=0
    )
    return _uniform(dragged * (0.3 + streaks))


def _scratches(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return a tile [S, S] with straight thin lines of 1 on 0, mostly along x like real scrapes."""
    tile = np.zeros((NOISE_SIZE, NOISE_SIZE), np.float32)
    count = 900
    angles = rng.normal(0.0, 0.35, count) + np.where(rng.random(count) < 0.2, np.pi / 2, 0.0)
    lengths = rng.exponential(60.0, count) + 10
    centers = rng.random((count, 2)) * NOISE_SIZE
    for i in range(count):
        step = np.array([np.cos(angles[i]), np.sin(angles[i])]) * lengths[i] / 2
        for shift in NOISE_SIZE * np.array(list(product((-1, 0, 1), repeat=2))):
            start, end = centers[i] - shift - step, centers[i] - shift + step
            points = [tuple(round(v * 16) for v in p) for p in (start, end)]
            cv2.line(tile, points[0], points[1], 1.0, 1, cv2.LINE_8, shift=4)
    return tile


def _halved(level: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the next mip level of [2, S, S, 4], the mean of 2x2 texels."""
    quads = level.reshape(2, level.shape[1] // 2, 2, level.shape[2] // 2, 2, 4)
    mean: NDArray[np.float32] = quads.mean(axis=(2, 4), dtype=np.float32)
    return mean


@lru_cache(maxsize=1)
def noise_tiles() -> NoiseTiles:
    """Return the noise, which is always the same.

    Computing it takes one or two seconds; later processes read it from the disk cache.

    Returns:
        Both layers with their mip levels.
    """
    arrays = disk_cache.cached("noise", VERSION, _SEED, _baked, layout=_layout())
    levels = tuple(arrays[f"level{i}"] for i in range(len(arrays) - 1))
    return NoiseTiles(levels, float((levels[0][1, ..., 0] > 0).mean()), arrays["lost_deviation"])


def _layout() -> disk_cache.Layout:
    sizes = [NOISE_SIZE >> i for i in range(NOISE_SIZE.bit_length())]
    levels = {f"level{i}": f"uint8 2 {size} {size} 4" for i, size in enumerate(sizes)}
    return {"lost_deviation": f"float32 2 {len(sizes)} 4", **levels}


def _baked() -> dict[str, NDArray[Any]]:
    rng = np.random.default_rng(_SEED)
    tone = _uniform(_spectral(rng, 2.6, 1.0, 90.0))
    ridges = -np.abs(_spectral(rng, 2.4, 3.0, 300.0))
    blotches = _spectral(rng, 2.2, 2.0, 400.0)
    rust = _uniform(blotches / blotches.std() + 0.45 * ridges / ridges.std())
    grain = _uniform(_spectral(rng, 0.8, 30.0, 420.0))
    wear = _uniform(_spectral(rng, 2.2, 2.0, 250.0, stretch=1.8))
    dirt = _uniform(_spectral(rng, 1.9, 2.0, 320.0, stretch=6.0))
    fine = _uniform(_spectral(rng, 0.3, 90.0, 500.0))
    streaks = _uniform(_spectral(rng, 1.6, 4.0, 320.0, stretch=14.0))
    layers = np.stack(
        [
            np.stack([tone, _normal(rust), _normal(_run_off(rust, streaks)), grain], axis=-1),
            np.stack([_scratches(rng), wear, dirt, fine], axis=-1),
        ]
    )
    levels = [layers]
    while levels[-1].shape[1] > 1:
        levels.append(_halved(levels[-1]))
    variance = np.array(
        [
            [[_looked_up_variance(layer[..., c]) for c in range(4)] for layer in level]
            for level in levels
        ]
    ).swapaxes(0, 1)
    lost = np.sqrt(np.maximum(variance[:, :1] - variance, 0)).astype(np.float32)
    encoded = (np.rint(np.clip(level, 0, 1) * 255).astype(np.uint8) for level in levels)
    return {"lost_deviation": lost, **{f"level{i}": level for i, level in enumerate(encoded)}}
