"""How exact are damage masks and depth, and what does a damaged frame cost?

    python bench/damage_masks.py [--scenes 100]

Each damaged scene, seen by all its cameras at 256x256, is compared with rays that Embree casts
through every pixel centre at the mesh deformed in numpy (tests/oracle.py). Then the median frame
time of damaged scenes at 640x640 is set against the same scenes without their damage.
"""

import argparse
import os
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np

from fastgen import Config, Generator
from fastgen.container import build_container
from tests import oracle

DAMAGED = Config.from_values({"damage": {"probability": 1.0}})


def accuracy(scenes: int) -> None:
    """Print shares of pixels whose label or depth differs from the rays'."""
    pixels = labels = ids = seen = deep = 0
    with Generator(DAMAGED, seed=101, size=(256, 256)) as generator:
        for index in range(scenes):
            scene = generator.scene(index)
            mesh = build_container(scene.container.kind, scene.container.profiles)
            for camera in scene.cameras:
                sample = generator.render(scene=scene, camera=camera)
                hits = oracle.cast(mesh, sample.view, scene)
                target = oracle.damage_values(scene, hits, DAMAGED.damage.mask_threshold_mm)
                pixels += target.size
                labels += int((sample.damage != target).sum())
                ids += int((sample.ids != oracle.object_ids(scene, mesh, hits)).sum())
                both = np.isfinite(sample.depth) & hits.hit
                error = np.abs(sample.depth[both] - hits.depth_m[both])
                seen += int(both.sum())
                deep += int((error > np.maximum(1e-3, 1e-3 * hits.depth_m[both])).sum())
    print(f"{scenes} damaged scenes, {pixels} pixels")
    print(f"damage labels that differ  {labels:8d}  {labels / pixels:.2e}")
    print(f"ids that differ            {ids:8d}  {ids / pixels:.2e}")
    print(f"depth off by more than max(1 mm, 0.1 %)  {deep:8d} of {seen}  {deep / seen:.2e}")


def cost(scenes: int) -> None:
    """Print the ratio of frame times with and without damage."""
    times: dict[str, list[float]] = {"sound": [], "damaged": []}
    with Generator(DAMAGED, seed=101, size=(640, 640)) as generator:
        for index in range(scenes):
            scene = generator.scene(index)
            for camera in scene.cameras:
                for name, each in (("sound", replace(scene, damages=())), ("damaged", scene)):
                    taken = []
                    for _ in range(3):
                        began = time.perf_counter()
                        generator.render(scene=each, camera=camera)
                        taken.append(time.perf_counter() - began)
                    times[name].append(min(taken))
    sound, damaged = (statistics.fmean(times[name]) * 1e3 for name in ("sound", "damaged"))
    print(f"frame, labels included: sound {sound:.1f} ms, damaged {damaged:.1f} ms, ", end="")
    print(f"ratio {damaged / sound:.2f}")


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=100)
    scenes = parser.parse_args().scenes
    accuracy(scenes)
    cost(max(scenes // 5, 4))


if __name__ == "__main__":
    main()
