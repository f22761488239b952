"""An environment as rays ask for it: directions in which its light comes, more where much of it
does, and its mean over a small solid angle. No GL here.
"""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.light.prefilter import octahedral_decode
from fastgen.scene import REC_709

Floats = NDArray[np.float32]

_SIDES = (126, 84, 56, 38, 25, 17, 11, 7)
"""Texels along a side of the maps that means are looked up in, the sides in steps of 1.5."""

_EVEN = 0.5
"""Share of the directions that are spread evenly: they find what surfaces throw on one another."""


class SkyRays:
    """Of radiance [N, N, 3], an octahedral map without a border, suns taken out; all in its frame.

    count: of directions, a power of two. Any run of 2^k of them that begins at a multiple of 2^k is
    spread as well as all are. directions: unit [count, 3]. density: [count], of all directions a
    steradian about each. radiance: [count, 3], which comes from there.
    """

    def __init__(self, radiance: Floats, count: int) -> None:
        cells, solid_angle, along = _cells(len(radiance))
        light = radiance.reshape(-1, 3)[along]
        power = (light @ REC_709.astype(np.float32) + np.float32(1e-20)) * solid_angle
        share = _EVEN * solid_angle / solid_angle.sum() + (1 - _EVEN) * power / power.sum()
        # the van der Corput sequence, so that runs of it are spread evenly too
        bits = int(count).bit_length() - 1
        turned = [int(f"{i:0{bits}b}"[::-1], 2) for i in range(count)]
        total = np.cumsum(share, dtype=np.float64)
        chosen = np.searchsorted(total / total[-1], (np.array(turned) + 0.5) / count)
        self.directions = cells[chosen]
        self.density = (share / solid_angle)[chosen]
        self.radiance = light[chosen]
        levels = [cv2.resize(radiance, (n, n), interpolation=cv2.INTER_AREA) for n in _SIDES]
        self._levels = np.concatenate([level.reshape(-1, 3) for level in levels])

    def mean(self, toward: Floats, solid_angle: Floats) -> Floats:
        """Mean radiance [K, 3] over a solid angle [K] in steradians about directions [K, 3]."""
        sides = np.array(_SIDES, np.int32)
        # a level's texels are 4 pi / side^2 wide on the mean
        fits = np.sqrt(4 * np.pi / np.maximum(solid_angle, 1e-9))
        level = np.rint(np.log(_SIDES[0] / np.clip(fits, 1, _SIDES[0])) / np.log(1.5))
        level = np.minimum(level.astype(np.int32), len(sides) - 1)
        side = sides[level]
        x, y = (np.minimum((c * side).astype(np.int32), side - 1) for c in _octahedral(toward))
        first = np.cumsum([0, *(sides * sides)[:-1]]).astype(np.int32)
        return np.take(self._levels, first[level] + y * side + x, axis=0)


def _octahedral(toward: Floats) -> tuple[Floats, Floats]:
    """As prefilter.octahedral_encode in single precision, u and v [K] each."""
    x, y, z = np.ascontiguousarray(toward.T)
    total = np.abs(x) + np.abs(y) + np.abs(z)
    x, y = x / total, y / total
    below = z < 0
    u = np.where(below, np.copysign(1 - np.abs(y), x), x)
    v = np.where(below, np.copysign(1 - np.abs(x), y), y)
    return u * np.float32(0.5) + np.float32(0.5), v * np.float32(0.5) + np.float32(0.5)


@cache
def _cells(size: int) -> tuple[Floats, Floats, NDArray[np.intp]]:
    """Directions [size^2, 3] and solid angles [size^2] of an octahedral map's texels, along a curve
    on which neighbours stay near one another, and where in the map they are, [size^2]."""
    place = np.arange(size * size)
    row, column = np.divmod(place, size)
    # Morton 1966: the bits of both coordinates by turns
    code = sum(((row >> b & 1) << (2 * b + 1)) | ((column >> b & 1) << (2 * b)) for b in range(10))
    along = np.argsort(code)
    uv = np.stack([column[along] + 0.5, row[along] + 0.5], axis=-1) / size
    toward = octahedral_decode(uv)
    solid_angle = np.abs(toward).sum(axis=1) ** 3  # as environment.sky_radiance has it
    solid_angle *= 4 * np.pi / solid_angle.sum()
    return toward.astype(np.float32), solid_angle.astype(np.float32), along
