"""Error measures between images, and the conversion from radiance to displayed sRGB."""

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import SPREADER_ID
from fastgen.sample import Sample

STEP_M = 0.15  # more than the depth of a wall's corrugation
OCCLUDED = 0.8  # sky visibility below this means a corner or the valley of a corrugation

Array = NDArray[np.floating]
Measures = tuple[float, float, float]
"""Mean FLIP, mean SSIM, and PSNR in dB."""


def displayed(radiance: Array, exposure: float) -> Array:
    """Return linear radiance [..., 3] as sRGB in 0..1, exposed and tone-mapped like the renderer
    does."""
    return srgb_encode(neutral_tone(exposure * radiance))


def neutral_tone(color: Array) -> Array:
    """Apply the Khronos PBR Neutral tone curve to linear colours [..., 3].

    Twin of shaders/tone_curve.glsl.
    """
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
    """Convert linear [..., 3] in 0..1 to sRGB in 0..1 (IEC 61966-2-1)."""
    color = np.clip(color, 0.0, 1.0)
    curve = 1.055 * np.maximum(color, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(color <= 0.0031308, 12.92 * color, curve)


def srgb_decode(color: Array) -> Array:
    """Convert sRGB [..., 3] in 0..1 to linear in 0..1."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Per-pixel difference [H, W] between two sRGB images in 0..1.

    Attributes:
        flip_map: FLIP (Andersson et al. 2020).
        similarity_map: SSIM, mean over the channels.
        squared: Squared difference, mean over the channels.
    """

    flip_map: Array
    similarity_map: Array
    squared: Array

    @staticmethod
    def of(reference: Array, test: Array) -> "Comparison":
        """Compare `test` with `reference`, both sRGB [H, W, 3] in 0..1.

        FLIP assumes its default viewing distance, 67 pixels per degree.
        """
        metrics = _imported("skimage.metrics")
        a, b = reference.astype(np.float32), test.astype(np.float32)
        _, similarity = metrics.structural_similarity(
            a, b, channel_axis=2, data_range=1.0, full=True
        )
        return Comparison(flip(a, b), similarity.mean(axis=2), ((a - b) ** 2).mean(axis=2))

    def measures(self, where: NDArray[np.bool_]) -> Measures:
        """Return FLIP, SSIM and PSNR over the mask `where` [H, W]."""
        psnr = -10 * np.log10(max(float(self.squared[where].mean()), 1e-12))
        return float(self.flip_map[where].mean()), float(self.similarity_map[where].mean()), psnr

    def both(self, inside: NDArray[np.bool_]) -> tuple[float, ...]:
        """Return the measures over the whole image, then over the mask `inside` of the objects."""
        return *self.measures(inside | True), *self.measures(inside)


def flip(reference: Array, test: Array) -> Array:
    """Return the FLIP map [H, W] between two sRGB images in 0..1."""
    evaluator = _imported("flip_evaluator")
    a, b = reference.astype(np.float32), test.astype(np.float32)
    found: Array = evaluator.evaluate(a, b, "LDR", applyMagma=False)[0][..., 0]
    return found


def _imported(name: str) -> Any:
    """Import a module of the `accuracy` extra only when it is used, so that --help works without
    it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SystemExit(
            "FLIP and SSIM need more packages: run pip install '.[accuracy]'"
        ) from None


def borders(ids: NDArray[np.integer], depth_m: Array) -> NDArray[np.bool_]:
    """Return a mask of the pixels next to another object or to a depth step above STEP_M.

    Args:
        ids: Object ids [H, W].
        depth_m: Depth [H, W] in metres, inf where nothing is hit.
    """
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
    """Return a mask [H, W] for each part of an image where errors have a cause of their own.

    Args:
        sample: The rendered image.
        openness: Sky visibility [H, W] from the reference's ambient occlusion, 1 in the open.
    """
    inside = sample.ids > 0
    plane = ~inside & np.isfinite(sample.depth)
    edges = borders(sample.ids, np.where(inside, sample.depth, np.inf))
    plain = inside & ~edges & (sample.ids == 1)
    return {
        "background": ~inside & ~plane & ~edges,
        "ground and props": plane & ~edges,
        "edges": edges,
        "markers and text": ~edges & (sample.ids > 1) & (sample.ids < SPREADER_ID),
        "spreader": ~edges & (sample.ids == SPREADER_ID),
        "open sheet": plain & (openness >= OCCLUDED),
        "occluded sheet": plain & (openness < OCCLUDED),
    }


def stops_over(test: Array, reference: Array) -> float:
    """Return the median number of stops by which `test` is brighter than `reference`.

    Both are sRGB pixels [N, 3]. The result is nan if there are none.
    """
    if not len(test):
        return float("nan")
    light, expected = (srgb_decode(image).mean(axis=-1) + 1e-4 for image in (test, reference))
    return float(np.median(np.log2(light / expected)))
