"""From the displayed image back to the light that made it, and forth: shaders/tone.glsl's curve.

Eight bits of display hold light to a hundredth where it is neither in the last shades before black
nor above white; what was clipped there comes back as _BRIGHTEST.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera import tone
from fastgen.srgb import DECODED, ENCODED

Light = NDArray[np.float32]
"""float32 [H, W, 3], linear Rec.709; 1 is what a white surface in metered light reflects, about."""

_FRESNEL = np.float32(tone.FRESNEL)
_CURVE = np.float32(0.25 / tone.FRESNEL)
_START = np.float32(tone.SHOULDER - tone.FRESNEL)
_ROOM = np.float32(1 - _START)
_DESATURATION = np.float32(tone.DESATURATION)
_BRIGHTEST = np.float32(12.0)
_TOP = np.float32(1 - _ROOM**2 / (_BRIGHTEST + _ROOM - _START))


def light_of(image: NDArray[np.uint8]) -> Light:
    """The light that `displayed` would show as an sRGB image uint8 [H, W, 3]."""
    red, green, blue = planes = cv2.split(image)
    peak = cv2.max(cv2.max(red, green), blue)
    scale, offset = _UNSHOWN_SCALE[peak], _UNSHOWN_OFFSET[peak]
    low = DECODED[cv2.min(cv2.min(red, green), blue)] * scale + offset
    low = np.maximum(low, 0)
    offset += np.where(low < _FRESNEL, np.sqrt(low / _CURVE) - low, _FRESNEL)
    return _joined([np.maximum(DECODED[plane] * scale + offset, 0) for plane in planes])


def displayed(light: Light) -> NDArray[np.uint8]:
    """Light through the tone curve and sRGB's encoding, uint8 [H, W, 3]; below 0 is black."""
    red, green, blue = planes = [np.maximum(plane, 0) for plane in cv2.split(light)]
    low = cv2.min(cv2.min(red, green), blue)
    taken = np.where(low < 2 * _FRESNEL, low - _CURVE * low * low, _FRESNEL)
    scale, offset = _shown(np.maximum(np.maximum(red, green), blue) - taken)
    offset -= taken * scale
    shown = [
        np.clip(plane * scale + offset, 0, 1) * np.float32(65535) + np.float32(0.5)
        for plane in planes
    ]
    return _joined([ENCODED[plane.astype(np.uint16)] for plane in shown])


def _shown(peak: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The tone curve's shoulder as a factor and a summand, by the brightest channel."""
    # where that is below the start, the formula leaves everything as it is
    old = np.maximum(peak, _START)
    new = 1 - _ROOM**2 / (old + _ROOM - _START)
    keep = 1 / (old * (_DESATURATION * (old - new) + 1))
    return np.asarray(new * keep, np.float32), np.asarray(new - new * old * keep, np.float32)


def _unshown() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The inverse of `_shown`, by the brightest channel's eight bits."""
    new = np.clip(DECODED, _START, _TOP)
    old = _ROOM**2 / (1 - new) - _ROOM + _START
    scale = old * (_DESATURATION * (old - new) + 1) / new
    return np.asarray(scale, np.float32), np.asarray(old - new * scale, np.float32)


_UNSHOWN_SCALE, _UNSHOWN_OFFSET = _unshown()


def _joined(planes: list[NDArray[Any]]) -> NDArray[Any]:
    return np.asarray(cv2.merge(planes))
