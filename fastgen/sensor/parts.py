"""What a Scene says of its lenses: plain frozen data, see fastgen/scene.py."""

from dataclasses import dataclass

from fastgen.errors import ConfigError
from fastgen.records import nearest

LENS_MODELS = {"brown_conrady": 5, "fisheye": 4}
"""Coefficients of each lens model, in OpenCV's order."""


@dataclass(frozen=True)
class Lens:
    """Distortion of a lens as OpenCV has it, so that a calibration can be pasted in.

    model: brown_conrady, with coefficients k1, k2, p1, p2, k3 (Brown 1971, "Close-Range Camera
    Calibration"), or fisheye, with k1, k2, k3, k4 (Kannala and Brandt 2006, "A Generic Camera Model
    and Calibration Method", eq. 6): radius = f (a + k1 a^3 + ... + k4 a^9), a the angle off axis.
    Raises ConfigError for another model or another count of coefficients.
    """

    model: str
    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse what no formula fits."""
        if self.model not in LENS_MODELS:
            raise ConfigError(
                f"lens.model: {self.model!r} is unknown{nearest(self.model, LENS_MODELS)}"
            )
        wanted = LENS_MODELS[self.model]
        if len(self.coefficients) != wanted:
            raise ConfigError(
                f"lens.coefficients: {self.model} takes {wanted}, got {len(self.coefficients)}"
            )
