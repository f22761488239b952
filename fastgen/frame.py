"""Frame: the images of one render."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Frame:
    """Image and per-pixel labels of one render, row 0 at the top.

    Attributes:
        image: uint8 [H, W, 3], sRGB.
        cover: uint8 [H, W], coverage of the pixel by container and spreader; 255 is full coverage.
            The surroundings fill the rest.
        ids: uint16 [H, W], object id at the pixel centre, 0 for the surroundings.
        damage: uint16 [H, W], damage class * 100 + instance.
        depth: float32 [H, W], metres along the optical axis, inf for the surroundings.
        radiance: float32 [H, W, 3], linear Rec. 709 after exposure and before the tone curve;
            None unless requested.
        normals: float32 [H, W, 3], unit normals in view space (x right, y down, z forward), mean
            over the surfaces in a pixel, 0 for the surroundings; None unless requested.
    """

    image: NDArray[np.uint8]
    cover: NDArray[np.uint8]
    ids: NDArray[np.uint16]
    damage: NDArray[np.uint16]
    depth: NDArray[np.float32]
    radiance: NDArray[np.float32] | None = field(default=None, kw_only=True)
    normals: NDArray[np.float32] | None = field(default=None, kw_only=True)
