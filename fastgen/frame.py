"""Frame: the images of one render."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Frame:
    """Image and per-pixel labels of one render, row 0 at the top.

    Attributes:
        image: uint8 [H, W, 3], sRGB.
        cover: uint8 [H, W], share of the pixel that does not show the panorama: containers,
            spreader, ground and props; 255 is all of it.
        ids: uint16 [H, W], object id at the pixel centre, 0 for ground, props and panorama.
        damage: uint16 [H, W], category * 100 + instance at the pixel centre, see
            classes.ALL_SEGMENTATION_CLASSES. Undamaged surface of the first container has
            101, of the next 102; pixels without a container have 0.
        depth: float32 [H, W], metres along the optical axis, inf where the pixel centre shows the
            panorama.
        radiance: float32 [H, W, 3], linear Rec. 709 after exposure and before the tone curve;
            None unless requested.
        normals: float32 [H, W, 3], unit normals in view space (x right, y down, z forward), mean
            over the surfaces in a pixel, 0 for the panorama; None unless requested.
    """

    image: NDArray[np.uint8]
    cover: NDArray[np.uint8]
    ids: NDArray[np.uint16]
    damage: NDArray[np.uint16]
    depth: NDArray[np.float32]
    radiance: NDArray[np.float32] | None = field(default=None, kw_only=True)
    normals: NDArray[np.float32] | None = field(default=None, kw_only=True)
