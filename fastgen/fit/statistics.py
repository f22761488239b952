"""Named statistics of pictures, which describe a camera and its surroundings without labels."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.fit.edges import edge_blur_and_overshoot
from fastgen.srgb import DECODED

Pixels = NDArray[np.uint8]
"""sRGB picture [H, W, 3]."""

Plane = NDArray[np.float32]


class Statistic(NamedTuple):
    """Meaning of one statistic.

    Attributes:
        cue: Property of the pictures that it belongs to.
        floor: Smallest spread over pictures that differences are compared with.
    """

    cue: str
    floor: float


QUANTILES = (1, 5, 25, 50, 75, 95, 99)
_SATURATIONS = (25, 50, 75, 95)
_HUES = {
    "red and brown": (345, 25),
    "orange and yellow": (25, 70),
    "green": (70, 165),
    "turquoise": (165, 200),
    "blue": (200, 260),
    "purple": (260, 345),
}
"""First and last hue of each group of paints, in degrees."""

STATISTICS: dict[str, Statistic] = {
    **{f"luminance, {q} %": Statistic("exposure and response", 0.03) for q in QUANTILES},
    "contrast": Statistic("exposure and response", 0.02),
    "clipped share": Statistic("exposure and response", 0.02),
    "black share": Statistic("exposure and response", 0.02),
    "red over green": Statistic("white balance", 0.05),
    "blue over green": Statistic("white balance", 0.05),
    **{f"saturation, {q} %": Statistic("saturation", 0.03) for q in _SATURATIONS},
    **{f"{name} share": Statistic("paints", 0.04) for name in _HUES},
    "noise": Statistic("noise", 0.15),
    "chroma noise": Statistic("chroma noise", 0.15),
    "edge blur": Statistic("sharpness", 0.1),
    "fine over middle detail": Statistic("sharpness", 0.1),
    "overshoot of edges": Statistic("sharpening", 0.02),
    "blockiness": Statistic("JPEG", 0.04),
    "corner light": Statistic("vignetting", 0.2),
    "sky share": Statistic("sky", 0.05),
}
"""Statistics by name, in the order of `measured`.

Luminance, contrast and saturation are encoded values 0..1. Colour ratios and corner light are in
stops. Noise is log2 of a standard deviation in 8-bit codes, detail and blockiness are log2 of
ratios, edge blur is a standard deviation in pixels, and shares are relative to all pixels.
"""

NAMES = tuple(STATISTICS)

_CLIPPED, _BLACK = 243 / 255, 12 / 255
_FLAT_SHARE = 0.25
_MAD_TO_SIGMA = 1.4826  # for a normal distribution
_FEWEST_PIXELS = 200
_SOME = slice(None, None, 2), slice(None, None, 2)
"""A quarter of the pixels, which is enough for quantiles."""

_QUIETEST = 0.25
"""Constant in codes that is added to noise before the logarithm; rounding to 8 bits hides less."""


class Planes(NamedTuple):
    """Float32 planes [H, W] of a picture; values are encoded, 0..1.

    Attributes:
        rgb: The picture, [H, W, 3].
        grey: Luma (ITU-R BT.601).
        hue: Hue in degrees.
        saturation: Distance from grey, 0..1.
        smooth: Luma after a Gaussian blur of 4 pixels.
        local: Standard deviation of luma within that blur.
        fine: Luma minus its Gaussian blur of 1 pixel.
        middle: Difference of the two blurs.
        flat: Mask of the quarter of the pixels with the lowest `local`, which shows the noise.
    """

    rgb: Plane
    grey: Plane
    hue: Plane
    saturation: Plane
    smooth: Plane
    local: Plane
    fine: Plane
    middle: Plane
    flat: NDArray[np.bool_]


def scaled(pixels: Pixels, longest: int) -> Pixels:
    """Return a picture after scaling its longer side to `longest` pixels."""
    scale = longest / max(pixels.shape[:2])
    size = (max(round(pixels.shape[1] * scale), 8), max(round(pixels.shape[0] * scale), 8))
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(pixels, size, interpolation=way), np.uint8)


def planes_of(pixels: Pixels) -> Planes:
    """Return the planes that statistics are computed from."""
    rgb = (pixels / 255).astype(np.float32)
    grey = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.float32)
    hue, saturation, _ = np.moveaxis(cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV), 2, 0)
    mean, square = (
        np.asarray(cv2.GaussianBlur(a, (0, 0), 4.0), np.float32) for a in (grey, grey * grey)
    )
    local = np.sqrt(np.maximum(square - mean * mean, 0))
    blurred = cv2.GaussianBlur(grey, (0, 0), 1.0)
    flat = local <= np.quantile(local, _FLAT_SHARE)
    return Planes(
        rgb, grey, hue, saturation, mean, local, grey - blurred, blurred - mean, np.asarray(flat)
    )


def measured(pixels: Pixels) -> NDArray[np.float64]:
    """Return the statistics of a picture.

    Args:
        pixels: uint8 [H, W, 3], sRGB, at least 64 pixels on each side.

    Returns:
        float64 [len(NAMES)]; nan where a picture does not show the property, for example the noise
        of a picture whose flat areas are all black.
    """
    p = planes_of(pixels)
    sky = sky_like(p)
    clipped = (pixels.min(axis=2) >= _CLIPPED * 255).mean()
    black = (p.grey <= _BLACK).mean()
    colored = (p.saturation > 0.3) & (p.grey > 0.05) & ~sky
    shares = [float((colored & _within(p.hue, *ends)).mean()) for ends in _HUES.values()]
    blur, overshoot = edge_blur_and_overshoot(p.grey)
    values = [
        *np.percentile(p.grey[_SOME], QUANTILES),
        p.grey.std(),
        clipped,
        black,
        *_white_balance(pixels, p),
        *np.percentile(p.saturation[_SOME], _SATURATIONS),
        *shares,
        *_noise(p),
        blur,
        np.log2((p.fine.std() + 1e-4) / (p.middle.std() + 1e-4)),
        overshoot,
        _blockiness(p.grey),
        _corner_light(pixels),
        sky.mean(),
    ]
    return np.array(values, np.float64)


def sky_like(p: Planes) -> NDArray[np.bool_]:
    """Return the mask [H, W] of bright, smooth, white to blue pixels above the picture's middle."""
    blue = (p.saturation < 0.12) | ((p.hue > 180) & (p.hue < 260) & (p.saturation < 0.6))
    mask = (p.smooth > 0.45) & (p.local < 0.03) & blue
    mask[round(0.6 * len(mask)) :] = False
    return np.asarray(mask)


