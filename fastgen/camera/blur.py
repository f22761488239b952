"""Defocus and motion blur of linear light."""

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.tone_curve import Light
from fastgen.scene import Camera
from fastgen.scene.optics import Defocus

_FINE = 8
"""Subpixels along each side of a pixel when a kernel is drawn, for smooth edges."""

_LEVELS = 4
"""Number of uniformly blurred images; each pixel interpolates between two of them."""

_LEAST_PX = 0.3
"""Smaller blur radii have no effect."""

_MOST_PX = 40.0


def blur_radius_px(
    defocus: Defocus, camera: Camera, width: int, depth_m: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the radius of the circle of confusion of a thin lens at each depth.

    Its diameter is A f |z - s| / (z (s - f)), with the aperture diameter A = f / N, focal length f
    and focus distance s (Potmesil and Chakravarty 1981, "A Lens and Aperture Camera Model", eq. 2
    and 3).

    Args:
        defocus: Focus distance and f-number.
        camera: Focal length and sensor width.
        width: Image width in pixels.
        depth_m: float32 [H, W], metres along the optical axis; may be inf.

    Returns:
        float32 [H, W], pixels, at most 40.
    """
    f, s = camera.focal_mm, max(defocus.focus_mm, 1.1 * camera.focal_mm)
    diameter_mm = f * f / defocus.f_number / (s - f) * np.abs(1 - s * 1e-3 / depth_m)
    radius = 0.5 * diameter_mm / camera.sensor_width_mm * width
    return np.asarray(np.minimum(radius, _MOST_PX), np.float32)


def defocused(light: Light, radius_px: NDArray[np.float32]) -> Light:
    """Return light in which each pixel is the mean over a disc of its own radius [H, W]."""
    low, high = float(radius_px.min()), float(radius_px.max())
    if high < _LEAST_PX:
        return light
    levels = np.linspace(low, high, _LEVELS) if high - low > 0.2 else np.array([high])
    result = np.zeros_like(light)
    step = levels[1] - levels[0] if len(levels) > 1 else 1.0
    for level in levels:
        share = np.clip(1 - np.abs(radius_px - np.float32(level)) / np.float32(step), 0, 1)
        if share.any():
            blurred = cv2.filter2D(light, -1, _disc(float(level)), borderType=cv2.BORDER_REFLECT)
            share = share if len(levels) > 1 else np.ones_like(share)
            result += cv2.merge([share] * 3) * blurred
    return result


def motion_blurred(light: Light, motion_px: tuple[float, float]) -> Light:
    """Return light blurred by image motion while the shutter is open.

    Args:
        light: float32 [H, W, 3].
        motion_px: Displacement of the image during the exposure, (right, down) in pixels. Each
            pixel becomes the mean along this line, centred on the pixel.
    """
    if np.hypot(*motion_px) < _LEAST_PX:
        return light
    return np.asarray(
        cv2.filter2D(light, -1, _line(motion_px), borderType=cv2.BORDER_REFLECT), np.float32
    )


def _disc(radius_px: float) -> NDArray[np.float32]:
    if radius_px < _LEAST_PX:
        return np.ones((1, 1), np.float32)
    half = int(np.ceil(radius_px - 0.5))
    at = (np.arange(_FINE * (2 * half + 1)) + 0.5) / _FINE - half - 0.5
    return _averaged(np.hypot(at[:, None], at) <= radius_px)


def _line(motion_px: tuple[float, float]) -> NDArray[np.float32]:
    """Return a kernel of a line; bilinear weights share each of its points among four pixels."""
    half = int(np.ceil(max(map(abs, motion_px)) / 2 + 0.5))
    along = (np.arange(256) + 0.5) / 256 - 0.5
    points = along[:, None] * motion_px + half
    low = np.floor(points).astype(int)
    kernel = np.zeros((2 * half + 2,) * 2, np.float64)
    for down in (0, 1):
        for right in (0, 1):
            share = np.abs(1 - np.array([right, down]) - (points - low)).prod(axis=1)
            np.add.at(kernel, (low[:, 1] + down, low[:, 0] + right), share)
    kernel = kernel[: 2 * half + 1, : 2 * half + 1]
    return np.asarray(kernel / kernel.sum(), np.float32)


def _averaged(fine: NDArray[np.bool_]) -> NDArray[np.float32]:
    side = len(fine) // _FINE
    kernel = fine.reshape(side, _FINE, side, _FINE).mean(axis=(1, 3))
    return np.asarray(kernel / kernel.sum(), np.float32)
