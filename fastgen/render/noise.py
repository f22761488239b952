"""Tileable noise for the material layers, baked once per process and mip-mapped.

Channels hold values whose distribution is uniform on 0..1, so that `noise > 1 - c` covers the
fraction c of the surface. That of rust and run-off is normal instead: NORMAL_REACH deviations to
either side of its mean fill 0..1. Scratches are 0 or 1. Averaging in a mip level narrows those
distributions; `lost_deviation` says by how much, and the shader widens its thresholds accordingly,
so that near and far views agree on how much is rusty and nothing shimmers (the idea of Olano and
Baker 2010, LEAN mapping: variance that filtering removes comes back as softness). Of a normal field
that is exact: where its mean over a footprint is m and deviates by s within it, Phi((m - t) / s) of
that lies above t. What is read as a sum of two lookups (shaders/layers.glsl) is uniform no longer.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache

NOISE_SIZE = 1024

NOISE_LEVELS = NOISE_SIZE.bit_length()
"""Levels of the mip chain of a tile."""

NORMAL_REACH = 3.2
"""Deviations from the mean that a normal channel holds; one value in 600 lies beyond."""

_RUN_TEXELS = 110.0
"""Length over which run-off below a spot of rust fades to 1 / e."""

_SEED = 20262
_BINS = 8191


@dataclass(frozen=True, eq=False)
class NoiseTiles:
    """levels: uint8 [2, S, S, 4] for S = NOISE_SIZE, NOISE_SIZE / 2, ... 1; row 0 is v = 0.

    Layer 0: tone, rust, run-off, grain. Layer 1: scratches, wear, dirt, fine grain.
    scratched: share of the tile that scratches cover.
    lost_deviation: float32 [2, levels, 4], standard deviation that bilinear lookups in a level have
    lost against those in level 0.
    """

    levels: tuple[NDArray[np.uint8], ...]
    scratched: float
    lost_deviation: NDArray[np.float32]


def _uniform(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Replace values [S, S] by their ranks, scaled to 0..1."""
    low, high = values.min(), values.max()
    bins = ((values - low) * (_BINS / (high - low))).astype(np.int32)
    share = np.cumsum(np.bincount(bins.ravel(), minlength=_BINS + 1), dtype=np.float64)
    return (share / values.size)[bins].astype(np.float32)


def _looked_up_variance(channel: NDArray[np.floating]) -> float:
    """Variance of bilinear lookups anywhere in texels [S, S], which repeat."""
    apart = channel - channel.mean(dtype=np.float64)
    # between two texels the mean of a weight's square is 1/3, that of both weights' product 1/6
    smooth = apart
    for axis in (0, 1):
        smooth = 2 / 3 * smooth + 1 / 3 * np.roll(smooth, 1, axis=axis)
    return float((apart * smooth).mean())


def _normal(ranks: NDArray[np.float32]) -> NDArray[np.float32]:
    """Ranks [S, S] in 0..1 as values that are normal where they are looked up, about a mean of 0.5;
    see NORMAL_REACH."""
    from scipy.special import ndtri  # takes 0.1 s, and noise is kept on disk

    deviations = np.clip(ndtri(ranks.astype(np.float64)), -NORMAL_REACH, NORMAL_REACH)
    deviations /= np.sqrt(_looked_up_variance(deviations))
    return np.clip(0.5 + deviations / (2 * NORMAL_REACH), 0, 1).astype(np.float32)


def _spectral(
    rng: np.random.Generator, slope: float, low: float, high: float, stretch: float = 1.0
) -> NDArray[np.float32]:
    """Periodic Gaussian noise with power falling as frequency ** -slope between two cut-offs.

    low, high: cycles a tile. stretch above 1 draws the pattern out along y.
    Ebert et al. 2002, Texturing and Modeling, ch. 2 (spectral synthesis).
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
    """Where most water comes down from rust, as ranks: the rustiest fifth dragged toward -y (down a
    wall), in streaks. Both are ranks [S, S]."""
    spots = np.clip((rust - 0.8) / 0.2, 0, 1)
    drag = np.exp(-np.arange(NOISE_SIZE) / _RUN_TEXELS)
    dragged = np.fft.irfft(
        np.fft.rfft(spots, axis=0) * np.conj(np.fft.rfft(drag))[:, None], n=NOISE_SIZE, axis=0
    )
    return _uniform(dragged * (0.3 + streaks))


def _scratches(rng: np.random.Generator) -> NDArray[np.float32]:
    """Straight thin lines of 1 on 0, mostly along x, as scrapes run."""
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
    """The next mip level: 2x2 box average of [2, S, S, 4]."""
    quads = level.reshape(2, level.shape[1] // 2, 2, level.shape[2] // 2, 2, 4)
    return quads.mean(axis=(2, 4), dtype=np.float32)


@lru_cache(maxsize=1)
def noise_tiles() -> NoiseTiles:
    """Both layers and their mip chain; always the same. Baking them takes a second or two, once."""
    arrays = disk_cache.computed("noise", _SEED, _baked)
    levels = tuple(arrays[f"level{i}"] for i in range(len(arrays) - 1))
    return NoiseTiles(levels, float((levels[0][1, ..., 0] > 0).mean()), arrays["lost_deviation"])


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
