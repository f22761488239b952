"""How open each vertex of a container or spreader lies to the sky, by depth maps from all around,
and how much of the light of a sky that lets in.

A point is hidden from a direction where a face of an occluders.DepthMap stands before it.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen import cache
from fastgen.distinct import distinct_rows
from fastgen.environment import Ambient, sky_irradiance, sky_radiance
from fastgen.kept import Recent
from fastgen.mesh import Mesh
from fastgen.occluders import DepthMap, DrawnBody, Solid, map_matrix, without_cables
from fastgen.prefilter import octahedral_decode
from fastgen.programs import LIGHT_STEPS, link

DIRECTIONS = 96
"""Of the whole sphere, so that about half of them bear on a surface; a multiple of 8."""

VERTEX_BYTES = 8 + DIRECTIONS // 8
"""What the shader reads of a vertex: a cone, the light from it, each filled up to four bytes, and a
bit for each direction."""

_VERSION = 3
"""Part of the disk cache's key: count up whenever the openness changes."""

_MAP_SIZE = (2048, 512)
"""Texels along and across a container: 6 mm for the longest."""

_COARSE_SIZE = (512, 256)
"""For what is not beside the surface that it hides."""

_SPREADER_SIZE = (1024, 512)
"""For the spreader itself: 14 mm, a quarter of its beams' least gaps."""

_INSET = 0.5
"""Share of the way from a vertex to the middle of its facets at which it is probed: what is
interpolated between the vertices is then right on average, where creases would be too dark."""

_INSET_LIMIT_MM = 30.0
_LIFT_MM = 2.0
_BIAS_MM = 1.0
_LOBE = 4
"""Directions about a mirrored ray: as many as a cap of 24 degrees radius holds. With more or fewer
path-traced containers are farther off."""

_CAPACITY = 128
_LIT_CAPACITY = 2  # a scene asks for two, once a camera
_DARK = 1e-20  # instead of no light at all, which has no ratios
_FIELD_BITS = 21  # of a channel, three of which share a number
_WHOLE = 1 << (
    _FIELD_BITS - 1
)  # what all directions add up to, but for rounding; a field holds twice that
_BLOCK = 2048  # vertices at once, as a core's cache holds them

Array = NDArray[np.float64]
Directions = NDArray[np.bool_]
"""Whether each of V points is open to each of sky_directions(): [V, DIRECTIONS]."""


def sky_directions() -> Array:
    """Unit vectors [DIRECTIONS, 3] spread evenly over the sphere: a Fibonacci spiral."""
    i = np.arange(DIRECTIONS)
    z = 1 - (2 * i + 1) / DIRECTIONS
    turn = np.pi * (3 - 5**0.5) * i
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def probe_points(mesh: Mesh, inset_limit_mm: float = _INSET_LIMIT_MM) -> Array:
    """Where each vertex of `mesh` is probed, [V, 3] in mm: just off the surface, beside creases,
    no further than inset_limit_mm from the vertex."""
    positions = mesh.positions_mm.astype(np.float64)
    middle = positions[mesh.triangles].mean(axis=1)
    corners = mesh.triangles.ravel()
    count = np.maximum(np.bincount(corners, minlength=len(positions)), 1)[:, None]
    weights = np.repeat(middle, 3, axis=0)
    total = [np.bincount(corners, weights[:, k], minlength=len(positions)) for k in range(3)]
    inset = _INSET * (np.stack(total, axis=1) / count - positions)
    length = np.linalg.norm(inset, axis=1, keepdims=True)
    inset *= np.minimum(1.0, inset_limit_mm / np.maximum(length, 1e-6))
    return positions + inset + _LIFT_MM * mesh.normals


def open_sky(normals: NDArray[np.floating]) -> NDArray[np.uint8]:
    """What the shader reads of surfaces that see their whole hemisphere, uint8 [V, VERTEX_BYTES]:
    as `encoded` and `Openness.under` have it."""
    found = np.full((len(normals), VERTEX_BYTES), 255, np.uint8)
    found[:, :3] = np.rint(128 + 127 * normals)
    found[:, 4:7] = LIGHT_STEPS
    return found


