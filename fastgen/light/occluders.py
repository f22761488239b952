"""What stands in the way of light, as depth maps that light from far away in one direction sees.

Maps keep back faces (those turned away from the light) rather than front ones: a lit surface is
then no occluder of itself. Of thick bodies they keep front faces as well, sunk into them.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import UNIT_CUBE, UNIT_CUBE_TRIANGLES, Mesh
from fastgen.geometry.spreader import CABLE_TIER, tier_of_vertices

_CORE_MM = 200.0
"""So far behind a container's sides its core begins."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Body:
    """What stands in the way. positions_mm: float32 [V, 3]. triangles: uint32 [T, 3],
    counter-clockwise from outside."""

    positions_mm: NDArray[np.float32]
    triangles: NDArray[np.uint32]

    @cached_property
    def bounds_mm(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates [3] of all vertices."""
        columns = np.ascontiguousarray(self.positions_mm.T)  # rows take ten times as long
        return columns.min(axis=1), columns.max(axis=1)


Solid = Body | Mesh
"""A mesh stands in the way as it is."""


@lru_cache(maxsize=256)  # as many as there are spreaders
def without_cables(spreader: Mesh) -> Body:
    """What of a spreader throws shade; its cables are too thin for the maps."""
    solid = tier_of_vertices(spreader) != CABLE_TIER
    triangles = spreader.triangles[solid[spreader.triangles[:, 0]]]
    used, numbers = np.unique(triangles, return_inverse=True)
    return Body(spreader.positions_mm[used], numbers.reshape(-1, 3).astype(np.uint32))


def core_of(container: Mesh) -> Body:
    """A box within a container.

    It stands in the way as well: maps that keep back faces lack the side that the light meets, and
    through the far one, thin as it is, light leaks along creases, within a texel and the bias.
    """
    low, high = container.bounds_mm
    inset = np.minimum(_CORE_MM, (high - low) / 3)
    corners = low + inset + UNIT_CUBE * (high - low - 2 * inset)
    return Body(corners.astype(np.float32), UNIT_CUBE_TRIANGLES)


def map_matrix(toward: Array, low: Array, high: Array) -> Array:
    """From mm to clip space [4, 4] of a parallel view of the box low..high from direction `toward`;
    the box's x axis lies along the view's."""
    along = np.array([1.0, 0.0, 0.0]) - toward[0] * toward
    if np.linalg.norm(along) < 1e-6:  # the view is along x itself
        along = np.array([0.0, 1.0, 0.0])
    along /= np.linalg.norm(along)
    axes = np.stack([along, np.cross(toward, along), -toward])
    center = (low + high) / 2
    half = np.abs(axes) @ ((high - low) / 2) * 1.001
    matrix = np.eye(4)
    matrix[:3, :3] = axes / half[:, None]
    matrix[:3, 3] = -matrix[:3, :3] @ center
    return matrix