def _within(hue: Plane, first: float, last: float) -> NDArray[np.bool_]:
    if first < last:
        return np.asarray((hue >= first) & (hue < last))
    return np.asarray((hue >= first) | (hue < last))


def _white_balance(pixels: Pixels, p: Planes) -> tuple[float, float]:
    """Return red and blue over green in stops, of the 30 % of mid-tones nearest to grey."""
    mid = (p.grey > 0.15) & (p.grey < _CLIPPED)
    if mid.sum() < _FEWEST_PIXELS:
        return np.nan, np.nan
    neutral = mid & (p.saturation <= np.quantile(p.saturation[mid], 0.3))
    light = np.maximum(DECODED[pixels[neutral]], 1e-4)
    red, blue = (float(np.log2(light[:, k] / light[:, 1]).mean()) for k in (0, 2))
    return red, blue


def _residual_of_blur(sigma: float) -> float:
    """Return the standard deviation of white noise of 1 minus its Gaussian blur."""
    row = cv2.getGaussianKernel(2 * round(4 * sigma) + 1, sigma).ravel()
    return float(np.sqrt(1 - 2 * row.max() ** 2 + (row**2).sum() ** 2))


_FINE_GAIN = _residual_of_blur(1.0)


def _noise(p: Planes) -> tuple[float, float]:
    """Return luma noise and chroma noise in flat mid-tones, as log2 of codes.

    Chroma noise is a band between 1 and 4 pixels, so that it does not contain the sensor's noise.
    """
    flat = p.flat & (p.grey > 0.06) & (p.grey < 0.93)
    if flat.sum() < _FEWEST_PIXELS:
        return np.nan, np.nan
    luma = _sigma(p.fine[flat]) / _FINE_GAIN
    chroma = np.stack([0.713 * (p.rgb[..., 0] - p.grey), 0.564 * (p.rgb[..., 2] - p.grey)], axis=2)
    band = cv2.GaussianBlur(chroma, (0, 0), 1.0) - cv2.GaussianBlur(chroma, (0, 0), 4.0)
    color = 0.5 * (_sigma(band[..., 0][flat]) + _sigma(band[..., 1][flat]))
    return tuple(float(np.log2(255 * sigma + _QUIETEST)) for sigma in (luma, color))  # type: ignore[return-value]


def _sigma(values: Plane) -> float:
    return float(_MAD_TO_SIGMA * np.median(np.abs(values - np.median(values))))


def _blockiness(grey: Plane) -> float:
    """Return log2 of the mean step across the edges of 8x8 blocks over that inside of blocks."""
    found = []
    for plane in (grey, grey.T):
        steps = np.abs(np.diff(plane, axis=1)).mean(axis=0)
        edge = np.arange(len(steps)) % 8 == 7
        found.append(np.log2((steps[edge].mean() + 1e-4) / (steps[~edge].mean() + 1e-4)))
    return float(np.mean(found))


def _corner_light(pixels: Pixels) -> float:
    """Return the median light of the four corners over that of the centre, in stops."""
    height, width = pixels.shape[:2]
    luma = DECODED[pixels[..., 1]]  # green is near luminance
    tall, wide = height // 6, width // 6
    rows, columns = (slice(tall), slice(-tall, None)), (slice(wide), slice(-wide, None))
    corners = [luma[y, x] for y in rows for x in columns]
    center = luma[height // 3 : -(height // 3), width // 3 : -(width // 3)]
    return float(np.log2((np.median(corners) + 1e-3) / (np.median(center) + 1e-3)))
