"""Measure how large and how visible the damages of whole scenes are in the images of all cameras.

    python bench/damage_views.py [--presets seafront gate] [--scenes 8] [--size 640x640]

Every container of a scene is damaged. Each image is drawn with and without the damages. A damage is
measured in the image where it has most visible pixels. It counts as shown from 100 pixels, and as
visible if these also change by 6 of 255 levels on average, twice the noise of a usual image. Scenes
are drawn for several values of `damage.toward_cameras`, without noise.

Writes bench/results/damage_views.json.
"""

import argparse
import os
import statistics
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

os.environ.setdefault("LP_NUM_THREADS", "0")  # one thread, like a worker of `fastgen generate`

import numpy as np
from reporting import origin, parse_size, save

from fastgen import Config, Generator
from fastgen.scene import Scene

SHOWN_PX = 100
"""Least visible pixels of a damage that counts as shown."""

VISIBLE_LEVELS = 6.0
"""Least mean change of a damage's pixels that people notice; twice the noise of a usual image."""

SHARES = (0.0, 0.5, 1.0)
"""Values of `damage.toward_cameras`."""


class Seen(NamedTuple):
    """A damage in the image that shows most of it.

    Attributes:
        kind: Its kind.
        area_px: Its visible pixels.
        levels: Their mean change by the damages, of 255 levels.
    """

    kind: str
    area_px: int
    levels: float


def damages_of(scene: Scene) -> list[str]:
    """Return the kinds of all damages of a scene."""
    carried = [scene.damages, *(each.damages for each in scene.neighbours)]
    return [damage.kind for damages in carried for damage in damages]


def seen_in(generator: Generator, scene: Scene) -> list[Seen]:
    """Return the damages of a scene that an image shows, each as in its best image."""
    whole = scene.undamaged()
    best: dict[int, Seen] = {}
    for camera in scene.cameras:
        damaged = generator.render(scene=scene, camera=camera.name)
        present = [int(each) for each in np.unique(damaged.damage) if each]
        if not present:
            continue
        without = generator.render(scene=whole, camera=camera.name)
        change = np.abs(damaged.image.astype(int) - without.image.astype(int)).mean(axis=-1)
        for item in damaged.objects:
            if item.id not in present or item.class_name not in generator.config.damage.kinds:
                continue
            mask = damaged.damage == item.id
            found = Seen(item.class_name, int(mask.sum()), float(change[mask].mean()))
            best[item.id] = max(best.get(item.id, found), found, key=lambda seen: seen.area_px)
    return list(best.values())


def measure(preset: str, share: float, size: tuple[int, int], scenes: int) -> dict[str, Any]:
    """Return the damages of scenes by kind: how many there are, and those that images show."""
    values = {
        "damage": {"probability": 1.0, "toward_cameras": share},
        "sensor": {"noise": {"probability": 0.0}},
        "placement": {"damaged": 1.0},
    }
    config = Config.from_values(values, base=Config.preset(preset))
    all_of: dict[str, int] = defaultdict(int)
    seen: dict[str, list[list[float]]] = defaultdict(list)
    with Generator(config, seed=8, size=size, quality="draft") as generator:
        for index in range(scenes):
            scene = generator.scene(index)
            for kind in damages_of(scene):
                all_of[kind] += 1
            for kind, area_px, levels in seen_in(generator, scene):
                seen[kind].append([area_px, round(levels, 1)])
    return {kind: {"damages": all_of[kind], "seen": seen[kind]} for kind in sorted(all_of)}


def rows(by_kind: dict[str, Any]) -> Iterator[str]:
    """Yield a line of text for all damages and for each kind."""
    total = {
        "damages": sum(each["damages"] for each in by_kind.values()),
        "seen": [one for each in by_kind.values() for one in each["seen"]],
    }
    for name, found in {"all": total, **by_kind}.items():
        shown = [(area, levels) for area, levels in found["seen"] if area >= SHOWN_PX]
        visible = sum(levels >= VISIBLE_LEVELS for _, levels in shown)
        line = (
            f"{name:12} {found['damages']:4d} damages, shown {len(shown) / found['damages']:4.0%}, "
            f"visible {visible / found['damages']:4.0%}"
        )
        if shown:
            area, levels = (statistics.median(column) for column in zip(*shown, strict=True))
            line += f"; medians of those shown: {area:6.0f} px, {levels:4.1f} levels"
        yield line


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print the tables, and write the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--presets", nargs="+", default=["seafront", "gate"])
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--scenes", type=int, default=8)
    options = parser.parse_args(argv)
    size = parse_size(options.size)
    results: dict[str, Any] = {**origin(), "size": options.size, "scenes": options.scenes}
    for preset in options.presets:
        results[preset] = {}
        for share in SHARES:
            found = measure(preset, share, size, options.scenes)
            results[preset][f"{share:g}"] = found
            print(f"{preset}, damage.toward_cameras {share:g}")
            print("\n".join(f"  {row}" for row in rows(found)), flush=True)
    save("damage_views", results)


if __name__ == "__main__":
    main()
