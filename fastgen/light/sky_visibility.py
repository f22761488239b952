"""How open surfaces lie to the sky, as the shader reads it, and how much of a sky's light that lets
in. No GL here.
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.distinct_rows import distinct_rows
from fastgen.light.environment import Ambient, sky_irradiance, sky_radiance, to_map_frame
from fastgen.light.prefilter import octahedral_decode

DIRECTIONS = 96
"""Of the whole sphere, so that about half of them bear on a surface; a multiple of 8."""

VERTEX_BYTES = 8 + DIRECTIONS // 8
"""What the shader reads of a vertex: a cone, filled up to four bytes, four of the light that comes
in, and a bit for each direction."""

LIGHT_STEPS = 127.0
"""What of 255 stands for all the light of an open sky."""

LIGHT_TIMES = 4.0
"""What of 255 in a fourth channel stands for as much again as the others hold together, where one
of them would pass 255: below spreaders the ground is dark and the sunlit roof throws light."""

_LOBE = 8
"""Directions about a mirrored ray: as many as a cap of 34 degrees holds. Four or 14 tell less
well which share of a lobe is open."""

_ABOUT_SUN = 4
"""Directions that tell how open a sun is: a cap of 24 degrees."""

_DARK = 1e-20  # instead of no light at all, which has no ratios
_FIELD_BITS = 21  # of a channel, three of which share a number
_WHOLE = 1 << (
    _FIELD_BITS - 1
)  # what all directions add up to, but for rounding; a field holds twice that
_WORD = np.uint64(32)  # bits
_BLOCK = 2048  # vertices at once, as a core's cache holds them

Array = NDArray[np.float64]
Directions = NDArray[np.bool_]
"""Whether each of V points is open to each of sky_directions(): [V, DIRECTIONS]."""


@cache
def sky_directions() -> Array:
    """Unit vectors [DIRECTIONS, 3] spread evenly over the sphere: a Fibonacci spiral. Read-only."""
    i = np.arange(DIRECTIONS)
    z = 1 - (2 * i + 1) / DIRECTIONS
    turn = np.pi * (3 - 5**0.5) * i
    flat = np.sqrt(1 - z * z)
    found = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    found.flags.writeable = False
    return found


def open_sky(normals: NDArray[np.floating]) -> NDArray[np.uint8]:
    """What the shader reads of surfaces that see their whole hemisphere, uint8 [V, VERTEX_BYTES]:
    as `encoded` and `Openness.under` have it."""
    found = np.full((len(normals), VERTEX_BYTES), 255, np.uint8)
    found[:, :3] = np.rint(128 + 127 * normals)
    found[:, 4:7], found[:, 7] = LIGHT_STEPS, 0
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
    """An environment's light, turned by yaw_deg."""

    light: Ambient
    yaw_deg: float