def lobe_masks(cells: int) -> NDArray[np.uint32]:
    """Bit masks of directions for each cell of an octahedral map, uint32 [2 cells, cells, 4]; the
    bits of three words in the order of `Openness.under`.

    Upper half: the _LOBE directions nearest to a cell's. Lower half: those before a surface that
    faces where the cell points to.
    """
    step = (np.arange(cells) + 0.5) / cells
    toward = octahedral_decode(np.stack(np.meshgrid(step, step), axis=-1))
    cosine = toward @ sky_directions().T
    least = np.sort(cosine, axis=-1)[..., -_LOBE, None]
    bits = np.packbits(np.concatenate([cosine >= least, cosine > 0]), axis=-1)
    words = np.zeros((2 * cells, cells, 4), np.uint32)
    words[..., :3] = bits.view(np.uint32)
    return words


def encoded(normals: NDArray[np.floating], open_to: Directions) -> NDArray[np.uint8]:
    """The cone of open sky over surfaces with unit `normals` [V, 3], uint8 [V, 3]: 128 + 127 v.

    v points to the mean of the cosine-weighted open sky. A cone that holds the share s of the
    hemisphere's cosine-weighted solid angle has a half-angle with the cosine c = sqrt(1 - s); v is
    1 - c / 2 long, so that no direction is too short to be told from eight bits.
    """
    n = np.asarray(normals, np.float32)
    found = np.empty((len(n), 3), np.uint8)
    for first in range(0, len(n), _BLOCK):
        part = slice(first, first + _BLOCK)
        found[part] = _encoded_part(n[part], open_to[part])
    return found


def _encoded_part(n: NDArray[np.float32], open_to: Directions) -> Array:
    directions = sky_directions().astype(np.float32)
    cosine = np.maximum(n @ directions.T, 0.0)
    whole = cosine.sum(axis=1, keepdims=True)
    hidden = np.where(open_to, np.float32(0), cosine)
    share = 1 - hidden.sum(axis=1, keepdims=True) / whole
    # the integral over a whole hemisphere is 2/3 n; what the directions miss of it is made good
    mean = 2 / 3 * n - hidden @ directions / whole
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = np.where(length > 1e-3, mean / np.maximum(length, 1e-3), n)
    rim = np.sqrt(np.clip(1 - share, 0, 1))
    return np.rint(128 + 127 * (1 - rim / 2) * mean)


@dataclass(frozen=True)
class Sky:
    """An environment's light without its sun, turned by yaw_deg."""

    light: Ambient
    yaw_deg: float


