"""Values of the view's uniform block that describe the camera."""

import numpy as np
from numpy.typing import ArrayLike

from fastgen.camera.projection import View
from fastgen.render.passes.ray_points import point_step
from fastgen.render.visibility_buffer import VisibilityBuffer
from fastgen.scene import Scene


def view_values(
    scene: Scene, view: View, samples: VisibilityBuffer, exposure: float
) -> dict[str, ArrayLike]:
    """Return the members of VIEW_BLOCK about the camera."""
    to_samples = np.eye(4)
    to_samples[:2, :2] = samples.to_clip
    right, down, forward = view.rotation
    center_x, center_y = view.center_px
    focal_x, focal_y = view.focals_px
    yaw = np.deg2rad(scene.environment.yaw_deg)
    return {
        "world_to_clip": to_samples @ view.clip_matrix(),
        "ray_corner": forward - (center_x * right + center_y / view.pixel_aspect * down) / focal_x,
        "eye_m": view.position_m,
        "ray_right": right / focal_x,
        "ray_down": down / focal_y,
        "pixel_angle": 1 / focal_x,
        "exposure": exposure,
        "yaw": (np.cos(yaw), np.sin(yaw)),
        "point_step": point_step(view.size),
        **view.lens_values(samples.to_clip),
    }
