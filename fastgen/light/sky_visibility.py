"""Sky visibility of vertices, and the light that they receive from the visible sky.

Each vertex has one bit for each of DIRECTIONS directions and a cone: the bent normal, which is the
mean direction of the visible sky, and the size of the visible part. shaders/sky_visibility_at.glsl
decodes the cone.
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.distinct_rows import distinct_rows
from fastgen.light.environment import Ambient, sky_irradiance, sky_radiance, to_map_frame
from fastgen.light.octahedral import octahedral_decode

DIRECTIONS = 96
"""Number of directions over the whole sphere, a multiple of 8. A surface faces about half."""

VERTEX_BYTES = 8 + DIRECTIONS // 8
"""Bytes of a vertex in the shader: cone and padding (4), light (4), one bit for each direction."""

LIGHT_STEPS = 127.0
"""Code, of 255, that represents the light of an open sky."""

LIGHT_TIMES = 4.0
"""Code of the fourth channel that doubles the other three. It is used if a channel would exceed
255, as below spreaders, where the ground is dark and the sunlit roof reflects light."""

_LOBE = 8
"""Directions around a mirrored ray, those of a cap of 34 degrees. Four or 14 directions predict the
visible share of a lobe less well."""

_AROUND_LIGHT = 4
"""Directions that give the visibility of a directional light, those of a cap of 24 degrees."""

_DARK = 1e-20  # replaces 0, by which ratios are undefined
_FIELD_BITS = 21  # bits of a channel; three channels share a 64-bit integer
_WHOLE = 1 << (_FIELD_BITS - 1)  # sum over all directions, before rounding; half the field
_WORD = np.uint64(32)  # bits
_BLOCK = 2048  # vertices at a time; they fit the cache of a core

Array = NDArray[np.float64]
Index = NDArray[np.unsignedinteger[Any]]
Directions = NDArray[np.bool_]
"""Visibility of each of sky_directions() from each of V points: bool [V, DIRECTIONS]."""


@cache
def sky_directions() -> Array:
    """Return unit vectors [DIRECTIONS, 3] spread evenly over the sphere: a Fibonacci spiral."""
    i = np.arange(DIRECTIONS)
    z = 1 - (2 * i + 1) / DIRECTIONS
    turn = np.pi * (3 - 5**0.5) * i
    flat = np.sqrt(1 - z * z)
    found = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    found.flags.writeable = False
    return found


def open_sky(normals: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return the vertex bytes of surfaces without occluders, uint8 [V, VERTEX_BYTES]."""
    found = np.full((len(normals), VERTEX_BYTES), 255, np.uint8)
    found[:, :3] = np.rint(128 + 127 * normals)
    found[:, 4:7], found[:, 7] = LIGHT_STEPS, 0
    return found


def lobe_masks(cells: int) -> NDArray[np.uint32]:
    """Return bit masks of directions for each cell of an octahedral map.

    Args:
        cells: Cells along a side of the map.

    Returns:
        uint32 [2 cells, cells, 4], with the bits in the order of the vertex bytes in three words.
        The upper half has the _LOBE directions nearest to the direction of a cell, the lower half
        the directions in front of a surface with that normal.
    """
    step = (np.arange(cells) + 0.5) / cells
    toward = octahedral_decode(np.stack(np.meshgrid(step, step), axis=-1))
    cosine = toward @ sky_directions().T
    least = np.sort(cosine, axis=-1)[..., -_LOBE, None]
    bits = np.packbits(np.concatenate([cosine >= least, cosine > 0]), axis=-1)
    words = np.zeros((2 * cells, cells, 4), np.uint32)
    words[..., :3] = bits.view(np.uint32)
    return words