class Openness:
    """What a mesh's V vertices see of the sky.

    normals: unit [V, 3]; few of them differ. open_to: Directions packed along them, uint8
    [V, DIRECTIONS / 8]. cone: uint8 [V, 3] as of `encoded`.

    Vertices that are alike in all three are of one kind, about 0.6 V kinds of a container's: light
    is found once for each of the K kinds.
    """

    def __init__(
        self,
        normals: NDArray[np.float32],
        open_to: NDArray[np.uint8],
        cone: NDArray[np.uint8],
    ) -> None:
        first, number = distinct_rows(normals)
        self._normals = normals[first]
        rows = np.full((len(cone), VERTEX_BYTES), 255, np.uint8)
        rows[:, :3], rows[:, 8:] = cone, open_to
        a, _, b, c, d = rows.view(np.uint32).T.astype(np.uint64)
        told = [a << _WORD | b, c << _WORD | d, number.astype(np.uint64)]
        first, kind = distinct_rows(np.stack(told, axis=1))
        self._kind, self._number = _narrow(kind), _narrow(number[first])
        self._rows = rows[first]
        """As the shader reads each kind, but for the light."""
        packed, which = np.unique(self._rows.view(np.uint32)[:, 0], return_inverse=True)
        self._cones, self._which = packed.view(np.uint8).reshape(-1, 4)[:, :3], _narrow(which)

    @property
    def open_to(self) -> Directions:
        """Whether each vertex is open to each direction."""
        return np.unpackbits(self._rows[self._kind, 8:], axis=1).astype(bool)

    def irradiance(self, sky: Sky) -> NDArray[np.float32]:
        """Irradiance / pi, [V, 3], from where `sky` is open, without its suns."""
        return self._each(self._irradiance(sky))

    def sunlight(self, sky: Sky) -> NDArray[np.float32]:
        """As `irradiance`, from the suns alone; each is as open as the directions about it."""
        return self._each(self._sunlight(sky))

    def under(self, sky: Sky, light: NDArray[np.floating] | None = None) -> NDArray[np.uint8]:
        """As the shader reads it under `sky`, uint8 [V, VERTEX_BYTES]: the cone, the light that
        comes in, and open_to.

        light: irradiance / pi [V, 3], by default that from the sky. There is, as LIGHT_STEPS r / s,
        the ratio r in each channel to the irradiance of a whole sky about the cone's direction,
        which is what the shader looks up, and as LIGHT_TIMES (s - 1) the scale s that all three
        fit in.
        """
        if light is None:
            return self._read(np.take(self._steps(sky, self._irradiance(sky)), self._kind))
        return self._read(self._steps(sky, light, self._kind))

    def lit(self, sky: Sky) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]:
        """`under` the sky, `irradiance` with `sunlight`, and without, at less than their cost."""
        light = self._irradiance(sky)
        values = self._read(np.take(self._steps(sky, light), self._kind))
        return values, self._each(light + self._sunlight(sky)), self._each(light)

    def _each(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Of each vertex [V, 3] what is known of each kind [K, 3], both a channel after the other
        in memory."""
        return np.take(light.T, self._kind, axis=1).T

    def _bits(self, number: int) -> NDArray[np.uint8]:
        """Which of eight directions from 8 `number` on are open to each kind, a bit each."""
        return self._rows[:, 8 + number]

    def _irradiance(self, sky: Sky) -> NDArray[np.float32]:
        """As `irradiance`, of each kind.

        It is a part of the irradiance about the normal: that of the open ones in sums over all
        directions. Of such sums over eight directions at a time there are 256 for each normal: a
        byte of open_to finds its own.
        """
        cosine = np.maximum(self._normals @ sky_directions().T.astype(np.float32), 0)
        weight = cosine[:, None] * _radiance(sky).T
        weight *= _WHOLE / weight.sum(axis=2, keepdims=True)
        # the three channels side by side in one number: adding one takes a third of the time
        red, green, blue = np.rint(weight).astype(np.uint64).transpose(1, 0, 2)
        together = (blue << _FIELD_BITS | green) << _FIELD_BITS | red
        sums = _sums_of_eight(together.reshape(len(together), -1, 8).transpose(1, 0, 2))
        total = np.zeros(len(self._number), np.uint64)
        row = 256 * self._number.astype(np.intp)
        for number, table in enumerate(sums.reshape(len(sums), -1)):
            total += np.take(table, row + self._bits(number))
        step = self._whole(sky, _directions(open_sky(self._normals)[:, :3])) / _WHOLE
        found = np.empty((3, len(total)), np.float32)
        for channel in range(3):
            share = (total & (2 * _WHOLE - 1)).astype(np.float32)
            total >>= _FIELD_BITS
            np.multiply(share, np.take(step[:, channel], self._number), out=found[channel])
        return found.T

    def _sunlight(self, sky: Sky) -> NDArray[np.float32]:
        """As `sunlight`, of each kind."""
        found = np.zeros((3, len(self._number)), np.float32)
        for sun in sky.light.suns:
            toward = to_map_frame(sun.direction, -sky.yaw_deg)
            nearest = np.argsort(-sky_directions() @ toward)[:_ABOUT_SUN]
            count = sum(self._bits(k >> 3) >> (7 - (k & 7)) & 1 for k in nearest.tolist())
            cosine = np.maximum(self._normals @ toward.astype(np.float32), 0)
            share = np.take(cosine, self._number) * (count / np.float32(_ABOUT_SUN))
            for channel, light in zip(found, sun.light, strict=True):
                channel += share * np.float32(light)
        return found.T

    def _steps(
        self, sky: Sky, light: NDArray[np.floating], kind: Any = slice(None)
    ) -> NDArray[np.uint32]:
        """The light that comes in as of `under`, four bytes in a number each [N]; light: [N, 3] of
        vertices or kinds; kind: theirs."""
        step, which = LIGHT_STEPS / self._whole(sky, _directions(self._cones)), self._which[kind]
        steps = [light[:, c] * np.take(step[:, c], which) for c in range(3)]
        brightest = np.maximum(np.maximum.reduce(steps), 255) / 255
        times = np.minimum(np.ceil(LIGHT_TIMES * (brightest - 1)), 255)
        # what is brighter still is dimmed as a whole: its colour stays
        fits = 1 / np.maximum(1 + times / LIGHT_TIMES, brightest)
        found = np.empty((len(light), 4), np.uint8)
        for channel in range(3):
            found[:, channel] = np.minimum(steps[channel] * fits + 0.5, 255)  # rounds
        found[:, 3] = times
        return found.view(np.uint32)[:, 0]

    def _read(self, steps: NDArray[np.uint32]) -> NDArray[np.uint8]:
        """As `under`; steps: as of _steps, of each vertex [V]."""
        found = np.take(self._rows, self._kind, axis=0)
        found.view(np.uint32)[:, 1] = steps
        return found

    @staticmethod
    def _whole(sky: Sky, toward: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.maximum(sky_irradiance(sky.light, toward, sky.yaw_deg), _DARK)


@lru_cache(maxsize=1)  # a scene's container and its spreader ask alike
def _radiance(sky: Sky) -> NDArray[np.float32]:
    """Radiance [DIRECTIONS, 3] from about each of the directions."""
    return np.maximum(sky_radiance(sky.light, sky_directions(), sky.yaw_deg), _DARK)


def _narrow(index: NDArray[np.intp]) -> NDArray[np.unsignedinteger[Any]]:
    """Indices [V] in as few bytes as hold them."""
    return index.ravel().astype(np.min_scalar_type(int(index.max(initial=0))))


def _directions(cone: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Unit vectors [K, 3] along the cones [K, 3] of `encoded`."""
    x, y, z = np.subtract(cone.T, 128, dtype=np.float32)
    return (np.stack([x, y, z]) / np.sqrt(x * x + y * y + z * z)).T


def _sums_of_eight(weight: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Sums [..., 256] of those of eight weights [..., 8] whose bits are set in each byte, in the
    order of np.packbits: the first has the highest."""
    sums = np.zeros((*weight.shape[:-1], 256), np.uint64)
    for bit in range(8):
        known = sums[..., : 1 << bit]
        np.add(known, weight[..., 7 - bit, None], out=sums[..., 1 << bit : 2 << bit])
    return sums
