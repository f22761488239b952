"""Measure what damages cost, and how much each form of damage changes its pixels.

    python bench/damages.py [--quality draft balanced] [--scenes 40] [--size 640x640]

Cost: scenes of the preset `seafront` with 1 to 4 damages are drawn with and without them. A ratio
is the CPU time of one process with damages divided by that without, each the fastest of three
renders that take turns.

Change: one damage of a scene of the preset `crane` is drawn alone, from a camera that looks at it
from nearby or from farther away, and the same image without it. The change is the mean difference
of the pixels of the mask, of 255 levels. A damage counts as visible from 6 levels: twice the noise
of a usual image. Scenes in daylight and at night are listed apart.

Writes bench/results/damages.json.
"""

import argparse
import os
import statistics
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")  # one thread, like a worker of `fastgen generate`

import numpy as np
from aimed_cameras import aimed
from reporting import origin, parse_size, save

from fastgen import Config, Generator
from fastgen.classes import ALL_DAMAGE_CLASSES
from fastgen.errors import ConfigError
from fastgen.sampling.streams import stream
from fastgen.scene import Camera, Damage, Scene

VISIBLE_LEVELS = 6.0
"""Least mean change of a damage's pixels that people notice; twice the noise of a usual image."""

WIDTHS = {"near": 2.0, "far": 5.0}
"""Width of the view in lengths of the damage."""

LIGHTS = {"day": ("port_noon", "port_afternoon", "sky"), "night": ("port_night",)}


def pairs(generator: Generator, scenes: int) -> Any:
    """Yield scenes with one damage on a wall, a distance's name, and a camera."""
    for index in range(scenes):
        scene = generator.scene(index)
        walls = [d for d in scene.damages if d.face in ("front", "back", "door", "no_door")]
        for damage in walls:
            alone = replace(scene, damages=(damage,))
            rng = stream(5, index, "view")
            for name, width in WIDTHS.items():
                extent = min(max(damage.size_mm), 2000.0) * width
                yield (
                    alone,
                    damage,
                    name,
                    aimed(alone, damage.face, np.array(damage.origin_mm), extent, rng),
                )


def times_ms(
    generator: Generator, scenes: Sequence[Scene], camera: Camera | str, repeats: int = 3
) -> list[float]:
    """Return the fastest CPU time of each scene in ms; the scenes take turns."""
    taken = [[np.inf] for _ in scenes]
    for repeat in range(repeats + 1):
        for scene, found in zip(scenes, taken, strict=True):
            began = time.process_time()
            generator.render(scene=scene, camera=camera)
            if repeat:
                found.append(time.process_time() - began)
    return [1e3 * min(each) for each in taken]


def change(generator: Generator, scene: Scene, damage: Damage, camera: Camera) -> float | None:
    """Return the mean change of a damage's pixels in levels, None if it shows too few."""
    with_it = generator.render(scene=scene, camera=camera)
    item = next(o for o in with_it.objects if o.class_name == damage.kind)
    if item.area < 60:
        return None
    without = generator.render(scene=scene.undamaged(), camera=camera)
    mask = with_it.damage == item.id
    difference = with_it.image[mask].astype(int) - without.image[mask].astype(int)
    return float(np.abs(difference).mean())


def changes(size: tuple[int, int], scenes: int) -> dict[str, dict[str, list[float]]]:
    """Return the changes by form and by light and distance."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for light, names in LIGHTS.items():
        values = {
            "damage": {"probability": 1.0, "count": [4, 8], "kinds": list(ALL_DAMAGE_CLASSES)},
            "environment": {"names": list(names)},
            "sensor": {"noise": {"probability": 0.0}},
        }
        config = Config.from_values(values, base=Config.preset("crane"))
        with Generator(config, seed=5, size=size) as generator:
            for scene, damage, distance, camera in pairs(generator, scenes):
                try:
                    levels = change(generator, scene, damage, camera)
                except ConfigError:
                    continue  # the camera would be in the spreader
                if levels is not None:
                    found[f"{damage.kind} {damage.form}"][f"{light}, {distance}"].append(levels)
    return {form: dict(by_view) for form, by_view in sorted(found.items())}


def cost(quality: str, size: tuple[int, int], scenes: int) -> dict[str, float]:
    """Return the ratio of CPU times of damaged to undamaged images of the preset `seafront`."""
    config = Config.from_values({"damage": {"probability": 1.0}})
    ratios, damaged_ms = [], []
    with Generator(config, seed=6, size=size, quality=quality) as generator:
        for index in range(scenes):
            scene = generator.scene(index)
            whole = scene.undamaged()
            for camera in scene.cameras:
                damaged, undamaged = times_ms(generator, (scene, whole), camera.name)
                ratios.append(damaged / undamaged)
                damaged_ms.append(damaged)
    return {
        "ratio": statistics.median(ratios),
        "mean_ratio": statistics.mean(ratios),
        "most": max(ratios),
        "ms": statistics.median(damaged_ms),
    }


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print the tables, and write the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quality", nargs="+", default=["draft", "balanced"])
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--scenes", type=int, default=40, help="at least 4")
    options = parser.parse_args(argv)
    if options.scenes < 4:
        parser.error(f"--scenes: {options.scenes} is too few; give at least 4")
    size = parse_size(options.size)
    results: dict[str, Any] = {**origin(), "size": options.size}
    results["cost"] = {q: cost(q, size, options.scenes // 4) for q in options.quality}
    for quality, found in results["cost"].items():
        print(
            f"{quality}: a damaged image takes {found['ratio']:.2f} times as long as an undamaged "
            f"one (mean {found['mean_ratio']:.2f}, at most {found['most']:.2f})"
        )
    results["levels"] = changes(size, options.scenes)
    print(
        f"share of damages that change their pixels by at least {VISIBLE_LEVELS:g} levels; median"
    )
    for form, by_view in results["levels"].items():
        cells = [
            f"{view} {np.mean(np.array(each) >= VISIBLE_LEVELS):4.0%} of {len(each):2d}, "
            f"{statistics.median(each):4.1f}"
            for view, each in by_view.items()
        ]
        print(f"{form:26}" + "   ".join(cells))
    save("damages", results)


if __name__ == "__main__":
    main()
