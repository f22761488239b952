"""Triangle bodies without an atlas: occluders for shadow maps and ray casting."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import Mesh
from fastgen.geometry.spreader import CABLE_TIER, tier_of_vertices


@dataclass(frozen=True, eq=False)
class Body:
    """Triangles that block light.

    Attributes:
        positions_mm: float32 [V, 3] in the container frame.
        triangles: uint32 [T, 3], counter-clockwise from outside.
    """

    positions_mm: NDArray[np.float32]
    triangles: NDArray[np.uint32]

    @cached_property
    def bounds_mm(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates [3] of all vertices."""
        columns = np.ascontiguousarray(self.positions_mm.T)  # row-wise takes ten times as long
        return columns.min(axis=1), columns.max(axis=1)


Solid = Body | Mesh
"""Any occluder; a Mesh has the same arrays as a Body."""


def without_cables(spreader: Mesh) -> Body:
    """Return a spreader without its cables, which are too thin for shadow maps."""
    solid = tier_of_vertices(spreader) != CABLE_TIER
    triangles = spreader.triangles[solid[spreader.triangles[:, 0]]]
    used, numbers = np.unique(triangles, return_inverse=True)
    return Body(spreader.positions_mm[used], numbers.reshape(-1, 3).astype(np.uint32))
