"""Camera pose and projection for one image size.

Pixel coordinates: x right, y down, (0, 0) at the top left corner of the image. The centre of pixel
(column i, row j) is (i + 0.5, j + 0.5). View space: x right, y down, z forward along the optical
axis, metres (the OpenCV convention). Hartley and Zisserman 2004, section 6.1. Lens distortion
applies between the division by depth and the camera matrix, see lens.py.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.camera.lens import PINHOLE, Distortion
from fastgen.errors import ConfigError
from fastgen.scene import Camera, Pose
from fastgen.scene.boxes import rotation_of
from fastgen.scene.limits import FAR_M, MM, NEAR_M
from fastgen.scene.optics import Lens


@dataclass(frozen=True, eq=False)
class View:
    """Projection of a camera for one image size.

    Attributes:
        rotation: float64 [3, 3], world to view.
        position_m: float64 [3], world metres.
        focal_px: Focal length along x in pixels.
        size: (width, height) in pixels.
        distortion: Lens distortion, None for a pinhole.
        pixel_aspect: Focal length along y relative to that along x.
        shift_px: Distance of the principal point from the centre of the image, in pixels.
    """

    rotation: NDArray[np.float64]
    position_m: NDArray[np.float64]
    focal_px: float
    size: tuple[int, int]
    distortion: Distortion | None = None
    pixel_aspect: float = 1.0
    shift_px: tuple[float, float] = (0.0, 0.0)

    @property
    def center_px(self) -> tuple[float, float]:
        """Principal point (x, y) in pixels."""
        return self.size[0] / 2 + self.shift_px[0], self.size[1] / 2 + self.shift_px[1]

    @property
    def focals_px(self) -> NDArray[np.float64]:
        """Focal lengths along x and y in pixels, float64 [2]."""
        return np.array([self.focal_px, self.pixel_aspect * self.focal_px])

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """Camera matrix float64 [3, 3], view space to pixels; Hartley and Zisserman, 6.1."""
        x, y = self.center_px
        across, down = self.focals_px
        return np.array([[across, 0, x], [0, down, y], [0, 0, 1]])

    @property
    def translation_mm(self) -> NDArray[np.float64]:
        """World origin in view space, float64 [3]; with `rotation` the pose of the container."""
        return -self.rotation @ self.position_m / MM

    def in_frame(self, pose: Pose) -> "View":
        """Return the same view with the frame of a body as its world."""
        turn = rotation_of(pose)
        origin_m = np.array(pose.position_mm) * MM
        return replace(
            self, rotation=self.rotation @ turn, position_m=turn.T @ (self.position_m - origin_m)
        )

    def to_view(self, points_mm: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return world points [..., 3] in mm as view space points [..., 3] in metres."""
        points = np.asarray(points_mm, np.float64)
        # one product, because NumPy multiplies a stack of small matrices one by one
        turned = points.reshape(-1, 3) @ (MM * self.rotation.T)
        for axis, offset in enumerate(self.rotation @ self.position_m):
            turned[:, axis] -= offset  # NumPy is slow along short axes
        return turned.reshape(points.shape)

    def project(
        self, points_mm: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Project world points.

        Args:
            points_mm: [..., 3], world mm.

        Returns:
            Pixels float64 [..., 2], meaningless for points at or behind the camera, and depth
            float64 [...] along the optical axis in metres.
        """
        view = self.to_view(points_mm)
        depth = view[..., 2].copy()
        inverse = 1 / np.where(depth > 1e-9, depth, np.nan)
        plane = np.empty((*depth.shape, 2))
        for axis in (0, 1):
            np.multiply(view[..., axis], inverse, out=plane[..., axis])
        if self.distortion:
            plane = self.distortion.apply(plane)
        for axis, (focal, center) in enumerate(zip(self.focals_px, self.center_px, strict=True)):
            plane[..., axis] *= focal
            plane[..., axis] += center
        return plane, depth

    def rays(
        self, pixels: NDArray[np.floating] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the viewing rays of pixels.

        Args:
            pixels: [..., 2], by default all pixel centres [H, W, 2].

        Returns:
            Origin float64 [3] in world mm and unit directions float64 [..., 3] in world space.
        """
        width, height = self.size
        if pixels is None:
            x, y = np.arange(width) + 0.5, np.arange(height) + 0.5
            pixels = np.stack(np.meshgrid(x, y), axis=-1)
        across = (np.asarray(pixels, np.float64) - self.center_px) / self.focals_px
        if self.distortion:
            across = self.distortion.remove(across)
        rays = np.concatenate([across, np.ones_like(across[..., :1])], axis=-1) @ self.rotation
        return self.position_m / MM, rays / np.linalg.norm(rays, axis=-1, keepdims=True)

    @property
    def half_angle_deg(self) -> float:
        """Angle between the optical axis and the ray of the middle of the left border, degrees."""
        edge = 0.5 * self.size[0] / self.focal_px
        if self.distortion:
            edge = self.distortion.half_width
        return float(np.degrees(np.arctan(edge)))

    def lens_values(self, to_samples: NDArray[np.floating]) -> dict[str, ArrayLike]:
        """Return the uniforms of shaders/lens.glsl.

        Args:
            to_samples: [2, 2], see SampleLattice.to_clip.
        """
        return {
            **(self.distortion.shader_values if self.distortion else PINHOLE),
            "lens_to_clip": (to_samples * 2 * self.focals_px / self.size).T.ravel(),
            "lens_clip_center": to_samples @ (2 * np.array(self.center_px) / self.size - 1),
            "lens_center": self.center_px,
            "lens_focal": self.focals_px,
        }

    def clip_matrix(self) -> NDArray[np.float64]:
        """Return the matrix from world metres to OpenGL clip space, float64 [4, 4].

        It ignores lens distortion. Clip y points down the image: row 0 of the framebuffer is the
        top row of the image, read-back needs no flip, and front faces are clockwise. Depth
        [NEAR_M, FAR_M] maps to [-1, 1]. OpenGL 4.5 core specification, section 13.6.
        """
        world_to_view = np.eye(4)
        world_to_view[:3, :3] = self.rotation
        world_to_view[:3, 3] = -self.rotation @ self.position_m
        projection = np.zeros((4, 4))
        projection[[0, 1], [0, 1]] = 2 * self.focals_px / self.size
        projection[:2, 2] = 2 * np.array(self.center_px) / self.size - 1
        projection[2, 2] = (FAR_M + NEAR_M) / (FAR_M - NEAR_M)
        projection[2, 3] = -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
        projection[3, 2] = 1.0
        return projection @ world_to_view


def view_of(camera: Camera, size: tuple[int, int]) -> View:
    """Return the view of a camera for an image of `size` (width, height) in pixels.

    The up direction of the image is world z, turned clockwise by the roll of the camera.

    Raises:
        ConfigError: The lens cannot be drawn, see lens.Distortion.
    """
    position = np.array(camera.position_mm, np.float64) * MM
    forward = np.array(camera.target_mm, np.float64) * MM - position
    forward /= np.linalg.norm(forward)
    up_hint = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, up_hint)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    roll = np.deg2rad(camera.roll_deg)
    # turning the camera counter-clockwise turns the image clockwise
    rolled_right = np.cos(roll) * right - np.sin(roll) * down
    rolled_down = np.sin(roll) * right + np.cos(roll) * down
    focal_px = camera.focal_mm / camera.sensor_width_mm * size[0]
    aspect, (right_share, down_share) = camera.pixel_aspect, camera.principal_point
    shift_px = right_share * size[0], down_share * size[0]
    distortion = None
    if camera.lens is not None:
        # the farther border on each axis
        half = abs(shift_px[0]) + size[0] / 2, abs(shift_px[1]) + size[1] / 2
        try:
            distortion = _distortion(camera.lens, (half[0] / focal_px, half[1] / aspect / focal_px))
        except ConfigError as error:
            raise ConfigError(f"cameras.{camera.name}.{error}") from None
    rotation = np.stack([rolled_right, rolled_down, forward])
    return View(rotation, position, focal_px, size, distortion, aspect, shift_px)


@lru_cache(maxsize=64)
def _distortion(lens: Lens, half_size: tuple[float, float]) -> Distortion:
    return Distortion(lens, half_size)