def encoded_cones(normals: NDArray[np.floating], visible: Directions) -> NDArray[np.uint8]:
    """Encode the cone of visible sky as 128 + 127 v.

    v has the direction of the bent normal. Let s be the visible share of the cosine-weighted
    hemisphere. A cone with this share has a half-angle with the cosine c = sqrt(1 - s). The length
    of v is 1 - c / 2, which keeps v long enough for eight bits.

    Args:
        normals: Unit vectors [V, 3].
        visible: bool [V, DIRECTIONS].

    Returns:
        uint8 [V, 3].
    """
    n = np.asarray(normals, np.float32)
    found = np.empty((len(n), 3), np.uint8)
    for first in range(0, len(n), _BLOCK):
        part = slice(first, first + _BLOCK)
        found[part] = _encoded_part(n[part], visible[part])
    return found


def _encoded_part(n: NDArray[np.float32], visible: Directions) -> Array:
    directions = sky_directions().astype(np.float32)
    cosine = np.maximum(n @ directions.T, 0.0)
    whole = cosine.sum(axis=1, keepdims=True)
    hidden = np.where(visible, np.float32(0), cosine)
    share = 1 - hidden.sum(axis=1, keepdims=True) / whole
    # subtracting the hidden part from the exact integral, 2/3 n, reduces sampling errors
    mean = 2 / 3 * n - hidden @ directions / whole
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = np.where(length > 1e-3, mean / np.maximum(length, 1e-3), n)
    rim = np.sqrt(np.clip(1 - share, 0, 1))
    encoded: Array = np.rint(128 + 127 * (1 - rim / 2) * mean)
    return encoded


