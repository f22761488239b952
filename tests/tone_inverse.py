"""Inverse of the tone curve and sRGB encoding, for tests that compare light in images."""

import numpy as np

from fastgen.camera import tone_curve
from fastgen.srgb import DECODED

_START = tone_curve.SHOULDER - tone_curve.FRESNEL
_ROOM = 1 - _START
_TOP = 1 - _ROOM**2 / (12 + _ROOM - _START)


def light_of(image):
    """Return linear light float32 [H, W, 3] whose tone-mapped and encoded image is `image`.

    Eight bits determine light to about 1 % except near black and white. White becomes a radiance
    of 12.
    """
    color = DECODED[image].astype(np.float64)
    peak = color.max(axis=-1, keepdims=True)
    new = np.clip(peak, _START, _TOP)
    old = _ROOM**2 / (1 - new) - _ROOM + _START
    scale = old * (tone_curve.DESATURATION * (old - new) + 1) / new
    color = np.maximum(color * scale + old - new * scale, 0)
    low = color.min(axis=-1, keepdims=True)
    offset = tone_curve.FRESNEL
    color += np.where(low < offset, np.sqrt(4 * offset * low) - low, offset)
    return np.maximum(color, 0).astype(np.float32)
