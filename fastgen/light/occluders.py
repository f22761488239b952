"""Occluders of light from one distant direction, and the view of a depth map along it.

Depth maps hold back faces, which are turned away from the light, so that a lit surface does not
shadow itself. Thick bodies also add their front faces, moved a little into the body.
"""

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import UNIT_CUBE, UNIT_CUBE_TRIANGLES, Mesh
from fastgen.geometry.solids import Body

_CORE_MM = 200.0
"""Distance from a container's sides to its core."""

Array = NDArray[np.float64]


def core_of(container: Mesh) -> Body:
    """Return a box inside a container that blocks light which leaks through the thin walls.

    Depth maps of back faces lack the wall on the lit side. At the far wall, light would leak along
    creases within one texel and the depth bias.
    """
    low, high = container.bounds_mm
    inset = np.minimum(_CORE_MM, (high - low) / 3)
    corners = low + inset + UNIT_CUBE * (high - low - 2 * inset)
    return Body(corners.astype(np.float32), UNIT_CUBE_TRIANGLES)


def map_matrix(toward: Array, low: Array, high: Array) -> Array:
    """Return the matrix [4, 4] from mm to clip space of a parallel view of a box.

    Args:
        toward: Unit vector [3] from the box to the light.
        low: Lowest corner [3] of the box in mm.
        high: Highest corner [3] of the box in mm.

    Returns:
        Matrix whose view contains the whole box. The box's x axis lies along the view's x axis.
    """
    along = np.array([1.0, 0.0, 0.0]) - toward[0] * toward
    if np.linalg.norm(along) < 1e-6:  # the view is along x
        along = np.array([0.0, 1.0, 0.0])
    along /= np.linalg.norm(along)
    axes = np.stack([along, np.cross(toward, along), -toward])
    center = (low + high) / 2
    half = np.abs(axes) @ ((high - low) / 2) * 1.001
    matrix = np.eye(4)
    matrix[:3, :3] = axes / half[:, None]
    matrix[:3, 3] = -matrix[:3, :3] @ center
    return matrix
