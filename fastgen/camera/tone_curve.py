"""Tone-mapping and sRGB encoding of linear light; the numpy twin of shaders/tone_curve.glsl.

Tone curve: Khronos PBR Neutral (Khronos Group 2024, specification section 2). The shader gets its
constants from here.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.srgb import ENCODED

Light = NDArray[np.float32]
"""float32 [H, W, 3], linear Rec. 709; a white surface in metered light is about 1."""

FRESNEL = 0.04
"""Offset that reflection of a dielectric adds to every colour; the curve subtracts it."""

SHOULDER = 0.8
"""Brightest channel up to which colours are unchanged, before the offset is subtracted."""

DESATURATION = 0.15
"""Rate at which colours above the shoulder approach white."""

_OFFSET = np.float32(FRESNEL)
_CURVE = np.float32(0.25 / FRESNEL)
_START = np.float32(SHOULDER - FRESNEL)
_ROOM = np.float32(1 - _START)
_DESATURATION = np.float32(DESATURATION)
_BRIGHTEST = np.float32(1e6)  # as in the shader; keeps the products below finite


def tone_map_and_encode(light: Light) -> NDArray[np.uint8]:
    """Return the sRGB image of linear light.

    Args:
        light: float32 [H, W, 3], exposed linear Rec. 709; negative values become black.

    Returns:
        uint8 [H, W, 3], within one code of the image that the shader draws.
    """
    red, green, blue = planes = [np.clip(plane, 0, _BRIGHTEST) for plane in cv2.split(light)]
    low = cv2.min(cv2.min(red, green), blue)
    offset = np.where(low < 2 * _OFFSET, low - _CURVE * low * low, _OFFSET)
    scale, white = _compressed(np.maximum(np.maximum(red, green), blue) - offset)
    white -= offset * scale
    encoded = [
        np.clip(plane * scale + white, 0, 1) * np.float32(65535) + np.float32(0.5)
        for plane in planes
    ]
    return _merged([ENCODED[plane.astype(np.uint16)] for plane in encoded])


def _compressed(peak: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the highlight compression as a factor and a summand, from the brightest channel."""
    # a peak clamped to the start makes the formula below the identity
    old = np.maximum(peak, _START)
    new = 1 - _ROOM**2 / (old + _ROOM - _START)
    keep = 1 / (old * (_DESATURATION * (old - new) + 1))
    return np.asarray(new * keep, np.float32), np.asarray(new - new * old * keep, np.float32)


def _merged(planes: list[NDArray[Any]]) -> NDArray[Any]:
    return np.asarray(cv2.merge(planes))
