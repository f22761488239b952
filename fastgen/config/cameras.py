"""Cameras of a rig: their ranges (SeaFront paper, 3.3.1), and the poses that these allow."""

import functools
import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.config.sensor import LensConfig
from fastgen.errors import ConfigError
from fastgen.scene.container_kinds import KINDS, mm_away
from fastgen.scene.faces import FACES
from fastgen.scene.limits import MM, NEAR_M
from fastgen.scene.optics import ASPECT_LIMITS, PRINCIPAL_LIMITS
from fastgen.validation import Bounds, OneOf, Range

_STEPS, _ROUNDS, _THIRDS = 33, 3, 40
"""Search for the nearest camera position: angles per range, refinements of the angles around the
best ones, and steps of the ternary search over the distance."""

_ROUNDED_MM = 0.1
"""Camera positions are rounded to this."""

LONGEST_FOCAL_MM = 2000.0
"""Upper limit of focal lengths."""

Array = NDArray[np.float64]

_Aim = Annotated[Range, Bounds(-2.0, 2.0)]
_Shift = Annotated[float, Bounds(*PRINCIPAL_LIMITS)]
_Angle = Annotated[Range, Bounds(-89.0, 89.0, "degrees")]


@dataclass(frozen=True)
class CameraConfig:
    """One camera of the rig. It looks at the middle of a face from a varying position.

    Attributes:
        face: Face that the camera looks at. The spreader hangs up to 2 m above the roof; a camera
            nearer than that may be among its beams and see them cut open.
        focal_mm: Focal length for a sensor of sensor_width_mm. In a fisheye, one radian from the
            optical axis is imaged at this distance from the centre.
        distance_mm: Distance from the point that the camera looks at.
        azimuth_deg: Rotation of the camera about the vertical through the point that it looks at.
            At 0 it faces the wall squarely; a positive angle moves it to its right. On roof and
            underside it moves the camera along the length of the container.
        elevation_deg: Elevation of the camera above the point that it looks at. On roof and
            underside it moves the camera across the container; over the roof, a negative angle
            makes the ropes run up the image.
        roll_deg: Rotation of the image. At 0, walls are upright; on roof and underside, the length
            of the container is horizontal.
        target_shift_mm: Shift of the point that the camera looks at from the middle of the face,
            along both axes of the face.
        aim_right: Further shift to the right, as a share of half the width of the face: -1 for its
            left edge, 1 for its right edge.
        aim_up: Further shift upward, as a share of half the height of the face.
        sensor_width_mm: Width of the sensor, which spans the width of the image.
        pixel_aspect: Focal length down the image relative to focal_mm, fy / fx of a calibration.
        principal_point: Distance of the principal point to the right and down from the centre of
            the image, as shares of its width.
        exposure_ev: Deviation from the metered exposure.
        lens: Distortion, null for a pinhole.
    """

    face: Annotated[str, OneOf(FACES)]
    focal_mm: Annotated[float, Bounds(1.0, LONGEST_FOCAL_MM, "mm")]
    distance_mm: Annotated[Range, Bounds(300.0, 1.5e5, "mm")]  # well before the far plane
    azimuth_deg: _Angle = Range(-12, 12)
    elevation_deg: _Angle = Range(-8, 18)
    roll_deg: Annotated[Range, Bounds(-180.0, 180.0, "degrees")] = Range(-1.5, 1.5)
    target_shift_mm: Annotated[Range, Bounds(-1e4, 1e4, "mm")] = Range(-350, 350)
    aim_right: _Aim = Range(0, 0)
    aim_up: _Aim = Range(0, 0)
    sensor_width_mm: Annotated[float, Bounds(0.1, 1000.0, "mm")] = 36.0
    pixel_aspect: Annotated[float, Bounds(*ASPECT_LIMITS)] = 1.0
    principal_point: tuple[_Shift, _Shift] = (0.0, 0.0)
    exposure_ev: Annotated[Range, Bounds(-10.0, 10.0, "stops")] = Range(-0.5, 0.4)
    lens: LensConfig | None = None


def seafront_rig() -> dict[str, CameraConfig]:
    """Return the paper's four cameras (3.2 and Fig. 4); a 40' fills about 3/4 of A and B."""
    return {
        "A": CameraConfig("front", 14.5, Range(5600, 7400)),
        "B": CameraConfig("back", 28.0, Range(10500, 13500)),
        "Cl": CameraConfig("no_door", 45.0, Range(4600, 7200)),
        "Cr": CameraConfig("door", 45.0, Range(4600, 7200)),
    }


class FaceFrame(NamedTuple):
    """Axes and middle of a face in the container frame, seen from outside.

    `outward`, `right` and `up` are unit vectors [3]. On roof and underside, `right` points to the
    door end. `half_mm` is half the width and half the height of the face.
    """

    outward: Array
    right: Array
    up: Array
    middle_mm: Array
    half_mm: tuple[float, float]


@functools.cache
def face_frame(face: str, kind: str) -> FaceFrame:
    """Return the frame of `face` on a container of `kind`."""
    length, width, height = KINDS[kind].size_mm
    outward, middle_mm = {
        "front": ((0, -1, 0), (0, -width / 2, height / 2)),
        "back": ((0, 1, 0), (0, width / 2, height / 2)),
        "door": ((1, 0, 0), (length / 2, 0, height / 2)),
        "no_door": ((-1, 0, 0), (-length / 2, 0, height / 2)),
        "roof": ((0, 0, 1), (0, 0, height)),
        "underside": ((0, 0, -1), (0, 0, 0)),
    }[face]
    axis = np.array(outward, float)
    right = np.cross((0, 0, 1), axis) if axis[2] == 0 else np.array([1.0, 0.0, 0.0])
    up = np.cross(axis, right)
    across, along = (float(abs(side) @ (length, width, height)) / 2 for side in (right, up))
    return FaceFrame(axis, right, up, np.array(middle_mm), (across, along))


