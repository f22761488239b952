"""Box and cylinder of unit size, as triangles with normals."""

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

ROUND_SIDES = 64
"""Sides of a cylinder."""


class UnitSolid(NamedTuple):
    """A solid from -1 to 1 along each axis: corners [V, 3], normals [V, 3], triangles [T, 3]."""

    corners: NDArray[np.floating]
    normals: NDArray[np.floating]
    triangles: NDArray[np.integer]


def unit_solid(shape: str) -> UnitSolid:
    """Return a 'box' with flat faces, or a 'cylinder' along y with a smooth side."""
    return _box() if shape == "box" else _cylinder()


def _box() -> UnitSolid:
    """Return a box with flat faces."""
    corners, normals = [], []
    for axis, sign in itertools.product(range(3), (-1, 1)):
        out, across, up = np.roll(np.eye(3), axis, axis=1)
        turn = [(-1, -sign), (1, -sign), (1, sign), (-1, sign)]
        corners += [sign * out + u * across + v * up for u, v in turn]
        normals += 4 * [sign * out]
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = np.concatenate([quad + 4 * face for face in range(6)])
    return UnitSolid(np.array(corners), np.array(normals), triangles)


def _cylinder() -> UnitSolid:
    """Return a cylinder along y with a smooth side."""
    angle = np.linspace(0, 2 * np.pi, ROUND_SIDES, endpoint=False)
    out = np.stack([np.cos(angle), np.zeros(ROUND_SIDES), -np.sin(angle)], axis=-1)
    end = np.array([0.0, 1.0, 0.0])
    rings = [out - end, out + end]
    corners = np.concatenate([*rings, *rings])
    normals = np.concatenate([out, out, np.tile(-end, (len(out), 1)), np.tile(end, (len(out), 1))])
    i = np.arange(ROUND_SIDES)
    j, count = (i + 1) % ROUND_SIDES, ROUND_SIDES
    side = [np.stack([i, j, j + count], axis=-1), np.stack([i, j + count, i + count], axis=-1)]
    fan = np.stack([np.zeros_like(i[1:-1]), i[1:-1], j[1:-1]], axis=-1)
    caps = [2 * count + fan[:, ::-1], 3 * count + fan]
    return UnitSolid(corners, normals, np.concatenate([*side, *caps]))