class Openness:
    """What a mesh's V vertices see of the sky.

    normals: unit [V, 3]; few of them differ. open_to: Directions packed along them, uint8
    [V, DIRECTIONS / 8]. cone: uint8 [V, 3] as of `encoded`.
    """

    def __init__(
        self,
        normals: NDArray[np.float32],
        open_to: NDArray[np.uint8],
        cone: NDArray[np.uint8],
    ) -> None:
        first, number = distinct_rows(normals)
        self._normals, self._number = normals[first], _narrow(number)
        # a column after the other is what `under` reads
        self._open_to = np.ascontiguousarray(open_to.T)
        packed = cone.astype(np.int32) @ np.array([1, 1 << 8, 1 << 16], np.int32)
        _, first, which = np.unique(packed, return_index=True, return_inverse=True)
        self._cones, self._which = cone[first], _narrow(which)

    def under(self, sky: Sky) -> NDArray[np.uint8]:
        """As the shader reads it under `sky`, uint8 [V, VERTEX_BYTES]: the cone, the light that
        comes in, and open_to.

        Of light there is, as LIGHT_STEPS r, the ratio r of two irradiances in each channel: of
        what reaches a vertex from where the sky is open, to that of a whole sky about the cone's
        direction, which is what the shader looks up. The first is a part of the irradiance about
        the normal: that of the open ones in sums over all directions. Of such sums over eight
        directions at a time there are 256 for each normal: a byte of open_to finds its own.
        """
        toward = sky_directions()
        radiance = np.maximum(sky_radiance(sky.light, toward, sky.yaw_deg), _DARK)
        cosine = np.maximum(self._normals @ toward.T.astype(np.float32), 0)
        weight = cosine[:, None] * radiance.T
        weight *= _WHOLE / weight.sum(axis=2, keepdims=True)
        # the three channels side by side in one number: adding one takes a third of the time
        red, green, blue = np.rint(weight).astype(np.uint64).transpose(1, 0, 2)
        together = (blue << _FIELD_BITS | green) << _FIELD_BITS | red
        sums = _sums_of_eight(together.reshape(len(together), -1, 8))
        total = np.zeros(len(self._number), np.uint64)
        row = 256 * self._number.astype(np.intp)
        for bits, table in zip(self._open_to, sums.transpose(1, 0, 2), strict=True):
            total += np.take(table, row + bits)
        about_normal = _directions(open_sky(self._normals)[:, :3])
        step = LIGHT_STEPS / _WHOLE * self._irradiance(sky, about_normal)
        about_cone = self._irradiance(sky, _directions(self._cones))
        found = np.full((len(total), VERTEX_BYTES), 255, np.uint8)
        found[:, :3] = np.take(self._cones, self._which, axis=0)
        for channel in range(3):
            share = (total & (2 * _WHOLE - 1)).astype(np.float32)
            total >>= _FIELD_BITS
            share *= np.take(step[:, channel], self._number)
            share /= np.take(about_cone[:, channel], self._which)
            found[:, 4 + channel] = np.minimum(share + 0.5, 255)  # rounds
        found[:, 8:] = self._open_to.T
        return found

    @staticmethod
    def _irradiance(sky: Sky, toward: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.maximum(sky_irradiance(sky.light, toward, sky.yaw_deg), _DARK)


def _narrow(index: NDArray[np.intp]) -> NDArray[np.unsignedinteger[Any]]:
    """Indices [V] in as few bytes as hold them."""
    return index.ravel().astype(np.min_scalar_type(int(index.max(initial=0))))


def _directions(cone: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Unit vectors [K, 3] along the cones [K, 3] of `encoded`."""
    toward = cone.astype(np.float32) - 128
    return toward / np.linalg.norm(toward, axis=1, keepdims=True)


def _sums_of_eight(weight: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Sums [..., 256] of those of eight weights [..., 8] whose bits are set in each byte, in the
    order of np.packbits: the first has the highest."""
    sums = np.zeros((*weight.shape[:-1], 1), np.uint64)
    for bit in range(7, -1, -1):
        sums = np.concatenate([sums, sums + weight[..., bit : bit + 1]], axis=-1)
    return sums


class SkyProbe:
    """Finds the openness of meshes on one GL context. Owned by the renderer, which releases it."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        # depth maps are the driver's, and so is what is found with them
        self._driver = f"{ctx.info['GL_RENDERER']} {ctx.info['GL_VERSION']}"
        self._program = link(ctx, "occluder.vert", "occluder.frag", {})
        self._own: Recent[NDArray[np.uint8]] = Recent(_CAPACITY)
        self._found: Recent[Openness] = Recent(_CAPACITY)
        self._lit: Recent[NDArray[np.uint8]] = Recent(_LIT_CAPACITY)

    def openness(self, container: Mesh, spreader: Mesh | None, sky: Sky) -> NDArray[np.uint8]:
        """`Openness.under` a sky of a container's vertices below the spreader that holds it.
        Asked again at once, it gives the same array."""
        key = (container, spreader)
        return self._under(sky, key, lambda: self._of_container(container, spreader))

    def openness_of_spreader(self, spreader: Mesh, container: Mesh, sky: Sky) -> NDArray[np.uint8]:
        """As `openness`, of a spreader's vertices above the container that it holds."""
        key = (spreader, container)
        return self._under(sky, key, lambda: self._of_spreader(spreader, container))

    def _under(
        self, sky: Sky, key: tuple[Mesh, Mesh | None], measure: Callable[[], NDArray[np.uint8]]
    ) -> NDArray[np.uint8]:
        openness = self._found.get(key, lambda: self._stored(key, measure))
        return self._lit.get((openness, sky), lambda: openness.under(sky))

    def _stored(
        self, key: tuple[Mesh, Mesh | None], measure: Callable[[], NDArray[np.uint8]]
    ) -> Openness:
        shapes = [mesh.shape_digest if mesh else "" for mesh in key]
        digest = hashlib.sha256(f"{_VERSION} {self._driver} {shapes}".encode())
        normals = key[0].normals

        def make() -> NDArray[np.uint8]:
            bits = measure()
            directions = np.unpackbits(bits, axis=1, count=DIRECTIONS).astype(bool)
            return np.concatenate([encoded(normals, directions), bits], axis=1)

        shape = (len(normals), 3 + DIRECTIONS // 8)
        stored = _from_disk(digest.hexdigest(), shape, make)
        return Openness(normals, stored[:, 3:], stored[:, :3])

    def _of_spreader(self, spreader: Mesh, container: Mesh) -> NDArray[np.uint8]:
        # its faces are long and run into one another: their ends stand for nothing
        points = probe_points(spreader, np.inf)
        own = self._kept(without_cables(spreader), points, _SPREADER_SIZE)
        below = self._kept(container, points, _COARSE_SIZE)
        return own & below

    def _of_container(self, container: Mesh, spreader: Mesh | None) -> NDArray[np.uint8]:
        points = probe_points(container)
        open_to = self._own.get(container, lambda: self._kept(container, points, _MAP_SIZE))
        if spreader is not None:
            open_to = open_to & self._kept(without_cables(spreader), points, _COARSE_SIZE)
        return open_to

    def _kept(self, body: Solid, points_mm: Array, size: tuple[int, int]) -> NDArray[np.uint8]:
        """As _open_to, packed along the directions; from the disk cache where it is there."""
        about = f"{_VERSION} {DIRECTIONS} {size} {self._driver}".encode()
        digest = hashlib.sha256(about)
        for array in (body.positions_mm, body.triangles, points_mm):
            digest.update(np.ascontiguousarray(array).tobytes())
        return _from_disk(
            digest.hexdigest(),
            (len(points_mm), DIRECTIONS // 8),
            lambda: np.packbits(self._open_to(body, points_mm, size), axis=1),
        )

    def _open_to(self, body: Solid, points_mm: Array, size: tuple[int, int]) -> Directions:
        shape = DrawnBody(self._ctx, self._program, body)
        depths = DepthMap(self._ctx, self._program, size)
        low, high = body.bounds_mm
        # what is probed outside of the box of occluders may be hidden too
        low, high = np.minimum(low, points_mm.min(axis=0)), np.maximum(high, points_mm.max(axis=0))
        found = np.empty((len(points_mm), DIRECTIONS), bool)
        corner = np.array(size) - 1
        for i, toward in enumerate(sky_directions()):
            to_map = map_matrix(toward, low.astype(np.float64), high.astype(np.float64))
            depths.draw([shape], to_map)
            nearest = np.frombuffer(depths.depth.read(alignment=1), np.float32)
            at = points_mm @ to_map[:3, :3].T + to_map[:3, 3]
            texel = np.clip((at[:, :2] + 1) / 2 * size, 0, corner).astype(np.int64)
            bias = _BIAS_MM * np.linalg.norm(to_map[2, :3])
            before = nearest[texel[:, 1] * size[0] + texel[:, 0]] * 2 - 1
            found[:, i] = at[:, 2] - bias <= before
        depths.release()
        shape.release()
        return found

    def release(self) -> None:
        """Free the program."""
        self._program.release()


def _from_disk(
    key: str, shape: tuple[int, int], make: Callable[[], NDArray[np.uint8]]
) -> NDArray[np.uint8]:
    """The disk cache's array of `key`; where there is none of `shape`, what `make` gives."""
    entry = cache.default_folder() / f"openness-{key[:32]}.npz"

    def kept() -> NDArray[np.uint8] | None:
        stored = cache.read(entry).get("values")
        fits = stored is not None and stored.shape == shape and stored.dtype == np.uint8
        return stored.astype(np.uint8) if stored is not None and fits else None

    def made() -> NDArray[np.uint8]:
        values = make()
        cache.write(entry, {"values": values}, compress=True)
        return values

    return cache.once(entry, kept, made)
