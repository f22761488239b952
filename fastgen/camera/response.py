"""Response curves of cameras, from linear light to the encoded image.

Unlike the neutral tone curve, they clip: light that fills a pixel's well is white in every channel.
"""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.tone_curve import Light
from fastgen.scene import REC_709
from fastgen.scene.optics import Response
from fastgen.srgb import encoded

_CODES = 1 << 14
"""Steps of the stored curve; sensors deliver up to 14 bits."""

_GREY = float(encoded(np.array(0.18)))
"""Encoded middle grey, which contrast leaves unchanged."""


def respond(light: Light, response: Response) -> NDArray[np.uint8]:
    """Return the image that a camera with a response curve makes of linear light.

    The wells fill at `response.clip`. Saturation then moves colours away from their luminance, and
    `response_curve` is applied to each channel.

    Args:
        light: float32 [H, W, 3], exposed linear Rec. 709; negative values become black.
        response: Parameters of the curve.

    Returns:
        uint8 [H, W, 3], sRGB.
    """
    mix = response.saturation * np.eye(3) + (1 - response.saturation) * REC_709
    wells = np.clip(light, 0, np.float32(response.clip))
    scale = (_CODES - 1) / response.clip
    codes = np.asarray(cv2.transform(wells, (mix * scale).astype(np.float32)), np.float32)
    np.clip(codes, 0, _CODES - 1, out=codes)
    codes += np.float32(0.5)
    return _table(response).take(codes.astype(np.uint16))


@lru_cache(maxsize=16)
def _table(response: Response) -> NDArray[np.uint8]:
    """Return the encoded values of _CODES steps of light from 0 to `response.clip`."""
    steps = np.linspace(0, response.clip, _CODES)
    return np.asarray(np.rint(255 * response_curve(steps, response)), np.uint8)


def response_curve(light: NDArray[np.floating], response: Response) -> NDArray[np.floating]:
    """Return the encoded values 0..1 of one channel's linear light.

    The curve is straight up to the knee 2 - clip. A parabola continues it without a bend, and
    reaches 1 with slope 0 at clip. After sRGB encoding, a power of the distance to black, and above
    middle grey to white, adds contrast.

    Args:
        light: Values of any shape, 0..clip.
        response: Parameters of the curve; its saturation is ignored.
    """
    room = response.clip - 1  # of the parabola below white
    bent = 1 - (response.clip - light) ** 2 / (4 * max(room, 1e-9))
    value = encoded(np.where(light <= 1 - room, light, bent))
    dark, bright = value / _GREY, (1 - value) / (1 - _GREY)
    return np.where(
        value <= _GREY,
        _GREY * dark**response.contrast,
        1 - (1 - _GREY) * bright**response.contrast,
    )
