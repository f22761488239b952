"""Mean slope of a corrugated sheet over any part of it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from fastgen.scene.faces import CORRUGATED_ALONG_Y, FACE_AXES

if TYPE_CHECKING:
    from fastgen.geometry.mesh import Mesh

VERSION = 1  # raise when the stored arrays change

_STEP_MM = 4.0


def corrugated_axis(face: str) -> int:
    """Return the sheet axis along which the corrugation of a face runs, 0 or 1."""
    return int(face == CORRUGATED_ALONG_Y)


@dataclass(frozen=True, eq=False)
class SheetFolds:
    """Normals along the corrugation of a sheet.

    Attributes:
        axis: Sheet axis along which the corrugation runs, 0 or 1.
        sums: float64 [K + 1, 2], integrals of the normal's components out of the face and along the
            axis, from the sheet's border in steps of _STEP_MM, relative to a step.
    """

    axis: int
    sums: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: "Mesh", face: str) -> Self:
        """Return the folds of a sheet, along a line through its middle."""
        axis = corrugated_axis(face)
        *_, width, height = mesh.charts[mesh.chart_index(face)].rect_mm
        places = np.arange(0.5 * _STEP_MM, (width, height)[axis], _STEP_MM)
        points = np.full((len(places), 2), (width / 2, height / 2))
        points[:, axis] = places
        _, normals = mesh.sheet_to_surface(face, points)
        axes = FACE_AXES[face]
        along = axes.up if axis else axes.right
        parts = normals @ np.array([axes.out, along]).T
        return cls(axis, np.concatenate([np.zeros((1, 2)), parts.cumsum(axis=0)]))

    @property
    def stretch(self) -> float:
        """Length of the sheet along the corrugation relative to its face."""
        return float((len(self.sums) - 1) / self.sums[-1, 0])

    def mean(
        self, low_mm: NDArray[np.float64], high_mm: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return mean normals between two sheet coordinates along the corrugation.

        Args:
            low_mm: float64 [N].
            high_mm: float64 [N], above `low_mm`.

        Returns:
            Components out of the face and along the corrugation, float64 [N, 2].
        """
        steps = np.arange(len(self.sums))
        last = len(self.sums) - 1.0
        low = np.clip(low_mm / _STEP_MM, 0, last - 1)
        high = np.clip(high_mm / _STEP_MM, low + 1e-3, last)
        found = [
            (np.interp(high, steps, part) - np.interp(low, steps, part)) / (high - low)
            for part in self.sums.T
        ]
        return np.stack(found, axis=-1)
