"""Cameras of a rig: their ranges (SeaFront paper, 3.3.1), and where within them one stands."""

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.config.sensor import LensConfig
from fastgen.errors import ConfigError
from fastgen.scene.container_kinds import KINDS, mm_away
from fastgen.scene.faces import FACES
from fastgen.scene.limits import MM, NEAR_M
from fastgen.validation import Range, bounds, check_known

_STEPS, _ROUNDS, _THIRDS = 33, 3, 40
"""Angles tried along each range, how often those around the nearest are tried more finely, and how
often a third of the distances is left out."""

_ROUNDED_MM = 0.1
"""Places of cameras are rounded to this."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CameraConfig:
    """One camera of the rig: it looks at the middle of a face from a varied position.

    face: front, back, door, no_door, roof or underside. Over the roof hangs the spreader, up to 2 m
        high: a camera nearer than that may stand among its beams, which then are cut open.
    focal_mm: for a sensor of sensor_width_mm; of a fisheye, what an angle of one radian spans.
    distance_mm: from the point that it looks at.
    azimuth_deg: turns the camera about the vertical through that point; 0 looks straight at the
        face, and where it is positive the camera stands to the right, seen from itself. Of roof
        and underside: how far it stands aside along the length.
    elevation_deg: lifts the camera, which goes on looking there; of roof and underside: how far it
        stands aside across the length, and where it is negative over the roof the ropes run up the
        image.
    roll_deg: turns the image from where a wall stands upright, or the length of roof or underside
        lies across.
    target_shift_mm: how far beside the middle it looks, along each axis of the face.
    sensor_width_mm: width of the image on the sensor.
    exposure_ev: from the exposure that suits the light.
    lens: its distortion, null for a pinhole.
    """

    face: str
    focal_mm: float = field(metadata=bounds(1.0, 2000.0, "mm"))
    distance_mm: Range = field(metadata=bounds(300.0, 1.5e5, "mm"))  # camera.FAR_M ends sight
    azimuth_deg: Range = field(default=Range(-12, 12), metadata=bounds(-89.0, 89.0, "degrees"))
    elevation_deg: Range = field(default=Range(-8, 18), metadata=bounds(-89.0, 89.0, "degrees"))
    roll_deg: Range = field(default=Range(-1.5, 1.5), metadata=bounds(-180.0, 180.0, "degrees"))
    target_shift_mm: Range = field(default=Range(-350, 350), metadata=bounds(-1e4, 1e4, "mm"))
    sensor_width_mm: float = field(default=36.0, metadata=bounds(0.1, 1000.0, "mm"))
    exposure_ev: Range = field(default=Range(-0.5, 0.4), metadata=bounds(-10.0, 10.0, "stops"))
    lens: LensConfig | None = None

    def __post_init__(self) -> None:
        """Hold the face to those that exist."""
        check_known("face", self.face, FACES)


def seafront_rig() -> dict[str, CameraConfig]:
    """The paper's four cameras (3.2 and Fig. 4); a 40' fills about 3/4 of A and B."""
    return {
        "A": CameraConfig("front", 14.5, Range(5600, 7400)),
        "B": CameraConfig("back", 28.0, Range(10500, 13500)),
        "Cl": CameraConfig("no_door", 45.0, Range(4600, 7200)),
        "Cr": CameraConfig("door", 45.0, Range(4600, 7200)),
    }


class FaceFrame(NamedTuple):
    """Unit vectors [3] out of a face, to its right and up, seen from outside, and its middle [3]
    in millimetres of the container's frame. The right of roof and underside is the door end."""

    outward: Array
    right: Array
    up: Array
    middle_mm: Array


@functools.cache
def face_frame(face: str, kind: str) -> FaceFrame:
    """The frame of a face of a container of a kind."""
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
    return FaceFrame(axis, right, np.cross(axis, right), np.array(middle_mm))


def direction_from(frame: FaceFrame, azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> Array:
    """Unit vectors [..., 3] from what a camera looks at to the camera, of angles [...]."""
    azimuth, elevation = np.deg2rad(azimuth_deg)[..., None], np.deg2rad(elevation_deg)[..., None]
    level = np.cos(azimuth) * frame.outward + np.sin(azimuth) * frame.right
    return np.cos(elevation) * level + np.sin(elevation) * frame.up


def check_room(name: str, rig: CameraConfig, kinds: Iterable[str], bulge_mm: float) -> None:
    """Raise ConfigError if the camera may come too near to a container of one of `kinds`, whose
    sheets may stand out by `bulge_mm`."""
    least_mm = NEAR_M / MM + bulge_mm
    widest = np.deg2rad([np.abs(rig.azimuth_deg).max(), np.abs(rig.elevation_deg).max()])
    if rig.distance_mm.lo * np.cos(widest).prod() >= least_mm:  # stays before the face's plane
        return
    for kind in kinds:
        nearest_mm = _nearest_mm(rig, kind)
        if nearest_mm < least_mm + _ROUNDED_MM:
            bulges, less = "", "a smaller target_shift_mm"
            if bulge_mm:
                bulges = f" that may bulge by {bulge_mm:g} mm (damage.concave.depth_mm)"
                less = f"{less} or depth_mm, or damage.concave.outward: 0"
            raise ConfigError(
                f"cameras.{name}: may come within {nearest_mm:.0f} mm of a container of kind "
                f"{kind}{bulges}, and nothing nearer than {NEAR_M / MM:g} mm is drawn; give a "
                f"larger distance_mm, azimuth_deg and elevation_deg nearer to 0, or {less}"
            )


def _nearest_mm(rig: CameraConfig, kind: str) -> float:
    """How near the camera may come to a sound container, in millimetres."""
    frame = face_frame(rig.face, kind)

    def away_mm(direction: Array, distance_mm: Array) -> Array:
        offset = distance_mm[..., None] * direction
        # of what it may look at, the point that brings the camera nearest to the face's middle
        for axis in (frame.right, frame.up):
            shift = np.clip(-(offset @ axis), *rig.target_shift_mm)
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
    """Least values [...] of a convex function of numbers within a range, each by itself; a camera's
    distance from a box is convex in how far it stands from what it looks at."""
    lo, hi = np.full(shape, within.lo), np.full(shape, within.hi)
    for _ in range(_THIRDS):
        third = (hi - lo) / 3
        left = of(lo + third) <= of(hi - third)
        lo, hi = np.where(left, lo, lo + third), np.where(left, hi - third, hi)
    return np.minimum(of(lo), of(hi))
