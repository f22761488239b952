"""Change of the light on one container, at points of its outer box and at its vertices."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import Mesh
from fastgen.light.sky_visibility import Sky, SkyVisibility, narrowed_cones, visible_share

LIFT_MM = 5.0
"""Distance of the points from the box."""

_STEP_MM = 1000.0
"""Largest distance between points on a face of the outer box."""

_NORMAL_WEIGHT_MM = 150.0
"""Distance that weighs as much as a difference of 1 in the cosine between normal and side. It is
about the depth of rails and recesses."""

_LEAST = 0.02
"""Least light of a vertex, relative to the open."""

FACES = [(axis, sign) for axis in range(3) for sign in (-1, 1)]
"""Axis and direction of the faces of a box, in the order of all arrays here."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurroundingLight:
    """Change of the light on one container.

    Attributes:
        sky: float32 [P, 3], share of the sky's light that is left at each point. With a ground,
            only what is above the horizon counts as sky.
        added: float32 [P, 3], irradiance / pi from other containers and the ground.
        lower: float32 [6, 3], irradiance / pi on the -x, +x, -y, +y, -z and +z side of the
            container from below the horizon, which the ground replaces; 0 without ground.
        open_bits: uint8 [P, DIRECTIONS / 8], directions of the container's frame that no other
            container hides, packed by np.packbits.
        ground: float32 [6, 3], mean radiance of the ground in a level mirror on each of these
            sides; None without ground.
        faces: float32 [6, 3], radiance of these sides of the container's outer box.
    """

    sky: NDArray[np.float32]
    added: NDArray[np.float32]
    lower: NDArray[np.float32]
    open_bits: NDArray[np.uint8]
    ground: NDArray[np.float32] | None
    faces: NDArray[np.float32]

    def applied(
        self,
        visibility: SkyVisibility,
        sky: Sky,
        values: NDArray[np.uint8],
        light: NDArray[np.float32],
        mesh: Mesh,
    ) -> NDArray[np.uint8]:
        """Return vertex bytes in these surroundings.

        Args:
            visibility: Sky that the container leaves visible.
            sky: The environment.
            values: Vertex bytes [V, VERTEX_BYTES] of the container in the open, see
                SkyVisibility.vertex_bytes.
            light: Irradiance / pi [V, 3] of the container in the open, without directional lights.
            mesh: The container's mesh.
        """
        corner, weight = _lattice_places(mesh)
        found = visibility.vertex_bytes(sky, self.vertex_light(values, light, mesh))
        nearest = np.take_along_axis(corner, weight.argmax(axis=0)[None], axis=0)[0]
        found[:, 8:] &= self.open_bits.take(nearest, axis=0)
        # walls keep their cones: they reflect the sky at the open end of an aisle
        up = np.flatnonzero(mesh.normals[:, 2] > 0.5)
        left = self.sky.mean(axis=1).take(nearest[up])
        found[up, :3] = narrowed_cones(found[up, :3], left)
        return found

    def vertex_light(
        self, values: NDArray[np.uint8], light: NDArray[np.float32], mesh: Mesh
    ) -> NDArray[np.float32]:
        """Return irradiance / pi float32 [V, 3] in these surroundings, without directional lights.

        The container hides part of the surroundings from each vertex, so the added light is scaled
        by the share of its hemisphere that a vertex sees. The light from below the horizon is
        interpolated between the sides by the squares of the normal (McTaggart 2004, Half-Life 2 /
        Valve Source Shading, ambient cube). The arguments are three of `applied`.
        """
        visible, sides = visible_share(values), _sides(mesh)
        corner, weight = _lattice_places(mesh)
        found = np.empty((3, len(light)), np.float32)
        # channel by channel, because NumPy is several times slower along the last axis
        for channel, one in enumerate(light.T):
            sky, added = (
                sum(share * table.take(at) for at, share in zip(corner, weight, strict=True))
                for table in (self.sky[:, channel], self.added[:, channel])
            )
            above = np.maximum(one - visible * (self.lower[:, channel] @ sides), 0.0)
            np.maximum(sky * above + visible * added, _LEAST * one, out=found[channel])
        return found.T


