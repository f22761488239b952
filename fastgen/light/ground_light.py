"""Diffuse light on the ground around containers, on a grid: occluded sky and light off their paint.

The containers count as their outer boxes, and their faces as Lambert surfaces of one radiance each.
The occlusion of a face is its exact form factor: Baum, Rushmeier and Winget 1989, Improving
Radiosity Solutions Through the Use of Analytically Determined Form-Factors, eq. 8.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.light.environment import Ambient, hidden_sky, sky_irradiance
from fastgen.light.reflectance import POROUS_LOSS
from fastgen.scene import Color, Ground
from fastgen.scene.boxes import OrientedBox
from fastgen.scene.limits import MM

GRID = (64, 32)
"""Columns and rows of the grid; powers of two, see textures.data_texture."""

LOW_GAP_M = 0.35
"""A box closer to the ground than this hides everything below it: too fine for the grid, so the
shader computes it. The grid stores the light at the nearest edge there."""

_REACH = 2.5
"""Width of the grid's margin around the boxes, in heights of the highest box."""

_MARGIN_M = (4.0, 14.0)
"""Least and greatest width of the margin."""

_OUTSIDE_M = 2e-3
"""Distance from a face at which light next to it is computed."""

LINE_MM = 130.0
"""Width of the lines painted on the ground."""

DAMP_SOFTNESS = 0.3
"""Half the range of noise over which wet ground turns from dry to damp."""

DAMP_WETNESS = 0.65
"""Wetness of damp ground as a surface, see shaders/wetness.glsl."""

