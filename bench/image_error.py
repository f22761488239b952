"""Error measures between images, and the way from radiance to what is displayed."""

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import SPREADER_ID
from fastgen.sample import Sample

STEP_M = 0.15
OCCLUDED = 0.8  # ambient occlusion below this is a corner or the valley of a wave

Array = NDArray[np.floating]
Measures = tuple[float, float, float]
"""Mean FLIP, SSIM, PSNR in dB."""


def displayed(radiance: Array, exposure: float) -> Array:
    """Linear radiance [..., 3] as sRGB in 0..1, by the renderer's exposure and tone curve."""
    return srgb_encode(neutral_tone(exposure * radiance))


def neutral_tone(color: Array) -> Array:
    """Khronos PBR Neutral tone curve, twin of shaders/tone.glsl; linear [..., 3] in and out."""
    start, desaturation = 0.8 - 0.04, 0.15
    low = color.min(axis=-1, keepdims=True)
    color = color - np.where(low < 0.08, low - 6.25 * low * low, 0.04)
    peak = color.max(axis=-1, keepdims=True)
    d = 1.0 - start
    new_peak = 1.0 - d * d / (np.maximum(peak, start) + d - start)
    bright = color * new_peak / np.maximum(peak, start)
    share = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
    return np.where(peak < start, color, bright + share * (new_peak - bright))


def srgb_encode(color: Array) -> Array:
    """Linear [..., 3] in 0..1 to sRGB in 0..1 (IEC 61966-2-1)."""
    color = np.clip(color, 0.0, 1.0)
    curve = 1.055 * np.maximum(color, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(color <= 0.0031308, 12.92 * color, curve)


def srgb_decode(color: Array) -> Array:
    """sRGB [..., 3] in 0..1 to linear in 0..1."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two sRGB images in 0..1, [H, W, 3], and their difference by pixel."""

    flip_map: Array
    similarity_map: Array
    squared: Array

    @staticmethod
    def of(reference: Array, test: Array) -> "Comparison":
        """Compare `test` with `reference`. Andersson et al. 2020, FLIP; at its default viewing
        distance, 67 pixels a degree."""
        metrics = _imported("skimage.metrics")
        a, b = reference.astype(np.float32), test.astype(np.float32)
        _, similarity = metrics.structural_similarity(
            a, b, channel_axis=2, data_range=1.0, full=True
        )
        return Comparison(flip(a, b), similarity.mean(axis=2), ((a - b) ** 2).mean(axis=2))

    def measures(self, where: NDArray[np.bool_]) -> Measures:
        """Over a mask [H, W]."""
        psnr = -10 * np.log10(max(float(self.squared[where].mean()), 1e-12))
        return float(self.flip_map[where].mean()), float(self.similarity_map[where].mean()), psnr

    def both(self, inside: NDArray[np.bool_]) -> tuple[float, ...]:
        """Measures over the whole image, then over the pixels `inside` of objects."""
        return *self.measures(inside | True), *self.measures(inside)


def flip(reference: Array, test: Array) -> Array:
    """FLIP [H, W] alone, between sRGB images in 0..1."""
    evaluator = _imported("flip_evaluator")
    a, b = reference.astype(np.float32), test.astype(np.float32)
    found: Array = evaluator.evaluate(a, b, "LDR", applyMagma=False)[0][..., 0]
    return found


def _imported(name: str) -> Any:
    """A module of the extra `accuracy`, imported at its use, so that --help needs none of it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SystemExit("FLIP and SSIM need what pip install '.[accuracy]' brings") from None


def borders(ids: NDArray[np.integer], depth_m: Array) -> NDArray[np.bool_]:
    """Pixels beside a change of object, or a step in depth larger than a wall's waves."""
    near = np.where(np.isfinite(depth_m), depth_m, 1e3)
    found = np.zeros(ids.shape, bool)
    for axis in (0, 1):
        step = (np.abs(np.diff(near, axis=axis)) > STEP_M) | (
            np.diff(ids.astype(int), axis=axis) != 0
        )
        for side in ((1, 0), (0, 1)):
            pad = [(0, 0), (0, 0)]
            pad[axis] = side
            found |= np.pad(step, pad)
    return found


def divided(sample: Sample, openness: Array) -> dict[str, NDArray[np.bool_]]:
    """Masks [H, W] of the parts of an image in which errors have causes of their own."""
    inside = sample.ids > 0
    edges = borders(sample.ids, sample.depth)
    plain = inside & ~edges & (sample.ids == 1)
    return {
        "background": ~inside & ~edges,
        "edges": edges,
        "markers and text": ~edges & (sample.ids > 1) & (sample.ids < SPREADER_ID),
        "spreader": ~edges & (sample.ids == SPREADER_ID),
        "open sheet": plain & (openness >= OCCLUDED),
        "occluded sheet": plain & (openness < OCCLUDED),
    }


def stops_over(test: Array, reference: Array) -> float:
    """Median stops by which displayed linear light of pixels [N, 3] exceeds the reference's."""
    if not len(test):
        return float("nan")
    light, expected = (srgb_decode(image).mean(axis=-1) + 1e-4 for image in (test, reference))
    return float(np.median(np.log2(light / expected)))