def direction_from(frame: FaceFrame, azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> Array:
    """Return unit vectors [..., 3] from the target to the camera, for angles [...] in degrees."""
    azimuth, elevation = np.deg2rad(azimuth_deg)[..., None], np.deg2rad(elevation_deg)[..., None]
    level = np.cos(azimuth) * frame.outward + np.sin(azimuth) * frame.right
    return np.cos(elevation) * level + np.sin(elevation) * frame.up


def check_room(name: str, rig: CameraConfig, kinds: Iterable[str], bulge_mm: float) -> None:
    """Check that no position of a camera is too close to a container.

    Args:
        name: Name of the camera in the rig.
        rig: Ranges of the camera.
        kinds: Container kinds that may occur.
        bulge_mm: Largest outward displacement by damage.

    Raises:
        ConfigError: if the camera may be nearer than the near plane.
    """
    least_mm = NEAR_M / MM + bulge_mm
    widest = np.deg2rad([np.abs(rig.azimuth_deg).max(), np.abs(rig.elevation_deg).max()])
    if rig.distance_mm.lo * np.cos(widest).prod() >= least_mm:  # never beside the face
        return
    for kind in kinds:
        nearest_mm = _nearest_mm(rig, kind)
        if nearest_mm < least_mm + _ROUNDED_MM:
            bulges, less = "", "a smaller target_shift_mm"
            if bulge_mm:
                bulges = (
                    f" that may bulge by {bulge_mm:g} mm (damage.concave.depth_mm, and "
                    "damage.perforation.depth_mm with a twist above 1; for kind door_gear its "
                    "depth_mm, swing_mm and gasket_depth_mm)"
                )
                less = f"{less} or depth_mm, damage.concave.outward: 0 and a twist up to 1"
            raise ConfigError(
                f"cameras.{name}: may come within {nearest_mm:.0f} mm of a container of kind "
                f"{kind}{bulges}, and nothing nearer than {NEAR_M / MM:g} mm is drawn; give a "
                f"larger distance_mm, azimuth_deg and elevation_deg closer to 0, or {less}"
            )


def check_above_ground(
    name: str, rig: CameraConfig, grounded: Collection[str], bulge_mm: float
) -> None:
    """Check that a camera that is raised above the ground cannot come too close to a container.

    Args:
        name: Name of the camera in the rig.
        rig: Ranges of the camera.
        grounded: Names of the arrangements that may occur and have ground below the container.
        bulge_mm: Largest outward displacement by damage.

    Raises:
        ConfigError: if the camera might have no room above the ground.
    """
    if not grounded or rig.face == "roof":
        return
    where = f"above the ground of placement.arrangements {', '.join(sorted(grounded))}"
    if rig.face == "underside":
        raise ConfigError(
            f"cameras.{name}.face: a camera that sees the underside is not {where}; give them "
            "weight 0, or another face"
        )
    widest = np.deg2rad([np.abs(rig.azimuth_deg).max(), np.abs(rig.elevation_deg).max()])
    least_mm = NEAR_M / MM + bulge_mm
    if rig.distance_mm.lo * np.cos(widest).prod() < least_mm:
        raise ConfigError(
            f"cameras.{name}.elevation_deg: the camera may have to be raised to be {where}, and "
            f"would then be within {least_mm:g} mm of the container; give angles closer to 0 or a "
            "larger distance_mm"
        )


def _nearest_mm(rig: CameraConfig, kind: str) -> float:
    """Return the smallest distance of the camera from an undamaged container in millimetres."""
    frame = face_frame(rig.face, kind)

    def away_mm(direction: Array, distance_mm: Array) -> Array:
        offset = distance_mm[..., None] * direction
        # the target shift that brings the camera nearest to the middle of the face
        sides = (frame.right, frame.up), (rig.aim_right, rig.aim_up), frame.half_mm
        for axis, aim, half in zip(*sides, strict=True):
            lo, hi = np.add(rig.target_shift_mm, np.multiply(aim, half))
            shift = np.clip(-(offset @ axis), lo, hi)
            offset = offset + shift[..., None] * axis
        return mm_away(frame.middle_mm + offset, kind)

    ranges = np.array([rig.azimuth_deg, rig.elevation_deg], float)
    lo, hi = ranges.T
    nearest = math.inf
    for _ in range(_ROUNDS):
        tried = np.linspace(lo, hi, _STEPS)
        direction = direction_from(frame, *np.meshgrid(*tried.T, indexing="ij", sparse=True))
        found = _least(functools.partial(away_mm, direction), rig.distance_mm, (_STEPS, _STEPS))
        nearest = min(nearest, float(found.min()))
        at = tried[np.unravel_index(int(found.argmin()), found.shape), range(2)]
        step = (hi - lo) / (_STEPS - 1)
        lo, hi = np.maximum(at - step, ranges[:, 0]), np.minimum(at + step, ranges[:, 1])
    return nearest


def _least(of: Callable[[Array], Array], within: Range, shape: tuple[int, ...]) -> Array:
    """Return minima [...] of convex functions over a range, by ternary search.

    The distance of a camera from a box is convex in its distance from the target.
    """
    lo, hi = np.full(shape, within.lo), np.full(shape, within.hi)
    for _ in range(_THIRDS):
        third = (hi - lo) / 3
        left = of(lo + third) <= of(hi - third)
        lo, hi = np.where(left, lo, lo + third), np.where(left, hi - third, hi)
    return np.minimum(of(lo), of(hi))