_SECTORS = 16
"""Azimuths in which the overlap of boxes is computed."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GroundLight:
    """Light on the ground plane around the boxes of a scene.

    Attributes:
        texels: float32 [rows, columns, 4]. Irradiance / pi without directional lights, and the
            unoccluded share of an even sky.
        low_m: World (x, y) of the first texel's centre.
        step_m: Distance between texels along x and y.
        face_radiance: float32 [B, 4, 3], radiance of the -x, +x, -y and +y face of each box.
    """

    texels: NDArray[np.float32]
    low_m: Array
    step_m: Array
    face_radiance: NDArray[np.float32]

    def at(self, place_m: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return the texels [K, 4] at world places [K, 2] in m, interpolated.

        Places outside the grid have those of its border.
        """
        column, row = np.asarray((place_m - self.low_m) / self.step_m, np.float32).T
        found = cv2.remap(
            self.texels, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(found, np.float32).reshape(-1, 4)


def mean_albedo(ground: Ground) -> Color:
    """Return the albedo of a ground with its lines and its damp areas, as seen from afar."""
    share = ground.lines * LINE_MM / ground.line_spacing_mm
    left = 1 - POROUS_LOSS * DAMP_WETNESS * _damp_share(ground.wetness)
    pairs = zip(ground.albedo, ground.line_albedo, strict=True)
    red, green, blue = (left * (own + share * (line - own)) for own, line in pairs)
    return red, green, blue


def damp_threshold(wetness: float) -> float:
    """Return the value of uniform noise at which ground of a wetness is half damp."""
    return 1.35 - 2.1 * wetness


def _damp_share(wetness: float) -> float:
    """Return the mean share of damp ground: that of covered() in noise.glsl over uniform noise.

    Puddles add nothing, because they only cover ground that is damp already.
    """

    def integral(reach: float) -> float:
        """Return the integral of the linear ramp up to a distance beyond the threshold."""
        ramp = min(max(reach + DAMP_SOFTNESS, 0.0), 2 * DAMP_SOFTNESS)
        return ramp**2 / (4 * DAMP_SOFTNESS) + max(reach - DAMP_SOFTNESS, 0.0)

    threshold = damp_threshold(wetness)
    return integral(1 - threshold) - integral(-threshold)


def left_of_sky(whole: ArrayLike, left: ArrayLike, share: ArrayLike) -> NDArray[np.floating]:
    """Return the sky light that remains behind occluders.

    It is `left`, limited to [1 / (1 + share), 1 + share] times the estimate for an even sky,
    `share * whole`. The limits are narrower where less sky is visible, because the radiance of the
    hidden sky is only known roughly. All shapes broadcast.

    Args:
        whole: Light of the whole sky.
        left: The same without the light that is estimated to be hidden.
        share: Share of an even sky's light that would remain.
    """
    even = np.asarray(whole) * share
    most = 1 + np.asarray(share)
    found: NDArray[np.floating] = np.clip(left, even / most, even * most)
    return found


def form_factors(corners: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the vector form factors of polygons seen from the origin.

    The form factor on a surface with unit normal n is the dot product with n, for a polygon that
    lies completely in front of the surface.

    Args:
        corners: [3, K, P], K corners of P polygons relative to the receiving points, in
            clockwise order as seen from there.

    Returns:
        [3, P]; vectors from the receiving points toward the polygons.
    """
    x, y, z = corners
    distance = np.sqrt(x * x + y * y + z * z)
    x, y, z = x / distance, y / distance, z / distance
    order = [*range(1, len(x)), 0]
    u, v, w = x[order], y[order], z[order]
    across = np.stack([y * w - z * v, z * u - x * w, x * v - y * u])
    sine = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    # the angle over its sine tends to 1 as the edge vanishes
    angle = np.arctan2(sine, x * u + y * v + z * w)
    ratio = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    total: NDArray[np.floating] = (across * ratio).sum(axis=1) / (2 * np.pi)
    return total


def ground_light(
    boxes: Sequence[OrientedBox],
    face_radiance: ArrayLike,
    ambient: Ambient,
    yaw_deg: float,
    height_mm: float,
) -> GroundLight:
    """Compute the light on the ground plane.

    Args:
        boxes: Outer boxes of the containers.
        face_radiance: Radiance [B, 4, 3] of the -x, +x, -y and +y face of each box.
        ambient: Light of the environment.
        yaw_deg: Rotation of the environment.
        height_mm: Height of the ground.

    Returns:
        Light around all boxes.
    """
    corners = [box.corners_mm * MM - (0, 0, height_mm * MM) for box in boxes]
    if corners:
        every = np.concatenate(corners)
        margin = np.clip(_REACH * every[:, 2].max(), *_MARGIN_M)
        low, high = every[:, :2].min(axis=0) - margin, every[:, :2].max(axis=0) + margin
    else:
        low, high = np.full(2, -1.0), np.full(2, 1.0)
    step = (high - low) / (np.array(GRID) - 1)
    x, y = (
        start + size * np.arange(count) for start, size, count in zip(low, step, GRID, strict=True)
    )
    points = np.stack(np.meshgrid(x, y)).reshape(2, -1).astype(np.float32)
    placed = [_Placed.of(box, height_mm) for box in boxes]
    for _ in range(2 if len(placed) > 1 else 1):  # the nearest edge may lie in another box
        for box in placed:
            points = box.moved_out(points)
    radiance = np.asarray(face_radiance, np.float32).reshape(-1, 4, 3)
    hidden, bounced = _occlusion(placed, points, radiance)
    share = np.maximum(1.0 - hidden[:, 2].sum(axis=0), 0.0)
    (whole,) = sky_irradiance(ambient, [[0.0, 0.0, 1.0]], yaw_deg)
    sky = np.repeat(whole[:, None], points.shape[1], axis=1)
    for each in hidden:
        some = np.flatnonzero(each[2])
        sky[:, some] -= each[2, some] * hidden_sky(ambient, each[:, some].T, yaw_deg).T
    sky = left_of_sky(whole[:, None], sky, share)
    texels = np.concatenate([sky + bounced, share[None]]).T.reshape(*GRID[::-1], 4)
    return GroundLight(np.ascontiguousarray(texels, np.float32), low, step, radiance)


@dataclass(frozen=True, eq=False)
class _Placed:
    """A box relative to the ground, in metres: centre (x, y), cosine and sine of its turn."""

    center: Array
    turn: tuple[float, float]
    half: Array
    bottom: float
    top: float

    @staticmethod
    def of(box: OrientedBox, height_mm: float) -> "_Placed":
        x, y, z = box.center_mm * MM
        half = box.half_mm * MM
        above = z - height_mm * MM
        turn = (float(box.rotation[0, 0]), float(box.rotation[1, 0]))
        return _Placed(
            np.array([x, y]), turn, half, max(above - half[2], 0.0), max(above + half[2], 1e-3)
        )

    def local(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return world points [2, P] in the axes of the box."""
        c, s = self.turn
        x, y = points - self.center[:, None].astype(np.float32)
        return np.stack([c * x + s * y, c * y - s * x])

    def to_world(self, vectors: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return vectors [3, P] of the axes of the box in the world."""
        c, s = self.turn
        return np.stack(
            [c * vectors[0] - s * vectors[1], s * vectors[0] + c * vectors[1], vectors[2]]
        )

    def moved_out(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return points [2, P] with each below a low box moved to the nearest edge of the box."""
        if self.bottom >= LOW_GAP_M:
            return points
        at = self.local(points)
        edge = self.half[:2, None] + _OUTSIDE_M
        inside = edge - np.abs(at)
        within = (inside > 0).all(axis=0)
        near_x = inside[0] < inside[1]
        out = np.where(at < 0, -edge, edge)
        moved = np.where(np.stack([near_x, ~near_x]) & within, out, at)
        c, s = self.turn
        turned = np.stack([c * moved[0] - s * moved[1], s * moved[0] + c * moved[1]])
        return (turned + self.center[:, None]).astype(np.float32)

    def sides(self, at: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
        """Return the vector form factors [3, P] of the nearer of two opposite sides.

        Args:
            at: Points [2, P] on the ground in the axes of the box.
            axis: 0 for the x sides and 1 for the y sides.

        Returns:
            Vectors in the axes of the box, 0 for points that see neither side.
        """
        other, sign = 1 - axis, np.sign(at[axis])
        beyond = np.abs(at[axis]) - np.float32(self.half[axis])
        face = np.empty((3, 4, at.shape[1]), np.float32)
        face[axis] = -sign * np.maximum(beyond, 1e-4)
        # clockwise as seen from outside
        reach = (sign if axis == 0 else -sign) * np.float32(self.half[other])
        face[other] = np.stack([-reach, -reach, reach, reach]) - at[other]
        face[2] = np.array([self.bottom, self.top, self.top, self.bottom])[:, None]
        return np.asarray(form_factors(face) * (beyond > 0), np.float32)

    def underside(self, at: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the vector form factors [3, P] of the underside, see `sides`."""
        face = np.empty((3, 4, at.shape[1]), np.float32)
        for axis, signs in enumerate(((-1, 1, 1, -1), (-1, -1, 1, 1))):
            face[axis] = (np.array(signs) * self.half[axis])[:, None] - at[axis]
        face[2] = self.bottom
        return np.asarray(form_factors(face), np.float32)


def _occlusion(
    boxes: Sequence[_Placed], points: NDArray[np.float32], radiance: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the vector form factor [B, 3, P] of each box and the light [3, P] off all of them.

    The underside of a box returns next to nothing.
    """
    hidden = np.zeros((len(boxes), 3, points.shape[1]), np.float32)
    bounced = np.zeros((3, points.shape[1]), np.float32)
    shares = _visible_shares(boxes, points)
    for each, box, seen, sides in zip(hidden, boxes, shares, radiance, strict=True):
        at = box.local(points)
        total = np.zeros_like(bounced)
        for axis in (0, 1):
            factor = box.sides(at, axis) * seen
            total += factor
            low, high = sides[2 * axis : 2 * axis + 2]
            bounced += factor[2] * np.where(at[axis] < 0, low[:, None], high[:, None])
        if box.bottom >= LOW_GAP_M:
            total += box.underside(at) * seen
        each[:] = box.to_world(total)
    return hidden, bounced


def _visible_shares(boxes: Sequence[_Placed], points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the factor [B, P] by which overlap with other boxes reduces form factors.

    Within a sector of azimuths a box covers an interval of elevations, with a form factor of sin^2
    of the upper elevation less that of the lower one. The factor is the ratio of the union of all
    boxes to their sum. Every second point along each axis is computed.
    """
    if len(boxes) < 2:
        return np.ones((len(boxes), 1), np.float32)
    points = points.reshape(2, *GRID[::-1])[:, ::2, ::2].reshape(2, 1, -1)
    azimuth = (np.arange(_SECTORS) + 0.5) * (2 * np.pi / _SECTORS)
    count = points.shape[2]
    covers = np.zeros((len(boxes), _SECTORS, count), np.float32)
    lowest = np.full((_SECTORS, count), np.inf, np.float32)
    highest = np.zeros((_SECTORS, count), np.float32)
    for cover, box in zip(covers, boxes, strict=True):
        turned = azimuth - np.arctan2(box.turn[1], box.turn[0])
        ahead = np.stack([np.cos(turned), np.sin(turned)])
        ahead = np.where(np.abs(ahead) < 1e-4, 1e-4, ahead).astype(np.float32)[:, :, None]
        at, half = box.local(points[:, 0])[:, None], box.half[:2, None, None].astype(np.float32)
        middle, width = at / -ahead, half / np.abs(ahead)
        near = np.maximum((middle - width).max(axis=0), _OUTSIDE_M)
        far = (middle + width).min(axis=0)
        hit = near < far
        high = np.where(hit, box.top**2 / (box.top**2 + near * near), 0.0)
        # the farther edge of the underside has the lower elevation
        low = np.where(hit, box.bottom**2 / (box.bottom**2 + far * far), np.inf)
        np.subtract(high, low, out=cover, where=hit)
        np.minimum(lowest, low, out=lowest)
        np.maximum(highest, high, out=highest)
    together = covers.sum(axis=0)
    union = np.minimum(together, np.maximum(highest - lowest, 0.0))
    kept = np.where(together > 0, union / np.maximum(together, 1e-9), 1.0)
    total = covers.sum(axis=1)
    share = np.where(total > 0, (covers * kept).sum(axis=1) / np.maximum(total, 1e-9), 1.0)
    coarse = share.reshape(len(boxes), GRID[1] // 2, GRID[0] // 2)
    return _doubled(_doubled(coarse, 1), 2).reshape(len(boxes), -1).astype(np.float32)


def _doubled(values: NDArray[np.floating], axis: int) -> NDArray[np.floating]:
    """Return values with the mean of neighbours between each two along an axis."""
    last = values.shape[axis] - 1
    following = values.take(np.minimum(np.arange(last + 1) + 1, last), axis=axis)
    shape = [*values.shape]
    shape[axis] *= 2
    return np.stack([values, (values + following) / 2], axis=axis + 1).reshape(shape)
