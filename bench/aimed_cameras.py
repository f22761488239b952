"""Cameras a few metres from a container, aimed at one decal or damage."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.config.cameras import direction_from, face_frame
from fastgen.geometry.shape_library import SHAPES
from fastgen.scene import Camera, Decal, Scene

Limits = tuple[float, float]


class Views(NamedTuple):
    """Ranges of camera positions and rolls relative to a face.

    Attributes:
        azimuth_deg: Angle of the camera from the outward axis of the face, positive to the right.
        elevation_deg: The same angle upward.
        roll_deg: Clockwise rotation of the image.
        distance_mm: Distance from the target.
    """

    azimuth_deg: Limits = (-30, 30)
    elevation_deg: Limits = (-15, 25)
    roll_deg: Limits = (-4, 4)
    distance_mm: Limits = (1800, 6000)


FRONTAL = Views()
"""Views nearly along the outward axis."""


def place_mm(scene: Scene, decal: Decal) -> NDArray[np.float64]:
    """Return the position [3] of a decal's centre in the container frame."""
    mesh = SHAPES.container(scene.container.kind, scene.container.profiles)
    places, _ = mesh.sheet_to_surface(decal.face, decal.center_mm)
    place: NDArray[np.float64] = places[0]
    return place


def aimed(
    scene: Scene,
    face: str,
    target_mm: NDArray[Any],
    size_mm: float,
    rng: np.random.Generator,
    views: Views = FRONTAL,
) -> Camera:
    """Return a camera whose image is `size_mm` wide at the target.

    Exposure and sensor effects are those of one of the scene's cameras.

    Args:
        scene: The scene.
        face: Face that the angles of `views` refer to.
        target_mm: Point [3] in the container frame.
        size_mm: Width of the image at the target.
        rng: Random generator.
        views: Ranges of the camera's place.
    """
    frame = face_frame(face, scene.container.kind)
    angles = float(rng.uniform(*views.azimuth_deg)), float(rng.uniform(*views.elevation_deg))
    distance = float(rng.uniform(*views.distance_mm))
    position = target_mm + direction_from(frame, *angles) * distance
    like = scene.cameras[int(rng.integers(len(scene.cameras)))]
    return replace(
        like,
        position_mm=_point(position),
        target_mm=_point(target_mm),
        focal_mm=like.sensor_width_mm * distance / size_mm,
        roll_deg=float(rng.uniform(*views.roll_deg)),
        lens=None,
    )


def zoomed(camera: Camera, target_mm: NDArray[Any], px_per_mm: float, width_px: int) -> Camera:
    """Return a camera at the same place, turned to a point, with a given scale there."""
    distance = float(np.linalg.norm(np.array(camera.position_mm) - target_mm))
    focal = px_per_mm * distance * camera.sensor_width_mm / width_px
    return replace(camera, target_mm=_point(target_mm), focal_mm=focal, lens=None)


def _point(values: NDArray[Any]) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
