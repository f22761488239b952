"""Upright boxes in the world: whether they overlap, and in which order an eye sees them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.data import Pose, Prop
from fastgen.scene.limits import MAX_PROPS

_TOUCHING_MM = 1e-3
"""Overlap that counts as touching, because poses are rounded."""

_CABLES_MM = 5e4
"""Height of the space above a container that a spreader holds; cables lead up through it."""

Array = NDArray[np.float64]

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def rotation_of(pose: Pose) -> Array:
    """Return the rotation [3, 3] from the frame of a body to the world."""
    angle = np.deg2rad(pose.yaw_deg)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class OrientedBox:
    """A box turned about the vertical.

    Attributes:
        center_mm: Centre [3] in the world.
        half_mm: Half of its size [3] along its own axes.
        rotation: [3, 3], from its own axes to the world.
    """

    center_mm: Array
    half_mm: Array
    rotation: Array

    @cached_property
    def corners_mm(self) -> Array:
        """Its corners [8, 3] in the world."""
        return self.center_mm + (_SIGNS * self.half_mm) @ self.rotation.T

    @cached_property
    def axes(self) -> Array:
        """Its axes [3, 3], one per row, in the world."""
        return self.rotation.T

    def in_frame(self, pose: Pose) -> "OrientedBox":
        """Return the same box with the frame of a body as its world."""
        turn = rotation_of(pose)
        center = turn.T @ (self.center_mm - pose.position_mm)
        return OrientedBox(center, self.half_mm, turn.T @ self.rotation)

    def crossed(self, start_mm: Array, way_mm: Array) -> tuple[Array, Array]:
        """Return where straight lines enter and leave the box, in lengths of the way.

        Args:
            start_mm: Points [..., 3] in the world.
            way_mm: Ways [..., 3] from them; both shapes broadcast.

        Returns:
            Two arrays [...]. A line that misses the box leaves before it enters.
        """
        start = (start_mm - self.center_mm) @ self.rotation
        way = way_mm @ self.rotation
        way = np.where(np.abs(way) < 1e-9, 1e-9, way)
        middle, reach = -start / way, self.half_mm / np.abs(way)
        # NumPy is slow along short axes
        x, y, z = np.moveaxis(middle - reach, -1, 0)
        far_x, far_y, far_z = np.moveaxis(middle + reach, -1, 0)
        enters, leaves = (
            np.maximum(np.maximum(x, y), z),
            np.minimum(np.minimum(far_x, far_y), far_z),
        )
        return enters, leaves

    def between(self, start_mm: Array, end_mm: Array) -> NDArray[np.bool_]:
        """Return whether the box is on the straight way between points [..., 3]."""
        enters, leaves = self.crossed(start_mm, end_mm - start_mm)
        found: NDArray[np.bool_] = (enters < leaves) & (leaves > 0) & (enters < 1 - 1e-6)
        return found


def container_box(kind: str, pose: Pose) -> OrientedBox:
    """Return the outer box of a container of a kind."""
    size = KINDS[kind]
    half = np.array([size.length_mm, size.width_mm, size.height_mm]) / 2
    turn = rotation_of(pose)
    middle = np.array(pose.position_mm) + turn @ np.array([0.0, 0.0, half[2]])
    return OrientedBox(middle, half, turn)


@lru_cache(maxsize=2 * MAX_PROPS)  # each image of a scene needs them several times
def prop_box(prop: Prop) -> OrientedBox:
    """Return the box around a prop."""
    half = np.array(prop.size_mm) / 2
    return OrientedBox(np.array(prop.pose.position_mm), half, rotation_of(prop.pose))


def spreader_box(kind: str) -> OrientedBox:
    """Return the box above the first container in which its spreader and the cables hang."""
    length, width, height = KINDS[kind].size_mm
    half = np.array([length, width, _CABLES_MM]) / 2
    return OrientedBox(np.array([0.0, 0.0, height + half[2]]), half, np.eye(3))


def gaps(one: OrientedBox, other: OrientedBox) -> tuple[Array, Array]:
    """Return the axes [A, 3] that may separate two boxes, and the gap [A] along each.

    Both boxes are upright, so their own axes suffice (separating axis theorem). An axis points from
    the first box to the other. A gap is negative where the boxes overlap along its axis.
    """
    axes = np.concatenate([one.axes, other.axes[:2]])
    apart = axes @ (other.center_mm - one.center_mm)
    reach = sum(np.abs(axes @ box.rotation) @ box.half_mm for box in (one, other))
    return axes * np.where(apart < 0, -1.0, 1.0)[:, None], np.abs(apart) - reach


def overlap(one: OrientedBox, other: OrientedBox) -> bool:
    """Return whether two boxes share more than a face."""
    return bool(gaps(one, other)[1].max() < -_TOUCHING_MM)


def away_mm(box: OrientedBox, point_mm: Array) -> float:
    """Return the signed distance of a point [3] from a box, negative inside."""
    outside = np.abs(box.axes @ (point_mm - box.center_mm)) - box.half_mm
    most = float(outside.max())
    return most if most < 0 else float(np.linalg.norm(np.maximum(outside, 0)))


def back_to_front(boxes: Sequence[OrientedBox], eye_mm: Array) -> list[int]:
    """Return the order in which boxes can be drawn over one another.

    Args:
        boxes: Boxes that do not overlap.
        eye_mm: The eye [3], outside of all boxes.

    Returns:
        Indices of the boxes; a box never hides one that comes later.

    Raises:
        ConfigError: Boxes hide one another in a circle.
    """
    count = len(boxes)
    hides = np.zeros((count, count), bool)
    for i in range(count):
        for j in range(i):
            axes, gap = gaps(boxes[i], boxes[j])
            apart = gap >= -_TOUCHING_MM
            face = axes @ boxes[i].center_mm + np.abs(axes @ boxes[i].rotation) @ boxes[i].half_mm
            beyond = axes @ eye_mm - face
            # an eye beyond the plane of i, or on it, does not see j behind i
            hides[i, j] = not (apart & (beyond >= np.minimum(gap, 0))).any()
            hides[j, i] = not (apart & (beyond <= np.maximum(gap, 0))).any()
    order: list[int] = []
    left = list(range(count))
    while left:
        free = [i for i in left if not any(hides[i, j] for j in left if j != i)]
        if not free:
            raise ConfigError(
                f"scene.neighbours: containers {left} hide one another in a circle from this "
                "camera; move one of them or the camera"
            )
        order += free
        left = [i for i in left if i not in free]
    return order
