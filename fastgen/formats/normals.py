"""Surface normals as 8-bit PNG.

Red, green and blue are x, y and z in view space (x right, y down, z forward), 0..255 for -1..1.
Pixels without a surface are (128, 128, 128).
"""

from typing import Any

import numpy as np

from fastgen.files.images import png
from fastgen.formats.format import Files, Format
from fastgen.formats.item import Item


class _Normals(Format):
    name = "normals"
    needs_normals = True

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        normals = item.sample.normals
        if normals is None:
            raise ValueError("normals: render the sample with normals=True")
        pixels = np.asarray(np.rint(normals * 127.5 + 127.5), np.uint8)
        return {f"normals/{item.split}/{item.stem}.png": png(pixels)}, None


FORMAT = _Normals()
