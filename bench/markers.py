"""Does a frame cost more with more markers?

    python bench/markers.py

Times the same views with 1, 4, 16 and 64 markers on the door end, labels included, at 640x640.
"""

import os
import statistics
import time
from dataclasses import replace

os.environ.setdefault("LP_NUM_THREADS", "0")

from fastgen import Config, Generator
from fastgen.classes import MARKER_CLASSES
from fastgen.scene import Decal, Scene

_COLUMNS, _STEP_MM, _SIZE_MM = 8, 240.0, 200.0
_ROUNDS = 15


def with_markers(scene: Scene, count: int) -> Scene:
    """`scene` with `count` markers in rows on its door, and nothing else on it."""
    decals = []
    for i in range(count):
        row, column = divmod(i, _COLUMNS)
        name = MARKER_CLASSES[i % len(MARKER_CLASSES)]
        center = (250 + column * _STEP_MM, 250 + row * _STEP_MM)
        decals.append(Decal("marker", name, "door", center, (_SIZE_MM, _SIZE_MM), art=name))
    return replace(scene, decals=tuple(decals), damages=())


def main() -> None:
    """Print the median milliseconds a frame for each count, and the ratio to one marker."""
    with Generator(Config.preset(), seed=1) as generator:
        scenes = [generator.scene(i) for i in range(3)]
        medians: dict[int, float] = {}
        for count in (1, 4, 16, 64):
            views = [with_markers(scene, count) for scene in scenes]
            taken = []
            for _ in range(_ROUNDS):
                for view in views:
                    began = time.perf_counter()
                    generator.render(scene=view, camera="Cr")
                    taken.append(time.perf_counter() - began)
            medians[count] = statistics.median(taken) * 1e3
    for count, median in medians.items():
        print(f"{count:3d} markers {median:7.1f} ms  x{median / medians[1]:.2f}")


if __name__ == "__main__":
    main()
