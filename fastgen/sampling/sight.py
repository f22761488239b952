"""Estimate of how much of a container other containers hide from a camera."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import view_of
from fastgen.scene import Camera
from fastgen.scene.boxes import OrientedBox

_STEPS = 8
"""Points along each side of a face."""

Array = NDArray[np.float64]


class Sight:
    """Visible points on a container's outer box, each marked as hidden or not.

    Only points within the image count. The image is taken as square and without distortion.

    Args:
        box: The box.
        camera: The camera, outside the box.
    """

    def __init__(self, box: OrientedBox, camera: Camera) -> None:
        self._eye = np.array(camera.position_mm)
        points, sizes = _points_toward(box, self._eye)
        x, y, z = view_of(replace(camera, lens=None), (1, 1)).rotation @ (points - self._eye).T
        reach = z * camera.sensor_width_mm / (2 * camera.focal_mm)
        inside = (z > 0) & (np.abs(x) <= reach) & (np.abs(y) <= reach)
        self._points, self._sizes = points[inside], sizes[inside]
        self._hidden = np.zeros(len(self._points), bool)

    def behind(self, box: OrientedBox) -> NDArray[np.bool_]:
        """Return the points that are hidden if there is this further box, bool [P]."""
        return self._hidden | box.between(self._eye, self._points)

    def share(self, hidden: NDArray[np.bool_]) -> float:
        """Return the share of the box's visible part that is hidden, 0 to 1."""
        total = self._sizes.sum()
        return float(self._sizes[hidden].sum() / total) if total else 0.0

    def hide(self, hidden: NDArray[np.bool_]) -> None:
        """Keep points hidden."""
        self._hidden = hidden


def _points_toward(box: OrientedBox, eye: Array) -> tuple[Array, Array]:
    """Return points [P, 3] on the faces toward the eye, and their solid angles [P] up to scale."""
    steps = (np.arange(_STEPS) + 0.5) / _STEPS * 2 - 1
    first, second = (each.ravel() for each in np.meshgrid(steps, steps))
    start = box.axes @ (eye - box.center_mm)
    points, sizes = [], []
    for axis, half in enumerate(box.half_mm):
        if abs(start[axis]) <= half:
            continue
        one, other = (i for i in range(3) if i != axis)
        local = np.empty((len(first), 3))
        local[:, axis] = np.sign(start[axis]) * half
        local[:, one], local[:, other] = first * box.half_mm[one], second * box.half_mm[other]
        away = np.linalg.norm(local - start, axis=1)
        area = box.half_mm[one] * box.half_mm[other]
        points.append(box.center_mm + local @ box.rotation.T)
        sizes.append(area * (abs(start[axis]) - half) / away**3)
    return np.concatenate(points), np.concatenate(sizes)
