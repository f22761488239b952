"""Importance sampling of an environment for ray casting."""

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.light.octahedral import octahedral_decode, octahedral_encode, octahedral_texels

Floats = NDArray[np.float32]

_LEVELS, _LEVEL_STEP = 8, 1.5
"""Number of resolutions for mean radiance, and the ratio of their sides."""

_EVEN = 0.5
"""Share of the directions that are spread evenly; they find indirect light between surfaces."""


class SkyRays:
    """Importance samples of an environment, in the frame of its map.

    Any run of 2^k directions that starts at a multiple of 2^k is as well distributed as the whole.

    Args:
        radiance: [N, N, 3], octahedral map without a border and without directional lights.
        count: Number of directions, a power of two.

    Attributes:
        directions: Unit vectors [count, 3].
        density: [count], probability density per steradian at each direction.
        radiance: [count, 3], radiance from each direction.
    """

    def __init__(self, radiance: Floats, count: int) -> None:
        size = len(radiance)
        solid_angle = octahedral_texels(size)[1].reshape(size, size)
        solid_angle = solid_angle * (4 * np.pi / solid_angle.sum())
        # all channels count alike
        power = (radiance.mean(axis=2, dtype=np.float64) + 1e-20) * solid_angle
        share = _EVEN * solid_angle / solid_angle.sum() + (1 - _EVEN) * power / power.sum()
        # first a row, then a column: Pharr, Jakob and Humphreys 2023, section 2.4.3
        u, v = spread_points(count)
        row, down = _inverted(share.sum(axis=1)[None], v)
        column, right = _inverted(share[row], u)
        toward = octahedral_decode(np.stack([column + right, row + down], axis=-1) / size)
        self.directions = toward.astype(np.float32)
        self.density = (share / solid_angle)[row, column].astype(np.float32)
        self.radiance = radiance[row, column]
        sides = [max(round(size / _LEVEL_STEP**level), 1) for level in range(_LEVELS)]
        levels = [cv2.resize(radiance, (n, n), interpolation=cv2.INTER_AREA) for n in sides]
        self._sides = np.array(sides, np.int32)
        self._levels = np.concatenate([level.reshape(-1, 3) for level in levels])

    def mean(self, toward: NDArray[np.floating], solid_angle: Floats) -> Floats:
        """Return the mean radiance [K, 3] over solid angles [K] in steradians.

        The solid angles are centred on `toward`, [K, 3], in the frame of the map.
        """
        sides = self._sides
        # the mean solid angle of a texel is 4 pi / side^2
        fits = np.sqrt(4 * np.pi / np.maximum(solid_angle, 1e-9))
        level = np.rint(np.log(sides[0] / np.clip(fits, 1, sides[0])) / np.log(_LEVEL_STEP))
        level = np.minimum(level.astype(np.int32), len(sides) - 1)
        side = sides[level]
        uv = octahedral_encode(toward).T
        x, y = (np.minimum((c * side).astype(np.int32), side - 1) for c in uv)
        first = np.cumsum([0, *(sides * sides)[:-1]]).astype(np.int32)
        radiance: Floats = np.take(self._levels, first[level] + y * side + x, axis=0)
        return radiance


def spread_points(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return u and v, each [count] in [0, 1), of a low-discrepancy sequence.

    The van der Corput and Sobol sequences, as in Kollig and Keller 2002, Efficient Multidimensional
    Sampling, section 3. Any run of 2^k points that starts at a multiple of 2^k is a (0, k, 2)-net.
    """
    bits = 32
    number = np.arange(count, dtype=np.uint64)
    found = np.zeros((2, count), np.uint64)
    turn = [np.uint64(1 << (bits - 1))] * 2
    for bit in range(max(count - 1, 1).bit_length()):
        is_set = (number >> np.uint64(bit) & np.uint64(1)).astype(bool)
        for coordinate in (0, 1):
            found[coordinate, is_set] ^= turn[coordinate]
        turn = [turn[0] >> np.uint64(1), turn[1] ^ turn[1] >> np.uint64(1)]
    found[0] ^= np.uint64(0x9E3779B9)
    found[1] ^= np.uint64(0x7F4A7C15)
    u, v = found / 2.0**bits
    return u, v


def _inverted(
    share: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Invert discrete cumulative distributions.

    Args:
        share: Probabilities of N bins, [K, N], or [1, N] for all rows.
        at: [K], positions 0..1.

    Returns:
        The bin [K] of each position and the fraction of the bin before the position, [K].
    """
    total = np.cumsum(share, axis=1)
    total /= total[:, -1:]
    part = np.minimum((total <= at[:, None]).sum(axis=1), total.shape[1] - 1)
    row = np.arange(len(at)) if len(total) > 1 else np.zeros(len(at), np.intp)
    before = np.where(part > 0, total[row, part - 1], 0)
    return part, (at - before) / (total[row, part] - before)