def visible_share(values: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the visible share [V] of the cosine-weighted hemisphere of vertices.

    Args:
        values: uint8 [V, 3 or more], which begin with the cones of `encoded_cones`.
    """
    return _share(_decoded(values[:, :3])[1])


def narrowed_cones(cones: NDArray[np.uint8], left: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return cones uint8 [V, 3] after other objects have hidden part of their sky.

    Args:
        cones: uint8 [V, 3], see `encoded_cones`.
        left: Share [V] of the cosine-weighted visible sky that is left, 0 to 1.
    """
    toward, length = _decoded(cones)
    rim = np.sqrt(np.clip(1 - left * _share(length), 0, 1))
    scale = 127 * (1 - rim / 2) / length
    return np.asarray(np.rint(128 + toward * scale).T, np.uint8)


@dataclass(frozen=True)
class Sky:
    """Light of an environment, turned by yaw_deg."""

    light: Ambient
    yaw_deg: float


@dataclass(frozen=True, eq=False)
class SkyVisibility:
    """Sky visibility of the V vertices of a mesh.

    Light is computed once for each of K kinds of vertices with equal arguments; a container has
    about 0.6 V kinds.

    Attributes:
        kind: unsigned [V], kind of each vertex.
        rows: uint8 [K, VERTEX_BYTES], vertex bytes of each kind without the light.
        normals: float32 [N, 3], distinct unit normals.
        normal: unsigned [K], index of each kind in `normals`.
        cones: uint8 [C, 3], distinct cones, see encoded_cones.
        cone: unsigned [K], index of each kind in `cones`.
    """

    kind: Index
    rows: NDArray[np.uint8]
    normals: NDArray[np.float32]
    normal: Index
    cones: NDArray[np.uint8]
    cone: Index

    @classmethod
    def of(
        cls,
        normals: NDArray[np.float32],
        visible_bits: NDArray[np.uint8],
        cone: NDArray[np.uint8],
    ) -> Self:
        """Return the sky visibility of vertices.

        Args:
            normals: Unit vectors [V, 3], with few distinct values.
            visible_bits: uint8 [V, DIRECTIONS / 8], visible directions as packed by np.packbits.
            cone: uint8 [V, 3], see encoded_cones.
        """
        first_normal, number = distinct_rows(normals)
        rows = np.full((len(cone), VERTEX_BYTES), 255, np.uint8)
        rows[:, :3], rows[:, 8:] = cone, visible_bits
        a, _, b, c, d = rows.view(np.uint32).T.astype(np.uint64)
        identity = [a << _WORD | b, c << _WORD | d, number.astype(np.uint64)]
        first, kind = distinct_rows(np.stack(identity, axis=1))
        packed, which = np.unique(rows[first].view(np.uint32)[:, 0], return_inverse=True)
        return cls(
            kind=_narrow(kind),
            rows=rows[first],
            normals=normals[first_normal],
            normal=_narrow(number[first]),
            cones=packed.view(np.uint8).reshape(-1, 4)[:, :3],
            cone=_narrow(which),
        )

    @property
    def visible(self) -> Directions:
        """Visibility of each direction from each vertex, bool [V, DIRECTIONS]."""
        return np.unpackbits(self.rows[self.kind, 8:], axis=1).astype(bool)

    def irradiance(self, sky: Sky) -> NDArray[np.float32]:
        """Return irradiance / pi [V, 3] from the visible sky, without directional lights."""
        return self._each(self._irradiance(sky))

    def directional_irradiance(self, sky: Sky) -> NDArray[np.float32]:
        """Return irradiance / pi [V, 3] from directional lights.

        The visibility of a light is the visible share of the directions around it.
        """
        return self._each(self._directional_irradiance(sky))

    def vertex_bytes(
        self, sky: Sky, light: NDArray[np.floating] | None = None
    ) -> NDArray[np.uint8]:
        """Return the cone, the light and the visible directions as the shader reads them.

        The light is encoded as its ratio r, in each channel, to the irradiance of an open sky about
        the bent normal, which the shader looks up. A common scale s keeps the channels in range:
        three bytes have LIGHT_STEPS r / s, the fourth has LIGHT_TIMES (s - 1).

        Args:
            sky: The environment.
            light: Irradiance / pi [V, 3], by default from the visible sky.

        Returns:
            uint8 [V, VERTEX_BYTES].
        """
        if light is None:
            return self._read(np.take(self._steps(sky, self._irradiance(sky)), self.kind))
        return self._read(self._steps(sky, light, self.kind))

    def lit(self, sky: Sky) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]:
        """Return vertex bytes, irradiance with and irradiance without directional lights.

        This costs less than the three methods.
        """
        light = self._irradiance(sky)
        values = self._read(np.take(self._steps(sky, light), self.kind))
        return values, self._each(light + self._directional_irradiance(sky)), self._each(light)

    def _each(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return values of kinds [K, 3] for each vertex [V, 3], channel by channel in memory."""
        return np.take(light.T, self.kind, axis=1).T

    def _bits(self, number: int) -> NDArray[np.uint8]:
        """Return the visibility bits [K] of the eight directions from 8 `number` on."""
        return self.rows[:, 8 + number]

    def _irradiance(self, sky: Sky) -> NDArray[np.float32]:
        """Return `irradiance` of each kind, [K, 3].

        It is the share of the visible directions in the irradiance about the normal. A table has
        the sums over all 256 subsets of eight directions for each normal. A byte of visibility bits
        is the index.
        """
        cosine = np.maximum(self.normals @ sky_directions().T.astype(np.float32), 0)
        weight = cosine[:, None] * _radiance(sky).T
        weight *= _WHOLE / weight.sum(axis=2, keepdims=True)
        # three channels in one integer, which makes the additions three times as fast
        red, green, blue = np.rint(weight).astype(np.uint64).transpose(1, 0, 2)
        together = (blue << _FIELD_BITS | green) << _FIELD_BITS | red
        sums = _sums_of_eight(together.reshape(len(together), -1, 8).transpose(1, 0, 2))
        total = np.zeros(len(self.normal), np.uint64)
        row = 256 * self.normal.astype(np.intp)
        for number, table in enumerate(sums.reshape(len(sums), -1)):
            total += np.take(table, row + self._bits(number))
        step = self._whole(sky, _directions(open_sky(self.normals)[:, :3])) / _WHOLE
        found = np.empty((3, len(total)), np.float32)
        for channel in range(3):
            share = (total & (2 * _WHOLE - 1)).astype(np.float32)
            total >>= _FIELD_BITS
            np.multiply(share, np.take(step[:, channel], self.normal), out=found[channel])
        return found.T

    def _directional_irradiance(self, sky: Sky) -> NDArray[np.float32]:
        """Return `directional_irradiance` of each kind, [K, 3]."""
        found = np.zeros((3, len(self.normal)), np.float32)
        for each in sky.light.lights:
            toward = to_map_frame(each.direction, -sky.yaw_deg)
            nearest = np.argsort(-sky_directions() @ toward)[:_AROUND_LIGHT]
            count = sum(self._bits(k >> 3) >> (7 - (k & 7)) & 1 for k in nearest.tolist())
            cosine = np.maximum(self.normals @ toward.astype(np.float32), 0)
            share = np.take(cosine, self.normal) * (count / np.float32(_AROUND_LIGHT))
            for channel, light in zip(found, each.light, strict=True):
                channel += share * np.float32(light)
        return found.T

    def _steps(
        self, sky: Sky, light: NDArray[np.floating], kind: Any = slice(None)
    ) -> NDArray[np.uint32]:
        """Return the four light bytes of `vertex_bytes` as integers [N].

        Args:
            sky: The environment.
            light: Irradiance / pi [N, 3] of vertices or kinds.
            kind: Kind of each row of `light`.
        """
        step, which = LIGHT_STEPS / self._whole(sky, _directions(self.cones)), self.cone[kind]
        steps = [light[:, c] * np.take(step[:, c], which) for c in range(3)]
        brightest = np.maximum(np.maximum.reduce(steps), 255) / 255
        times = np.minimum(np.ceil(LIGHT_TIMES * (brightest - 1)), 255)
        # brighter light is scaled down as a whole, which keeps its colour
        fits = 1 / np.maximum(1 + times / LIGHT_TIMES, brightest)
        found = np.empty((len(light), 4), np.uint8)
        for channel in range(3):
            found[:, channel] = np.minimum(steps[channel] * fits + 0.5, 255)  # rounds
        found[:, 3] = times
        return found.view(np.uint32)[:, 0]

    def _read(self, steps: NDArray[np.uint32]) -> NDArray[np.uint8]:
        """Return the vertex bytes with light from `_steps` [V]."""
        found = np.take(self.rows, self.kind, axis=0)
        found.view(np.uint32)[:, 1] = steps
        return found

    @staticmethod
    def _whole(sky: Sky, toward: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.maximum(sky_irradiance(sky.light, toward, sky.yaw_deg), _DARK)


@lru_cache(maxsize=1)  # the container and the spreader of a scene have the same sky
def _radiance(sky: Sky) -> NDArray[np.float32]:
    """Return the mean radiance [DIRECTIONS, 3] around each direction."""
    return np.maximum(sky_radiance(sky.light, sky_directions(), sky.yaw_deg), _DARK)


def _narrow(index: NDArray[np.intp]) -> Index:
    """Return indices [V] in the smallest integer type that fits."""
    return index.ravel().astype(np.min_scalar_type(int(index.max(initial=0))))


def _directions(cone: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the bent normals [K, 3] of encoded cones [K, 3]."""
    bent, length = _decoded(cone)
    normals: NDArray[np.float32] = (bent / length).T
    return normals


def _share(length: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the visible share [K] of the hemispheres of cones with these lengths of 127 v."""
    rim = np.clip(2 - 2 / 127 * length, 0, 1)
    return np.asarray(1 - rim * rim, np.float32)


def _decoded(cone: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return 127 v [3, K] of encoded cones [K, 3], see `encoded_cones`, and its length [K]."""
    bent = np.subtract(cone.T, 128, dtype=np.float32)
    x, y, z = bent
    return bent, np.sqrt(x * x + y * y + z * z)


def _sums_of_eight(weight: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the sums of all subsets of eight weights.

    Args:
        weight: uint64 [..., 8].

    Returns:
        uint64 [..., 256], indexed by the bits of np.packbits, in which the first weight has the
        highest bit.
    """
    sums = np.zeros((*weight.shape[:-1], 256), np.uint64)
    for bit in range(8):
        known = sums[..., : 1 << bit]
        np.add(known, weight[..., 7 - bit, None], out=sums[..., 1 << bit : 2 << bit])
    return sums
