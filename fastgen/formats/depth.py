"""Depth along the optical axis in millimetres, as 16-bit PNG, up to 65.5 m; 0 is background."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.files.images import png
from fastgen.formats.format import Files, Format
from fastgen.formats.item import Item


def depth_mm(depth_m: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return depth in whole millimetres, uint16 [H, W]: 0 for the background, at most 65535.

    Args:
        depth_m: float32 [H, W] in metres, not finite for the background.
    """
    mm = np.where(np.isfinite(depth_m), depth_m * 1e3, 0.0)
    return np.asarray(np.rint(np.minimum(mm, 65535)), np.uint16)


class _Depth(Format):
    name = "depth"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        path = f"depth/{item.split}/{item.stem}.png"
        return {path: png(depth_mm(item.sample.depth))}, None


FORMAT = _Depth()
