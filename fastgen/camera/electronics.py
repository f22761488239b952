"""What happens behind the lens: fall-off, gains and noise on light; stamps and JPEG on display."""

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fastgen.camera.tone_curve import Light
from fastgen.scene.optics import Noise, Stamp

_FONT = cv2.FONT_HERSHEY_DUPLEX
_CAP_PX = 21.0
"""Height of that font's capitals at scale 1."""


def falloff(size: tuple[int, int], corner_loss: float) -> Light:
    """Share of light that each pixel gets, float32 [H, W, 1]: cos^4 of an angle to the axis.

    size: (width, height). cos^4 a = (1 + tan^2 a)^-2, its angle such that the corners lose
    `corner_loss`, 0 to less than 1.
    """
    width, height = size
    x = (np.arange(width, dtype=np.float32) + 0.5) / width * 2 - 1
    y = (np.arange(height, dtype=np.float32) + 0.5) / height * 2 - 1
    across, down = width**2 / (width**2 + height**2), height**2 / (width**2 + height**2)
    square = across * x**2 + down * y[:, None] ** 2
    steep = (1 - corner_loss) ** -0.5 - 1
    return np.asarray(((1 + steep * square) ** -2)[..., None], np.float32)


def noisy(light: Light, noise: Noise) -> Light:
    """Light as a sensor counts it: shot noise, whose variance is the count, and read noise.

    EMVA 1288 release 4.0, section 2.2: sigma^2 = sigma_d^2 + mu electrons. The Poisson law of the
    count is taken as a normal one, which from ten electrons on it nearly is. Colours are counted
    for each pixel by itself, as after a demosaicing that blurs nothing.
    """
    rng = np.random.Generator(np.random.SFC64(noise.seed))
    well = np.float32(noise.full_well_e)
    variance = np.maximum(light, 0) * well + np.float32(noise.read_noise_e**2)
    spread = np.sqrt(variance, out=variance)
    spread *= rng.standard_normal(light.shape, np.float32)
    spread /= well
    spread += light
    return np.asarray(spread, np.float32)


def stamped(image: NDArray[np.uint8], stamp: Stamp) -> NDArray[np.uint8]:
    """The image [H, W, 3] with white text, edged in black, burnt into a corner; smaller than asked
    where it would not fit across."""
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
    white, dark = (mask[..., None].astype(np.float32) / 255 for mask in (ink, edge))
    return np.asarray(np.rint(np.minimum(image * (1 - dark) + 255 * white, 255)), np.uint8)


def through_jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """The image [H, W, 3] as a camera's JPEG encoder of `quality` leaves it, colour halved."""
    data = simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=quality, colorspace="RGB", colorsubsampling="420"
    )
    return np.asarray(simplejpeg.decode_jpeg(data, colorspace="RGB"), np.uint8)
