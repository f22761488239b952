"""Sky light and indirect light at points of surfaces, found by ray casting.

Diffuse light sums over rays that follow the light of the sky (Pharr, Jakob and Humphreys 2023,
Physically Based Rendering, 4th ed., section 12.5). Specular light samples visible GGX normals
(Dupuy and Benyoub 2023, Sampling Visible GGX Normals with Spherical Caps). Both results have two
parts. The share of the light of an unoccluded sky is a ratio of two sums over the same rays, in
which the noise of an open sky cancels. The indirect light of other surfaces is added to it.

The points of a 2x2 tile use four different sets of directions, and shading averages over all four:
Keller and Heidrich 2001, Interleaved Sampling.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.light.environment import to_map_frame
from fastgen.light.ray_bodies import LIFT_MM, RayBodies
from fastgen.light.reflectance import DIELECTRIC_F0, fresnel_climb
from fastgen.light.sky_rays import SkyRays, spread_points
from fastgen.scene.limits import MIN_ROUGHNESS

Floats = NDArray[np.float32]

TILE = 2
"""Points along a side of a tile that uses all sets of directions."""

RAYS = 64
"""Diffuse rays of a point, a power of two. About half point into the surface and are not cast."""

MIRRORED_RAYS = 16
"""Specular rays of a point."""

DIRECTIONS = RAYS * TILE * TILE
"""Number of directions that a SkyRays must have."""

_BLOCK = 1024
"""Points at a time; their rays fit the cache of a core."""

_ORDER = np.array([0, 2, 3, 1])
"""Bayer order: neighbours in a tile use sets that are far apart in the sequence."""


@dataclass(frozen=True, eq=False)
class Points:
    """K points of surfaces.

    Attributes:
        column: [K], column in the grid of points.
        row: [K], row in the grid of points.
        place_mm: float32 [K, 3], positions.
        normal: float32 [K, 3], unit vector.
        toward_eye: float32 [K, 3], unit vector.
        roughness: float32 [K], perceptual.
    """

    column: NDArray[np.intp]
    row: NDArray[np.intp]
    place_mm: Floats
    normal: Floats
    toward_eye: Floats
    roughness: Floats

    def chosen(self, which: NDArray[np.intp]) -> "Points":
        """Return the points of the given indices."""
        arrays = (self.place_mm, self.normal, self.toward_eye, self.roughness)
        return Points(self.column[which], self.row[which], *(array[which] for array in arrays))

    def turned(self, rotation: NDArray[np.floating], origin_mm: ArrayLike) -> "Points":
        """Return the points in another frame.

        Args:
            rotation: [3, 3], from this frame to the other.
            origin_mm: Origin [3] of this frame in the other.
        """
        place, normal, eye = (
            array @ rotation.T.astype(np.float32)
            for array in (self.place_mm, self.normal, self.toward_eye)
        )
        moved = place + np.asarray(origin_mm, np.float32)
        return Points(self.column, self.row, moved, normal, eye, self.roughness)


def traced_light(points: Points, bodies: RayBodies, sky: SkyRays, yaw_deg: float) -> Floats:
    """Return the light at points of surfaces.

    Args:
        points: K points.
        bodies: Surfaces of the scene.
        sky: Samples of the environment, with DIRECTIONS directions.
        yaw_deg: Rotation of the environment.

    Returns:
        float32 [K, 4, 3]: share of the irradiance of an unoccluded sky; irradiance / pi of indirect
        light; share of the specular light of an unoccluded sky; specular radiance of surfaces.
    """
    found = np.empty((len(points.row), 4, 3), np.float32)
    group = _ORDER[points.row % TILE * TILE + points.column % TILE]
    for number in range(TILE * TILE):
        of_group = np.flatnonzero(group == number)
        for first in range(0, len(of_group), _BLOCK):
            which = of_group[first : first + _BLOCK]
            part = points.chosen(which)
            start = part.place_mm + LIFT_MM * part.normal
            found[which, :2] = _diffuse(part, start, bodies, sky, yaw_deg, number)
            found[which, 2:] = _mirrored(part, start, bodies, sky, yaw_deg, number)
    return found


def _diffuse(
    points: Points, start: Floats, bodies: RayBodies, sky: SkyRays, yaw_deg: float, group: int
) -> Floats:
    """Return sky share and indirect irradiance / pi, [K, 2, 3]."""
    rays = slice(group * RAYS, (group + 1) * RAYS)
    toward = to_map_frame(sky.directions[rays], -yaw_deg).astype(np.float32)
    density = sky.density[rays]
    cosine = np.maximum(points.normal @ toward.T, 0)
    point, ray = np.nonzero(cosine)
    hit, radiance = bodies.hits(start[point], toward[ray])
    point, ray = point[hit], ray[hit]
    hidden = np.zeros_like(cosine)
    hidden[point, ray] = cosine[point, ray]
    light = sky.radiance[rays] / density[:, None]
    whole = cosine @ light
    lost = hidden @ light
    weight = hidden[point, ray] / density[ray]
    indirect = _sums(radiance * weight[:, None], point, len(start))
    indirect /= np.maximum(cosine @ (1 / density), 1e-6)[:, None]
    return np.stack([1 - lost / np.maximum(whole, 1e-20), indirect], axis=1)


def _mirrored(
    points: Points, start: Floats, bodies: RayBodies, sky: SkyRays, yaw_deg: float, group: int
) -> Floats:
    """Return the share of the mirrored sky and the mirrored radiance of surfaces, [K, 2, 3]."""
    toward, weight, density = lobe(points, group)
    # Krivanek and Colbert 2008, Real-time Shading with Filtered Importance Sampling
    wide = np.float32(1 / MIRRORED_RAYS) / density
    seen = sky.mean(to_map_frame(toward.reshape(-1, 3), yaw_deg), wide.ravel())
    seen *= weight.reshape(-1, 1)
    whole = seen.reshape(*weight.shape, 3).sum(axis=1)
    point, ray = np.nonzero(weight)
    hit, radiance = bodies.hits(start[point], toward[point, ray])
    point, ray = point[hit], ray[hit]
    lost = _sums(seen.reshape(*weight.shape, 3)[point, ray], point, len(start))
    mirrored = _sums(radiance * weight[point, ray, None], point, len(start))
    total = np.maximum(weight.sum(axis=1), 1e-6)[:, None]
    return np.stack([1 - lost / np.maximum(whole, 1e-20), mirrored / total], axis=1)


def lobe(points: Points, group: int) -> tuple[Floats, Floats, Floats]:
    """Sample the specular lobe of a dielectric at K points with M = MIRRORED_RAYS rays each.

    Returns:
        Directions [K, M, 3]; weights [K, M], whose mean is the reflectance, 0 for rays into the
        surface; probability density per steradian at each direction, [K, M].
    """
    alpha = np.maximum(points.roughness, MIN_ROUGHNESS)[:, None] ** 2
    frame = _frames(points.normal)
    view = np.einsum("kac,kc->ka", frame, points.toward_eye)[:, None]
    view[..., 2] = np.maximum(view[..., 2], 1e-3)
    half = _visible_normals(view, alpha, _lattice(group))
    facing = (view * half).sum(axis=-1)
    local = 2 * facing[..., None] * half - view
    up = np.maximum(local[..., 2], 1e-4)
    climb = fresnel_climb(np.minimum(facing, 1).astype(np.float64)).astype(np.float32)
    # with uncorrelated masking and shadowing, G2 / G1(view) is G1(light)
    weight = (local[..., 2] > 0) * _smith_g1(up, alpha)
    weight *= DIELECTRIC_F0 + (1 - DIELECTRIC_F0) * climb
    # Walter et al. 2007, eq. 33, with the visible normals of Heitz 2018, eq. 3
    spread = half[..., 2] ** 2 * (alpha**2 - 1) + 1
    seen = _smith_g1(view[..., 2], alpha) / (4 * view[..., 2])
    density = np.asarray(alpha**2 / (np.pi * spread**2) * seen, np.float32)
    return np.einsum("kma,kac->kmc", local, frame), weight, density


def _sums(values: Floats, row: NDArray[np.intp], count: int) -> Floats:
    """Return the sums [count, 3] of values [H, 3] by their row [H]."""
    total = [np.bincount(row, channel, count) for channel in values.T]
    return np.stack(total, axis=1).astype(np.float32)


def _lattice(group: int) -> Floats:
    """Return the points [MIRRORED_RAYS, 2] of the unit square for a group."""
    points = np.stack(spread_points(MIRRORED_RAYS * TILE * TILE), axis=1)
    return points[group * MIRRORED_RAYS :][:MIRRORED_RAYS].astype(np.float32)


def _visible_normals(view: Floats, alpha: Floats, uv: Floats) -> Floats:
    """Sample visible microfacet normals [K, M, 3]; Dupuy and Benyoub 2023, listing 3.

    Args:
        view: Unit vectors [K, 1, 3] toward the eye, in the frame of the surface.
        alpha: [K, 1], squared perceptual roughness.
        uv: [M, 2], points of the unit square.
    """
    stretch = np.concatenate([alpha, alpha, np.ones_like(alpha)], axis=1)[:, None]
    stretched = view * stretch
    stretched /= np.linalg.norm(stretched, axis=-1, keepdims=True)
    phi = 2 * np.pi * uv[:, 0]
    z = 1 - uv[:, 1] * (1 + stretched[..., 2])
    r = np.sqrt(np.clip(1 - z * z, 0, 1))
    cap = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
    half = (cap + stretched) * stretch
    return np.asarray(half / np.linalg.norm(half, axis=-1, keepdims=True), np.float32)


def _smith_g1(cosine: Floats, alpha: Floats) -> Floats:
    """Return the share of microfacets that are visible; Walter et al. 2007, eq. 34."""
    tangent = 1 / (cosine * cosine) - 1
    return np.asarray(2 / (1 + np.sqrt(1 + alpha * alpha * tangent)), np.float32)


def _frames(normal: Floats) -> Floats:
    """Return two tangents and the normal as rows of [K, 3, 3].

    Duff et al. 2017, Building an Orthonormal Basis, Revisited.
    """
    x, y, z = normal.T
    sign = np.copysign(np.float32(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    one = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    other = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([one, other, normal], axis=1)
