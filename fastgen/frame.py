"""Frame: the images that one draw returns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Frame:
    """One draw's targets, row 0 at the top.

    image: uint8 [H, W, 3], sRGB. cover: uint8 [H, W], how much of a pixel container and spreader
    cover, 255 for all of it; the surroundings show in the rest. ids: uint16 [H, W], 0 where void.
    damage: uint16 [H, W], class * 100 + instance. depth: float32 [H, W], metres along the optical
    axis, inf where void.
    """

    image: NDArray[np.uint8]
    cover: NDArray[np.uint8]
    ids: NDArray[np.uint16]
    damage: NDArray[np.uint16]
    depth: NDArray[np.float32]
