"""From the displayed image back to the light that made it, and forth: shaders/tone.glsl's curve.

Eight bits of display hold light to a hundredth where it is neither in the last shades before black
nor above white; what was clipped there comes back as _BRIGHTEST.
"""

import numpy as np
from numpy.typing import NDArray

Light = NDArray[np.float32]
"""float32 [H, W, 3], linear Rec.709; 1 is what a white surface in metered light reflects, about."""

# Khronos PBR Neutral (Khronos Group 2024, specification section 2), as in shaders/tone.glsl
_START = np.float32(0.8 - 0.04)
_ROOM = np.float32(1 - _START)
_DESATURATION = np.float32(0.15)
_BRIGHTEST = np.float32(12.0)
_TOP = np.float32(1 - _ROOM**2 / (_BRIGHTEST + _ROOM - _START))

_CODES = np.arange(256) / 255
# IEC 61966-2-1
_DECODED = np.where(_CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4).astype(
    np.float32
)
_STEPS = np.linspace(0, 1, 1 << 16)
_ENCODED = np.rint(
    255 * np.where(_STEPS <= 0.0031308, 12.92 * _STEPS, 1.055 * _STEPS ** (1 / 2.4) - 0.055)
).astype(np.uint8)


def light_of(image: NDArray[np.uint8]) -> Light:
    """The light that `displayed` would show as an sRGB image uint8 [H, W, 3]."""
    shown = _DECODED[image]
    peak = np.minimum(shown.max(axis=2), _TOP)
    bright = peak > _START
    if bright.any():
        new_peak = peak[bright][:, None]
        old_peak = _ROOM**2 / (1 - new_peak) - _ROOM + _START
        white = _DESATURATION * (old_peak - new_peak) + 1
        part = np.minimum(shown[bright], new_peak)
        shown[bright] = np.maximum((part - new_peak) * (old_peak * white / new_peak) + old_peak, 0)
    low = shown.min(axis=2)
    taken = np.where(low < 0.04, np.sqrt(low / np.float32(6.25)) - low, np.float32(0.04))
    return np.asarray(shown + taken[..., None], np.float32)


def displayed(light: Light) -> NDArray[np.uint8]:
    """Light through the tone curve and sRGB's encoding, uint8 [H, W, 3]; below 0 is black."""
    light = np.maximum(light, 0)
    low = light.min(axis=2)
    taken = np.where(low < 0.08, low - np.float32(6.25) * low * low, np.float32(0.04))
    shown = light - taken[..., None]
    peak = shown.max(axis=2)
    bright = peak > _START
    if bright.any():
        old_peak = peak[bright][:, None]
        new_peak = 1 - _ROOM**2 / (old_peak + _ROOM - _START)
        keep = 1 / (old_peak * (_DESATURATION * (old_peak - new_peak) + 1))
        shown[bright] = shown[bright] * (new_peak * keep) + (new_peak - new_peak * old_peak * keep)
    return _ENCODED[np.rint(np.clip(shown, 0, 1) * 65535).astype(np.uint16)]
