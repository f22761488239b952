"""Change of the light on a container by its surroundings: other containers and the ground.

The light of a container in the open is known at its vertices (sky_visibility.py). Boxes around it
and the ground change it smoothly, so the change is computed at few points of its outer box, and
interpolated: the share of the sky's light that is left, and the light that is added. A facet of
corrugation and the wall around it see different parts of the sky, but nearly the same ground.
Containers count as boxes with one radiance per face. Form factors are exact for faces before the
receiving plane; see ground_light.form_factors.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.light.environment import (
    Ambient,
    hidden_sky,
    lower_irradiance,
    sky_irradiance,
    to_map_frame,
)
from fastgen.light.ground_light import form_factors, left_of_sky
from fastgen.light.sky_visibility import Sky, sky_directions
from fastgen.light.surrounding_change import FACES, LIFT_MM, SurroundingLight, lattice, side_of
from fastgen.scene.boxes import OrientedBox

_MOST_HIDDEN = 0.97
_DARK = 1e-9
_GROUND_POINTS = 4
"""Points in front of a wall at which the light on the ground is computed."""

_RAYS_PER_POINT = 4
"""Rays that find how much of the ground around such a point the wall sees."""

Array = NDArray[np.float64]


class Paving(NamedTuple):
    """The ground as a reflector: height of the plane in mm, and its linear albedo."""

    height_mm: float
    albedo: tuple[float, float, float]


def surrounding_light(
    boxes: Sequence[OrientedBox],
    albedos: Sequence[tuple[float, float, float]],
    bounds: Sequence[tuple[NDArray[np.floating], NDArray[np.floating]]],
    light: Ambient,
    yaw_deg: float,
    paving: Paving | None,
) -> list[SurroundingLight]:
    """Return the change of the light on each container of a scene.

    Args:
        boxes: Outer boxes of the containers in the world.
        albedos: Mean linear albedo of each.
        bounds: Lowest and highest coordinates [3] of each container's mesh in its own frame.
        light: The environment.
        yaw_deg: Its rotation.
        paving: The ground, None without one.
    """
    faces = [_Faces.of(box) for box in boxes]
    radiance = _face_radiance(faces, boxes, np.reshape(albedos, (-1, 3)), light, yaw_deg)
    found, sky = [], Sky(light, yaw_deg)
    for i, box in enumerate(boxes):
        low, high = (np.asarray(bound, np.float64) for bound in bounds[i])
        local, normals = lattice((high - low) / 2)
        middle = (low + high) / 2 - (0, 0, box.half_mm[2])
        points = box.center_mm + (local + middle) @ box.rotation.T
        toward = normals @ box.rotation.T
        others = [j for j in range(len(boxes)) if j != i]
        directions = sky_directions() @ box.rotation.T
        hit = _hits(points, directions, [boxes[j] for j in others])
        overlap = _overlap_factor(hit, toward, directions)
        covered = _covered(points, toward, [faces[j] for j in others], overlap)
        hidden = covered.sum(axis=(0, 1))
        bounced = sum(
            (part.T @ radiance[j] for part, j in zip(covered, others, strict=True)),
            np.zeros((len(points), 3)),
        )
        whole = sky_irradiance(light, toward, yaw_deg)
        seen = None
        below = np.zeros((6, 3))
        if paving is None:
            left, added = np.repeat(1 - hidden[:, None], 3, axis=1), bounced
        else:
            share, ground, mirrored = _from_ground(points, toward, i, boxes, faces, sky, paving)
            lower = (1 - toward[:, 2]) / 2
            # boxes cover what is below the horizon and not ground
            taken = np.maximum(hidden - (lower - share), 0.0)
            open_ = np.clip(1 - taken / np.maximum(1 - lower, 1e-6), 0.0, 1.0)
            below = _lower_by_face(light, box, yaw_deg)
            upper = np.maximum(whole - below[side_of(normals)], _DARK)
            behind = _sky_behind(points, covered, [faces[j] for j in others], sky)
            above = left_of_sky(upper, upper - taken[:, None] * behind, open_[:, None])
            left, added = above / upper, ground + bounced
            seen = _mean_by_side(mirrored, normals)
        bits = np.packbits(~hit.any(axis=0), axis=1)  # directions that no other box hides
        own = _narrow(radiance[i])
        found.append(
            SurroundingLight(_narrow(left), _narrow(added), _narrow(below), bits, seen, own)
        )
    return found


class _Faces(NamedTuple):
    """The faces of a box: corners [6, 4, 3] clockwise from outside, normals and middles [6, 3]."""

    corners: Array
    normals: Array
    middles: Array

    @staticmethod
    def of(box: OrientedBox) -> "_Faces":
        corners, normals = [], []
        for axis, sign in FACES:
            a, b = (axis + 1) % 3, (axis + 2) % 3
            if sign > 0:
                a, b = b, a
            face = np.zeros((4, 3))
            face[:, axis] = sign
            face[:, a], face[:, b] = (-1, 1, 1, -1), (-1, -1, 1, 1)
            corners.append(box.center_mm + (face * box.half_mm) @ box.rotation.T)
            normals.append(sign * box.axes[axis])
        every = np.array(corners)
        return _Faces(every, np.array(normals), every.mean(axis=1))


def _overlap_factor(hit: NDArray[np.bool_], toward: Array, directions: Array) -> Array:
    """Return the form factor of several boxes over the sum of their form factors [P].

    It is below 1 where boxes stand behind one another.

    Args:
        hit: Whether rays from points in directions meet each box [B, P, D].
        toward: Normals at the points [P, 3].
        directions: The directions [D, 3], spread evenly over the sphere.
    """
    facing = np.maximum(toward @ directions.T, 0.0)
    together = (facing * hit.any(axis=0)).sum(axis=1)
    summed = (facing * hit.sum(axis=0)).sum(axis=1)
    found: Array = np.where(summed > 0, together / np.maximum(summed, 1e-9), 1.0)
    return found


def _overlap(points: Array, normals: Array, boxes: Sequence[OrientedBox]) -> Array | float:
    """Return `_overlap_factor` of boxes at points [P, 3]; no rays are needed for a single box."""
    if len(boxes) < 2:
        return 1.0
    return _overlap_factor(_hits(points, sky_directions(), boxes), normals, sky_directions())


def _covered(
    points: Array, toward: Array, faces: Sequence[_Faces], overlap: Array | float = 1.0
) -> Array:
    """Return the form factors [B, 6, P] of the faces of boxes at points with normals [P, 3].

    Args:
        points: World positions in mm.
        toward: Unit normals there.
        faces: Faces of the boxes.
        overlap: Factor [P] for boxes behind one another, see `_overlap_factor`.
    """
    found = np.zeros((len(faces), 6, len(points)))
    if not faces:
        return found
    corners, normals, middles = (np.concatenate(parts) for parts in zip(*faces, strict=True))
    height = points @ normals.T - (middles * normals).sum(axis=1)
    at, face = np.nonzero(height > 0)  # before a face
    # all boxes at once, because NumPy is slow for few points
    vectors = form_factors((corners[face] - points[at, None]).transpose(2, 1, 0))
    found.reshape(-1, len(points))[face, at] = np.maximum((vectors * toward[at].T).sum(axis=0), 0.0)
    found *= overlap
    found *= np.minimum(1.0, _MOST_HIDDEN / np.maximum(found.sum(axis=(0, 1)), 1e-9))
    return found


def _sky_behind(points: Array, covered: Array, faces: Sequence[_Faces], sky: Sky) -> Array:
    """Return the mean radiance [P, 3] of the sky that boxes hide, by form factors [B, 6, P]."""
    box, side, at = np.nonzero(covered)
    if not len(at):
        return np.zeros((len(points), 3))
    middles = np.array([each.middles for each in faces])
    behind = hidden_sky(sky.light, middles[box, side] - points[at], sky.yaw_deg)
    factor = covered[box, side, at]
    whole: Array = np.maximum(covered.sum(axis=(0, 1)), 1e-9)[:, None]
    return _sums(factor[:, None] * behind, at, len(points)) / whole


def _face_radiance(
    faces: Sequence[_Faces],
    boxes: Sequence[OrientedBox],
    albedos: Array,
    light: Ambient,
    yaw_deg: float,
) -> Array:
    """Return the radiance [B, 6, 3] of each face of boxes with albedos [B, 3].

    It is the mean of two points of a face, and includes one bounce from the other boxes.
    """
    count = len(boxes)
    received, between = np.zeros((count, 6, 3)), np.zeros((count, 6, count, 6))
    for number, own in enumerate(faces):
        pairs = (own.corners[:, ::2] + own.middles[:, None]) / 2 + LIFT_MM * own.normals[:, None]
        points, normals = pairs.reshape(-1, 3), own.normals.repeat(2, axis=0)
        others = [j for j in range(count) if j != number]
        overlap = _overlap(points, normals, [boxes[j] for j in others])
        covered = _covered(points, normals, [faces[j] for j in others], overlap)
        lit = sky_irradiance(light, normals, yaw_deg) * (1 - covered.sum(axis=(0, 1))[:, None])
        lit += directional_light(points, normals, boxes, light, yaw_deg)
        received[number] = lit.reshape(6, 2, 3).mean(axis=1)
        between[number][:, others] = covered.reshape(-1, 6, 6, 2).mean(axis=3).transpose(2, 0, 1)
    paint = albedos[:, None]
    bounced = np.tensordot(between, received * paint, axes=2)
    found: Array = (received + bounced) * paint
    return found


def directional_light(
    points: Array, normals: Array, boxes: Sequence[OrientedBox], light: Ambient, yaw_deg: float
) -> Array:
    """Return irradiance / pi [P, 3] from the directional lights that no box hides.

    Args:
        points: World positions [P, 3] in mm.
        normals: Unit normals [P, 3] of the surfaces there.
        boxes: Boxes that may hide the lights.
        light: The environment.
        yaw_deg: Its rotation.
    """
    if not light.lights:
        return np.zeros((len(points), 3))
    toward = np.array([to_map_frame(each.direction, -yaw_deg) for each in light.lights])
    lit = np.maximum(normals @ toward.T, 0.0)
    lit *= ~_hits(points, toward, boxes).any(axis=0)
    found: Array = lit @ np.array([each.light for each in light.lights])
    return found


def _lower_by_face(light: Ambient, box: OrientedBox, yaw_deg: float) -> Array:
    """Return the irradiance / pi [6, 3] from below the horizon on each side of a box."""
    normals = np.array([sign * box.axes[axis] for axis, sign in FACES])
    return np.asarray(lower_irradiance(light, normals, yaw_deg), np.float64)


def _from_ground(
    points: Array,
    toward: Array,
    number: int,
    boxes: Sequence[OrientedBox],
    faces: Sequence[_Faces],
    sky: Sky,
    paving: Paving,
) -> tuple[Array, Array, Array]:
    """Return the share [P] of the hemispheres in which box `number` sees ground, and its light.

    The light is irradiance / pi [P, 3]. A wall at height h sees the share 1 - h / sqrt(h^2 + d^2)
    of all level ground within the distance d. Rays straight ahead to the quantiles of this share
    have equal weights. The third value [P, 4] is the sum of radiances, and of their weights, in the
    lobe of a level mirror: GGX lobes of roughness 0.5 to 0.7 weigh the quantiles about as their
    values.
    """
    light, yaw_deg = sky.light, sky.yaw_deg
    up = np.array([0.0, 0.0, 1.0])
    lower = (1 - toward[:, 2]) / 2
    height = np.maximum(points[:, 2] - paving.height_mm, 1.0)
    count = _GROUND_POINTS * _RAYS_PER_POINT
    quantile = (np.arange(count).reshape(_GROUND_POINTS, -1, 1) + 0.5) / count
    away = height * np.sqrt((1 - quantile) ** -2 - 1)
    level = toward * (1, 1, 0)
    ends = points + away[..., None] * level
    ends[..., 2] = paving.height_mm + LIFT_MM
    seen = np.broadcast_to(lower > 0, away.shape)
    for other, box in enumerate(boxes):
        if other != number:
            seen = seen & ~box.between(points, ends)
    parts = seen.mean(axis=1)
    group, some = np.nonzero(parts)
    middle = (away * seen).sum(axis=1)[group, some] / seen.sum(axis=1)[group, some]
    at = points[some] + middle[:, None] * level[some]
    at[:, 2] = paving.height_mm + LIFT_MM
    normals = np.broadcast_to(up, at.shape)
    covered = _covered(at, normals, faces, _overlap(at, normals, boxes))
    hidden = covered.sum(axis=(0, 1))[:, None]
    whole = sky_irradiance(light, up[None], yaw_deg)
    left = whole - hidden * _sky_behind(at, covered, faces, sky)
    lit = left_of_sky(whole, left, 1 - hidden) + directional_light(
        at, normals, boxes, light, yaw_deg
    )
    weight = parts[group, some] * lower[some] / _GROUND_POINTS
    share = _sums(weight[:, None], some, len(points))[:, 0]
    found = _sums(weight[:, None] * lit, some, len(points))
    near = quantile.mean(axis=(1, 2))[group] * weight
    mirrored = _sums(near[:, None] * np.insert(lit, 3, 1.0, axis=1), some, len(points))
    mirrored[:, :3] *= paving.albedo
    return share, found * np.array(paving.albedo), mirrored


def _narrow(values: Array) -> NDArray[np.float32]:
    return np.asarray(values, np.float32)


def _sums(values: Array, at: NDArray[np.intp], count: int) -> Array:
    """Return the sums [count, C] of the values [K, C] of each of `count` places, given by `at`."""
    return np.stack([np.bincount(at, channel, count) for channel in values.T], axis=1)


def _mean_by_side(weighted: Array, normals: Array) -> NDArray[np.float32]:
    """Return the mean radiance [6, 3] on each side of sums and weights [P, 4]."""
    sides = (side_of(normals) == np.arange(len(FACES))[:, None]).astype(float)
    found = sides @ weighted
    return np.asarray(found[:, :3] / np.maximum(found[:, 3:], 1e-6), np.float32)


def _hits(points: Array, toward: Array, boxes: Sequence[OrientedBox]) -> NDArray[np.bool_]:
    """Return whether rays from P points in D directions meet each of several boxes [B, P, D]."""
    if not boxes:
        return np.zeros((0, len(points), len(toward)), bool)
    # all boxes at once, because NumPy is slow for few points
    turns = np.array([box.rotation for box in boxes])
    starts = ((points - np.array([[box.center_mm] for box in boxes])) @ turns).astype(np.float32)
    ways = toward @ turns
    inverses = (1 / np.where(np.abs(ways) < 1e-9, 1e-9, ways)).astype(np.float32)
    halves = np.array([box.half_mm for box in boxes], np.float32)
    shape = len(boxes), len(points), len(toward)
    enters, leaves = np.zeros(shape, np.float32), np.full(shape, np.inf, np.float32)
    for axis in range(3):
        inverse = inverses[:, None, :, axis]
        middle = -starts[:, :, None, axis] * inverse
        reach = halves[:, None, None, axis] * np.abs(inverse)
        np.maximum(enters, middle - reach, out=enters)
        np.minimum(leaves, middle + reach, out=leaves)
    return np.asarray(enters < leaves)
