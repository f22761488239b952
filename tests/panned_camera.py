"""A small turn of a camera, for measurements of how images change while it moves."""

from dataclasses import replace

import numpy as np

from fastgen.scene import Camera


def panned(camera: Camera, width_px: int) -> Camera:
    """Return a camera that is turned to the side by half a pixel of images of a width."""
    target = np.array(camera.target_mm)
    ahead = target - camera.position_mm
    side = np.cross(ahead, (0, 0, 1))
    half_pixel = 0.5 * camera.sensor_width_mm / (width_px * camera.focal_mm)
    moved = target + half_pixel * np.linalg.norm(ahead) * side / np.linalg.norm(side)
    x, y, z = moved.tolist()
    return replace(camera, target_mm=(x, y, z))
