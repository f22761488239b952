"""Measure what further containers cost, by their number and by their pixels.

    python bench/containers.py [--quality draft balanced] [--repeats 5] [--size 640x640]

Scenes are rows of 1 to 8 containers on asphalt, seen from several distances. Times are CPU
milliseconds of one process per labelled image, the fastest of `repeats` renders after a first one
that prepares the scene. A least-squares fit splits them into parts: a fixed one, one for each
container that the image shows, and one for each thousand pixels of containers. The last line
compares a scene of the preset `gate` with one of `seafront`, sampling included.
Writes bench/results/containers.json.
"""

import argparse
import os
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")  # one thread, like a worker of `fastgen generate`

import numpy as np
from reporting import origin, parse_size, save

from fastgen import Config, Generator
from fastgen.scene import Camera, EnvironmentView, Ground, Neighbour, Pose, Scene, Spreader

COUNTS = (1, 2, 3, 5, 8)
DISTANCES_MM = (9_000.0, 14_000.0, 22_000.0)
_PITCH_MM = 3000.0


def rows(generator: Generator) -> Iterator[tuple[Scene, Camera]]:
    """Yield rows of containers, each with cameras at several distances."""
    scenes = [generator.scene(index) for index in range(max(COUNTS))]
    for count in COUNTS:
        first, *others = scenes[:count]
        neighbours = tuple(
            Neighbour(
                Pose((0.0, _PITCH_MM * k, 0.0)),
                each.container,
                each.surface,
                each.decals,
                each.damages,
                each.seals,
            )
            for k, each in enumerate(others, 1)
        )
        scene = replace(
            first,
            spreader=Spreader(),
            environment=EnvironmentView("port_noon", 0.0),
            neighbours=neighbours,
            ground=Ground("asphalt"),
        )
        middle = _PITCH_MM * (count - 1) / 2
        for distance in DISTANCES_MM:
            eye = (6100.0 + 0.8 * distance, middle, 0.6 * distance)
            yield scene, Camera("row", eye, (3000.0, middle, 1300.0), 22.0)


def cpu_ms(generator: Generator, scene: Scene, camera: Camera, repeats: int) -> tuple[float, Any]:
    """Return the fastest CPU time of a render in milliseconds, and the sample."""
    sample = generator.render(scene=scene, camera=camera)
    taken = []
    for _ in range(repeats):
        began = time.process_time()
        sample = generator.render(scene=scene, camera=camera)
        taken.append(time.process_time() - began)
    return min(taken) * 1e3, sample


def by_number_and_pixels(
    quality: str, size: tuple[int, int], repeats: int
) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Return the time of each row of containers, and the parts of the fit."""
    table: dict[str, list[float]] = {"containers": [], "kilopixels": [], "ms": []}
    config = Config.from_values({"container": {"kinds": {"40": 1}}})
    with Generator(config, seed=4, size=size, quality=quality) as generator:
        for scene, camera in rows(generator):
            ms, sample = cpu_ms(generator, scene, camera, repeats)
            seen = [i for i in sample.objects if i.class_name == "container" and i.area]
            table["containers"].append(sum(not i.background for i in seen))
            table["kilopixels"].append(np.count_nonzero(sample.damage) / 1e3)
            table["ms"].append(ms)
    columns = np.array([[1.0] * len(table["ms"]), table["containers"], table["kilopixels"]])
    parts, *_ = np.linalg.lstsq(columns.T, np.array(table["ms"]), rcond=None)
    names = ("fixed_ms", "ms_per_container", "ms_per_kilopixel")
    return table, dict(zip(names, parts.tolist(), strict=True))


def preset_ms(preset: str, quality: str, size: tuple[int, int], scenes: int) -> dict[str, float]:
    """Return the CPU time of an image of a preset, sampling included, and containers per scene."""
    taken, containers = [], []
    with Generator(Config.preset(preset), seed=11, size=size, quality=quality) as generator:
        generator.preload()
        for index in range(scenes):
            began = time.process_time()
            cameras = generator.scene(index).cameras
            for camera in cameras:
                generator.render(index, camera.name)
            taken.append((time.process_time() - began) / len(cameras))
            containers.append(1 + len(generator.scene(index).neighbours))
    return {"ms": statistics.mean(taken) * 1e3, "containers": statistics.mean(containers)}


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print the tables, and write the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quality", nargs="+", default=["draft", "balanced"])
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--scenes", type=int, default=24, help="scenes of each preset")
    options = parser.parse_args(argv)
    size = parse_size(options.size)
    results: dict[str, Any] = {**origin(), "size": options.size}
    for quality in options.quality:
        table, parts = by_number_and_pixels(quality, size, options.repeats)
        print(f"{quality}: containers, thousand pixels, CPU ms")
        for row in zip(*table.values(), strict=True):
            print("  {:3.0f} {:7.1f} {:7.1f}".format(*row))
        print(
            f"  fixed {parts['fixed_ms']:.1f} ms, {parts['ms_per_container']:.1f} ms for each "
            f"container, {parts['ms_per_kilopixel']:.3f} ms for a thousand pixels"
        )
        presets = {
            name: preset_ms(name, quality, size, options.scenes) for name in ("seafront", "gate")
        }
        ratio = presets["gate"]["ms"] / presets["seafront"]["ms"]
        print(
            f"  gate {presets['gate']['ms']:.1f} ms with {presets['gate']['containers']:.1f} "
            f"containers, seafront {presets['seafront']['ms']:.1f} ms: {ratio:.2f} times"
        )
        results[quality] = {**table, **parts, "presets": presets}
    save("containers", results)


if __name__ == "__main__":
    main()
