"""Vignetting and noise of linear light; what cameras do to the encoded image."""

import math
from functools import lru_cache
from statistics import NormalDist

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fastgen.camera.tone_curve import Light
from fastgen.scene.optics import ChromaNoise, Noise, Sharpening, Stamp

_CHROMA_TO_RGB = np.array([[0, 1.402], [-0.344136, -0.714136], [1.772, 0]])
"""Red, green and blue per unit of Cb and Cr at constant luma (ITU-R BT.601, as in JFIF)."""

_QUANTILES = 1 << 16

_FONT = cv2.FONT_HERSHEY_DUPLEX
_CAP_PX = 21.0
"""Height of the font's capitals at scale 1."""


def vignette(size: tuple[int, int], corner_loss: float) -> Light:
    """Return the transmission of the lens at each pixel: cos^4 of an angle to the axis.

    cos^4 a = (1 + tan^2 a)^-2; the angle is scaled so that the corners lose `corner_loss`.

    Args:
        size: (width, height) in pixels.
        corner_loss: Share of the light lost in the corners, 0 to less than 1.

    Returns:
        float32 [H, W, 1], 0..1.
    """
    width, height = size
    x = (np.arange(width, dtype=np.float32) + 0.5) / width * 2 - 1
    y = (np.arange(height, dtype=np.float32) + 0.5) / height * 2 - 1
    across, down = width**2 / (width**2 + height**2), height**2 / (width**2 + height**2)
    fall = np.asarray(across * x**2 + down * y[:, None] ** 2, np.float32)
    fall *= np.float32((1 - corner_loss) ** -0.5 - 1)
    fall += 1
    np.reciprocal(fall, out=fall)
    fall *= fall
    return fall[..., None]


def noisy(
    light: Light, noise: Noise, gain: float = 1.0, raw: np.random.SFC64 | None = None
) -> Light:
    """Return light with shot noise and read noise.

    Light of 1 is the full well divided by the gain, in electrons.

    EMVA 1288 release 4.0, section 2.2: sigma^2 = sigma_d^2 + mu electrons. A normal distribution
    approximates the Poisson distribution of the electron count, which is close above ten electrons.
    The channels of a pixel are independent; demosaicing is not modelled.

    Args:
        light: float32 [H, W, 3].
        noise: Parameters of the sensor.
        gain: Sensor gain, 1 at base ISO.
        raw: Source of random numbers, for bands of one image; by default a new one with the seed of
            `noise`.

    Returns:
        float32 [H, W, 3]. Read noise may make dark pixels negative.
    """
    well = np.float32(noise.full_well_e / gain)
    result = np.maximum(light, 0)
    result *= well
    result += np.float32(noise.read_noise_e**2)
    np.sqrt(result, out=result)
    result *= _standard_normal(raw or np.random.SFC64(noise.seed), light.shape)
    result *= 1 / well
    result += light
    return result


def _standard_normal(raw: np.random.SFC64, shape: tuple[int, ...]) -> Light:
    """Return normally distributed numbers of a shape, in a third of NumPy's time."""
    count = math.prod(shape)
    codes = raw.random_raw(-(-count // 4)).view(np.uint16)[:count]
    return _quantiles().take(codes).reshape(shape)


@lru_cache(maxsize=1)
def _quantiles() -> Light:
    """Return the middle of each of equally probable ranges of the standard normal distribution.

    They reach 4.3 standard deviations; their variance is 0.99998.
    """
    inverse = NormalDist().inv_cdf
    above = [inverse(0.5 + (k + 0.5) / _QUANTILES) for k in range(_QUANTILES // 2)]
    return np.array([-value for value in above[::-1]] + above, np.float32)


def with_chroma_noise(
    image: NDArray[np.uint8], noise: ChromaNoise, gain: float = 1.0
) -> NDArray[np.uint8]:
    """Return the image [H, W, 3] with blotches of colour.

    Cb and Cr change independently and the luma stays, except where a channel clips. The strength is
    the same at all levels of light, because encoding makes shot noise nearly uniform. It grows with
    the square root of the gain, as shot noise does.
    """
    rng = np.random.Generator(np.random.SFC64(noise.seed))
    height, width = image.shape[:2]
    rows, columns = (max(round(n / noise.scale_px), 1) + 1 for n in (height, width))
    # bilinear interpolation leaves 2/3 of the standard deviation on average over a cell
    deviation = 255 * 1.5 * noise.strength * gain**0.5
    codes = deviation * rng.standard_normal((rows, columns, 2), np.float32)
    coarse = np.asarray(codes @ _CHROMA_TO_RGB.T.astype(np.float32), np.float32)
    blotches = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.add(image, blotches, dtype=cv2.CV_8U), np.uint8)


def sharpened(image: NDArray[np.uint8], sharpening: Sharpening) -> NDArray[np.uint8]:
    """Return the image [H, W, 3] plus a multiple of its difference to a Gaussian blur."""
    blurred = cv2.GaussianBlur(image, (0, 0), sharpening.radius_px)
    amount = sharpening.amount
    return np.asarray(cv2.addWeighted(image, 1 + amount, blurred, -amount, 0), np.uint8)


def stamped(image: NDArray[np.uint8], stamp: Stamp) -> NDArray[np.uint8]:
    """Return the image [H, W, 3] with white, black-edged text burnt into a corner.

    Text that is wider than the image is scaled down to fit.
    """
    height, width = image.shape[:2]
    scale = max(stamp.height * height, 5.0) / _CAP_PX
    (long, tall), _ = cv2.getTextSize(stamp.text, _FONT, 1.0, 1)
    scale = min(scale, width / (long + 2 * tall))
    stroke = max(round(1.2 * scale), 1)
    (long, tall), _ = cv2.getTextSize(stamp.text, _FONT, scale, stroke)
    margin = tall
    x = margin if "left" in stamp.corner else max(width - margin - long, 0)
    y = margin + tall if "top" in stamp.corner else height - margin
    ink = np.zeros((height, width), np.uint8)
    cv2.putText(ink, stamp.text, (x, y), _FONT, scale, (255,), stroke, cv2.LINE_AA)
    edge = cv2.dilate(ink, np.ones((2 * stroke + 1,) * 2, np.uint8))
    across, down, wide, high = cv2.boundingRect(edge)
    part = slice(down, down + high), slice(across, across + wide)
    white, dark = (mask[part][..., None].astype(np.float32) / 255 for mask in (ink, edge))
    result = image.copy()
    result[part] = np.rint(np.minimum(image[part] * (1 - dark) + 255 * white, 255))
    return result


def compress_jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return the image [H, W, 3] after JPEG compression with 4:2:0 chroma subsampling."""
    data = simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=quality, colorspace="RGB", colorsubsampling="420"
    )
    return np.asarray(simplejpeg.decode_jpeg(data, colorspace="RGB"), np.uint8)
