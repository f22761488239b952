"""Depth along the optical axis as 16-bit PNG: millimetres, which reach 65 m, and 0 where void."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.files.images import png
from fastgen.formats.format import Files, Format
from fastgen.formats.item import Item


def depth_mm(depth_m: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Metres float32 [H, W] to whole millimetres; 0 where void, 65535 that far away and farther."""
    mm = np.where(np.isfinite(depth_m), depth_m * 1e3, 0.0)
    return np.asarray(np.rint(np.minimum(mm, 65535)), np.uint16)


class _Depth(Format):
    name = "depth"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        path = f"depth/{item.split}/{item.stem}.png"
        return {path: png(depth_mm(item.sample.depth))}, None


FORMAT = _Depth()
