"""Estimates of how much of containers and of their damages cameras see past other containers."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View, view_of
from fastgen.scene import Camera, Damage, Pose
from fastgen.scene.boxes import OrientedBox, container_box, rotation_of
from fastgen.scene.limits import MM

_STEPS = 8
"""Points along each side of a face."""

_LEAST_TURN = float(np.cos(np.deg2rad(75)))
"""Least cosine between a damage's outward axis and the way to a camera that shows it."""

LEAST_SHARE = 1e-3
"""Part of an image that a damage should cover: 410 pixels of 640x640."""

Array = NDArray[np.float64]


class BoxVisibility:
    """Points on the sides of a container's outer box that face a camera, each hidden or visible.

    Other containers may hide points. Only points within the image count. The image is taken as
    square and without distortion.

    Args:
        box: The box.
        camera: The camera, outside the box.
    """

    def __init__(self, box: OrientedBox, camera: Camera) -> None:
        self._eye = np.array(camera.position_mm)
        points, sizes = points_toward(box, self._eye)
        x, y, z = view_of(replace(camera, lens=None), (1, 1)).rotation @ (points - self._eye).T
        reach = z * camera.sensor_width_mm / (2 * camera.focal_mm)
        inside = (z > 0) & (np.abs(x) <= reach) & (np.abs(y) <= reach)
        self._points, self._sizes = points[inside], sizes[inside]
        self._hidden = np.zeros(len(self._points), bool)

    def behind(self, box: OrientedBox) -> NDArray[np.bool_]:
        """Return the points that are hidden if there is this further box, bool [P]."""
        return self._hidden | box.between(self._eye, self._points)

    def share(self, hidden: NDArray[np.bool_]) -> float:
        """Return the share of the points' solid angle that is hidden, 0 to 1."""
        total = self._sizes.sum()
        return float(self._sizes[hidden].sum() / total) if total else 0.0

    def hide(self, hidden: NDArray[np.bool_]) -> None:
        """Keep points hidden."""
        self._hidden = hidden


class DamageVisibility:
    """Estimates of the largest part of an image that each damage covers.

    Images are taken as square and without distortion. A damage counts as its rectangle, and other
    containers hide it if they hide its middle.

    Args:
        cameras: All cameras of the scene.
        bodies: Kind and pose of each container.
    """

    def __init__(self, cameras: Sequence[Camera], bodies: Sequence[tuple[str, Pose]]) -> None:
        self._cameras = cameras
        self._bodies = bodies

    @cached_property
    def _views(self) -> list[View]:
        return [view_of(replace(camera, lens=None), (1, 1)) for camera in self._cameras]

    @cached_property
    def _boxes(self) -> list[OrientedBox]:
        return [container_box(kind, pose) for kind, pose in self._bodies]

    def image_share(self, body: int, damage: Damage) -> float:
        """Return the largest part of an image that a damage covers.

        Only cameras that show it as described at `DamageConfig.toward_cameras` count; 0 if none
        does.

        Args:
            body: Index of its container.
            damage: Damage in the frame of its container.
        """
        pose = self._bodies[body][1]
        turn = rotation_of(pose)
        middle = np.array(pose.position_mm) + turn @ damage.origin_mm
        outward = -turn @ damage.inward
        along, across = (
            0.5 * extent * (turn @ axis)
            for extent, axis in zip(damage.size_mm, (damage.along, damage.across), strict=True)
        )
        points = middle + np.array([0 * along, -along, along, -across, across])
        others = [box for i, box in enumerate(self._boxes) if i != body]
        return max(
            (
                share
                for view in self._views
                if _turned_to(view, middle, outward)
                and (share := _covered(view, points))
                and not any(box.between(view.position_m / MM, middle) for box in others)
            ),
            default=0.0,
        )


def _turned_to(view: View, middle: Array, outward: Array) -> bool:
    """Return whether a surface is turned to a camera and not seen at a grazing angle."""
    way = view.position_m / MM - middle
    return bool(way @ outward >= _LEAST_TURN * np.linalg.norm(way))


def _covered(view: View, points: Array) -> float:
    """Return the part of an image that a rectangle covers; 0 if its middle is outside.

    Args:
        view: View with an image of one pixel.
        points: The middle and the middles of opposite sides, two after two, [5, 3] in mm.
    """
    (middle, *sides), depth = view.project(points)
    if depth.min() <= 0 or middle.min() < 0 or middle.max() > 1:
        return 0.0
    (x1, y1), (x2, y2) = sides[1] - sides[0], sides[3] - sides[2]
    return float(abs(x1 * y2 - x2 * y1))


def points_toward(box: OrientedBox, eye: Array) -> tuple[Array, Array]:
    """Return points [P, 3] on the faces toward the eye, and the solid angle [P] of each, in sr."""
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
        area = box.half_mm[one] * box.half_mm[other] * (2 / _STEPS) ** 2
        points.append(box.center_mm + local @ box.rotation.T)
        sizes.append(area * (abs(start[axis]) - half) / away**3)
    return np.concatenate(points), np.concatenate(sizes)