def _counts(size_mm: Array) -> list[tuple[int, int]]:
    """Return the points along the two other axes of each face of a box [3]."""
    along = (np.ceil(size_mm / _STEP_MM).astype(int) + 1).tolist()
    others = [[k for k in range(3) if k != axis] for axis, _ in FACES]
    return [(along[a], along[b]) for a, b in others]


def lattice(half_mm: Array) -> tuple[Array, Array]:
    """Return the points [P, 3] on a box around the origin, and the normals [P, 3]."""
    points, normals = [], []
    for (axis, sign), counts in zip(FACES, _counts(2 * half_mm), strict=True):
        a, b = (k for k in range(3) if k != axis)
        u, v = (
            np.linspace(-0.98, 0.98, count) * half_mm[k]
            for count, k in zip(counts, (a, b), strict=True)
        )
        face = np.zeros((counts[0] * counts[1], 3))
        face[:, a], face[:, b] = (each.ravel() for each in np.meshgrid(u, v, indexing="ij"))
        face[:, axis] = sign * (half_mm[axis] + LIFT_MM)
        normal = np.zeros(3)
        normal[axis] = sign
        points.append(face)
        normals.append(np.broadcast_to(normal, face.shape))
    return np.concatenate(points), np.concatenate(normals)


@lru_cache(maxsize=32)
def _lattice_places(mesh: Mesh) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Return the four points [4, V] around each vertex, and their bilinear weights [4, V]."""
    low, high = (np.asarray(bound, np.float64) for bound in mesh.bounds_mm)
    counts = _counts(high - low)
    first = np.cumsum([0, *(a * b for a, b in counts)])
    face = _sides_beside(mesh)
    corner = np.zeros((4, len(face)), np.intp)
    weight = np.zeros((4, len(face)), np.float32)
    share = (mesh.positions_mm - low) / (high - low)
    for number, (a_count, b_count) in enumerate(counts):
        chosen = np.flatnonzero(face == number)
        a, b = (k for k in range(3) if k != number // 2)
        x = share[chosen, a] * (a_count - 1)
        y = share[chosen, b] * (b_count - 1)
        i, j = x.astype(int).clip(0, a_count - 2), y.astype(int).clip(0, b_count - 2)
        dx, dy = (x - i).clip(0, 1), (y - j).clip(0, 1)
        for k, (p, q) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
            corner[k, chosen] = first[number] + (i + p) * b_count + j + q
            weight[k, chosen] = (dx if p else 1 - dx) * (dy if q else 1 - dy)
    return corner, weight


def _sides_beside(mesh: Mesh) -> NDArray[np.intp]:
    """Return the side [V] of the outer box whose light each vertex receives.

    It is the nearest side. Between two near sides, the normal decides. The top of a lower rail
    faces up, but the neighbour of its wall shades it.
    """
    low, high = (np.asarray(bound, np.float64) for bound in mesh.bounds_mm)
    outward = mesh.positions_mm + _NORMAL_WEIGHT_MM * mesh.normals
    costs = [sign * ((high if sign > 0 else low)[axis] - outward[:, axis]) for axis, sign in FACES]
    return np.asarray(np.argmin(costs, axis=0))


@lru_cache(maxsize=32)
def _sides(mesh: Mesh) -> NDArray[np.float32]:
    """Return the share [6, V] of each side of a box in the direction of each normal of a mesh."""
    squares, upper = mesh.normals.T**2, mesh.normals.T > 0
    shares = np.stack([squares * ~upper, squares * upper], axis=1)
    return np.ascontiguousarray(shares.reshape(6, -1), np.float32)


def side_of(normals: NDArray[np.floating]) -> NDArray[np.intp]:
    """Return the side [P] of a box that faces along each normal [P, 3] in its frame."""
    axis = np.abs(normals).argmax(axis=1)
    return np.asarray(2 * axis + (normals[np.arange(len(axis)), axis] > 0))
