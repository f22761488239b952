"""KITTI 2-D object labels, Geiger et al. 2012.

Each object has 15 columns. The 3-D columns have the values for "unknown" of KITTI's development
kit. Ignored objects are DontCare regions.
"""

from typing import Any

from fastgen.formats.format import Files, Format, Same
from fastgen.formats.item import Item

_UNKNOWN = "-1 -1 -1 -1000 -1000 -1000 -10"
"""Dimensions, location and rotation_y. KITTI has yaw only, which does not fit a tilted camera."""


class _Kitti(Format):
    name = "kitti"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        lines = []
        for thing, edges in item.detections:
            box = " ".join(f"{value:.2f}" for value in edges)
            state = f"{thing.class_name} {float(thing.truncated):.2f} {int(thing.occluded)} -10"
            head = "DontCare -1 -1 -10" if thing.ignored else state
            lines.append(f"{head} {box} {_UNKNOWN}\n")
        view = item.sample.view
        rows = ((*row, 0.0) for row in view.intrinsics.tolist())
        matrix = " ".join(f"{value:.9e}" for row in rows for value in row)
        folder = f"kitti/{item.split}"
        return {
            f"{folder}/image_2/{item.stem}.jpg": Same(item.image_path),
            f"{folder}/label_2/{item.stem}.txt": "".join(lines).encode(),
            f"{folder}/calib/{item.stem}.txt": f"P2: {matrix}\n".encode(),
        }, None


FORMAT = _Kitti()
