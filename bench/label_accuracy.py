"""Check that the labels are exact, and measure the cost of the paper's way to make them.

    python bench/label_accuracy.py [--scenes 100] [--size 256]
    python bench/label_accuracy.py --redraw     # docs/label_accuracy.png from the stored results

Compares ids, damage and depth with rays that Embree casts through every pixel centre, over random
scenes and difficult views. The rays hit the mesh deformed in numpy (tests/oracle.py). A pixel may
differ only within 0.01 px of an edge: some ray that close to its centre must see what our label
says. Scenes of the presets with several containers follow, without lens distortion: drawn edges are
straight, so it moves them by up to a third of a pixel.

Then makes the boxes of markers like the paper (3.3.3), with a binary mask render and connected
components for each marker, on the same scenes.
"""

import argparse
import os
import statistics
import sys
import textwrap
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).parent.parent))

import charts
import cv2
import numpy as np
from matplotlib.figure import Figure
from reporting import origin, save

from fastgen import Config, Generator
from fastgen.classes import MARKER_CLASSES
from fastgen.geometry.container import build_container
from fastgen.geometry.mesh import Mesh
from fastgen.scene import Camera, Decal, Scene
from tests import oracle_scene

EDGE_PX = 0.01
_AROUND = 24
SURROUNDED = ("gate", "yard", "quay")
"""Presets with several containers in a scene."""

COUNTS = (1, 2, 4, 8, 16, 32)


def hard_cameras(scene: Scene, mesh: Mesh) -> Iterator[Camera]:
    """Yield difficult views of a container.

    They graze along a wall, show markers of a few pixels, put the wall through the near plane, and
    cut a marker at the image border.
    """
    low, high = mesh.bounds_mm
    x, y, z = float(high[0]), float(low[1]), float(high[2])
    yield Camera("grazing", (x + 1500, y - 130, z / 2), (-x, y + 150, z / 2), 28.0)
    yield Camera("far", (2000, y - 45000, 3000), (0, y, z / 2), 20.0)
    yield Camera("near plane", (0, y - 105, z / 2), (1500, y, z / 2), 14.0)
    decals = [d for d in scene.decals if d.class_name and d.face == "front"]
    for decal in decals[:1]:
        (px, py, pz), *_ = mesh.sheet_to_surface("front", decal.center_mm)[0]
        yield Camera("cut", (px + 900, py - 2000, pz), (px + 900, py, pz), 40.0)


def differences(generator: Generator, scene: Scene, camera: Camera) -> Counter[str]:
    """Compare a view with ray casting.

    Returns:
        Counts of compared pixels, pixels with different labels or depth, and differences that no
        edge explains.
    """
    sample = generator.render(scene=scene, camera=camera)
    threshold = generator.config.damage.mask_threshold_mm

    def truth(pixels: np.ndarray | None = None) -> np.ndarray:
        found = oracle_scene.truth(scene, sample.view, threshold, pixels)
        seen = np.isfinite(found.depth_m)
        depth = np.where(seen, np.rint(np.where(seen, found.depth_m, 0) * 1e4), -1)
        return np.stack([found.ids, found.damage, depth.astype(np.int64)], axis=-1)

    found = truth()
    labels = (sample.ids != found[..., 0]) | (sample.damage != found[..., 1])
    depth_m = np.where(found[..., 2] < 0, np.inf, found[..., 2] / 1e4)
    both = np.isfinite(depth_m) & np.isfinite(sample.depth)
    gap = np.abs(np.where(both, sample.depth, 0) - np.where(both, depth_m, 0))
    deep = both & (gap > np.maximum(1e-3, 1e-3 * np.where(both, depth_m, 0)))
    rows, columns = np.nonzero(labels | deep)
    unexplained = 0
    if rows.size:
        turn = np.arange(_AROUND) * 2 * np.pi / _AROUND
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * EDGE_PX
        # circles of several radii, because slivers of cables are thinner than the largest
        around = np.concatenate([circle * share for share in (0.125, 0.25, 0.5, 1.0)])
        centers = np.stack([columns, rows], axis=-1) + 0.5
        # our label must be among those of the rays within EDGE_PX
        near = truth(np.concatenate([centers[:, None], centers[:, None] + around], axis=1))
        ours = np.stack([sample.ids[rows, columns], sample.damage[rows, columns]], axis=-1)
        known = (near[..., :2] == ours[:, None]).all(axis=2).any(axis=1)
        reach = np.where(near[..., 2] < 0, np.inf, near[..., 2] / 1e4)
        depth_here = sample.depth[rows, columns]
        slack = np.maximum(1e-3, 1e-3 * np.where(np.isfinite(depth_here), depth_here, 0))
        known &= (depth_here >= reach.min(axis=1) - slack) & (
            depth_here <= reach.max(axis=1) + slack
        )
        unexplained = int((~known).sum())
        for row, column in zip(rows[~known], columns[~known], strict=True):
            print(f"unexplained: scene {scene.index}, camera {camera.name}, pixel {column}, {row}")
    return Counter(
        pixels=labels.size,
        labels=int(labels.sum()),
        depth=int(deep.sum()),
        unexplained=unexplained,
    )


def exactness(scenes: int, side: int) -> dict[str, Counter[str]]:
    """Count and print the differences by kind of view, over random scenes."""
    config = Config.from_values({"damage": {"probability": 0.5}})
    totals: dict[str, Counter[str]] = {}
    with Generator(config, seed=2024, size=(side, side)) as generator:
        for index in range(scenes):
            scene = generator.scene(index)
            mesh = build_container(scene.container.kind, scene.container.profiles)
            cameras = list(scene.cameras)
            if index < max(scenes // 10, 4):
                cameras += hard_cameras(scene, mesh)
            for camera in cameras:
                name = "rig" if camera in scene.cameras else camera.name
                totals.setdefault(name, Counter()).update(differences(generator, scene, camera))
    for preset in SURROUNDED:
        with Generator(Config.preset(preset), seed=2024, size=(side, side)) as generator:
            for index in range(max(scenes // 5, 1)):
                scene = generator.scene(index)
                for camera in scene.cameras:
                    straight = replace(camera, lens=None)
                    totals.setdefault(preset, Counter()).update(
                        differences(generator, scene, straight)
                    )
    print(
        f"{'views':12}{'pixels':>12}{'labels differ':>15}{'depth differs':>15}{'unexplained':>13}"
    )
    for name, t in totals.items():
        print(f"{name:12}{t['pixels']:12d}{t['labels']:15d}{t['depth']:15d}{t['unexplained']:13d}")
    return totals


def with_markers(scene: Scene, count: int) -> Scene:
    """Return `scene` with `count` touching markers on its door and no other decals or damage."""
    decals = []
    for i in range(count):
        row, column = divmod(i, 8)
        name = MARKER_CLASSES[i % len(MARKER_CLASSES)]
        center = (260 + column * 240 + 120 * (row % 2), 300 + row * 240)
        decals.append(Decal("marker", name, "door", center, (250, 250), art=name))
    return replace(scene, decals=tuple(decals), damages=())


def masks_one_by_one(
    generator: Generator, scene: Scene, camera: str
) -> list[list[tuple[int, ...]]]:
    """Render each marker alone as a binary mask, like the paper; return its components' boxes."""
    found: list[list[tuple[int, ...]]] = []
    for decal in (d for d in scene.decals if d.kind == "marker"):
        alone = replace(scene, decals=(decal,))
        mask = (generator.render(scene=alone, camera=camera, layer="decals").ids >= 2).astype("u1")
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        found.append([(int(x), int(y), int(x + w), int(y + h)) for x, y, w, h, _ in stats[1:]])
    return found


def against_the_paper(scenes: int) -> dict[str, Any]:
    """Compare time and boxes with the paper's way; print and return the results."""
    ours: dict[str, float] = {}
    theirs: dict[str, float] = {}
    with Generator(Config.preset(), seed=5, size=(640, 640)) as generator:
        bases = [generator.scene(i) for i in range(3)]
        for count in COUNTS:
            views = [with_markers(base, count) for base in bases]
            taken: dict[str, list[float]] = {"ours": [], "theirs": []}
            for view in views * 3:
                began = time.perf_counter()
                generator.render(scene=view, camera="Cr")
                middle = time.perf_counter()
                masks_one_by_one(generator, view, "Cr")
                taken["ours"].append(middle - began)
                taken["theirs"].append(time.perf_counter() - began)
            ours[str(count)] = statistics.median(taken["ours"]) * 1e3
            theirs[str(count)] = statistics.median(taken["theirs"]) * 1e3
    print(f"\n{'markers':>8}{'one draw, ms':>14}{'draw per marker, ms':>21}")
    for count in COUNTS:
        print(f"{count:8d}{ours[str(count)]:14.1f}{theirs[str(count)]:21.1f}")
    outcomes = component_outcomes(scenes)
    total = sum(outcomes.values())
    print(f"\nboxes from connected components, {total} visible markers in {scenes} scenes")
    for name, number in outcomes.most_common():
        print(f"{name:34}{number:7d}  {number / total:.2%}")
    return {"one_draw_ms": ours, "a_draw_a_marker_ms": theirs, "components": outcomes}


def component_outcomes(scenes: int) -> Counter[str]:
    """Count for how many visible markers the largest component has the correct box, at 640x640."""
    outcomes: Counter[str] = Counter()
    with Generator(Config.preset(), seed=77, size=(640, 640)) as generator:
        for index in range(scenes):
            for camera in generator.config.cameras:
                sample = generator.render(index=index, camera=camera)
                for item in sample.objects:
                    if item.class_name not in MARKER_CLASSES or item.bbox is None:
                        continue
                    mask = (sample.ids == item.id).astype(np.uint8)
                    _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
                    x, y, w, h, _ = max(stats[1:], key=lambda row: row[4])
                    if (x, y, x + w, y + h) == item.bbox:
                        outcomes["right"] += 1
                    else:
                        outcomes["split, the largest part's box"] += 1
    return outcomes


def draw(figures: charts.Figures) -> Figure:
    """Return a chart of the time against the number of markers, and of correct boxes."""
    figure, (left, right) = charts.panels(1, 2, 3.0, width_ratios=(3, 2))
    for key, mark, name in (
        ("one_draw_ms", "o-", "ids in the same draw"),
        ("a_draw_a_marker_ms", "s-", "one mask render per marker"),
    ):
        left.plot(
            [int(count) for count in figures[key]], list(figures[key].values()), mark, label=name
        )
    left.set(xlabel="markers in the image", ylabel="ms per image, 640x640")
    left.set_ylim(0, 1.35 * left.get_ylim()[1])  # room for the legend
    left.legend(loc="upper left")
    total = sum(figures["components"].values())
    names = [textwrap.fill(name, 14) for name in figures["components"]]
    shares = [100 * count / total for count in figures["components"].values()]
    bars = right.barh(names, shares, height=0.5)
    right.bar_label(bars, fmt="%.0f %%", padding=3)
    right.set(title="boxes from connected components", xlabel="% of visible markers", xlim=(0, 100))
    charts.caption(figure, figures, f"{figures['scenes']} scenes")
    return figure


def main() -> None:
    """Print both comparisons and draw the chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--size", type=int, default=256)
    charts.add_options(parser, "label_accuracy")
    options = parser.parse_args()
    if charts.redrawn(options, "label_accuracy", draw):
        return
    counts = exactness(options.scenes, options.size)
    ways = against_the_paper(max(options.scenes // 10, 2))
    settings = {"scenes": options.scenes, "size": options.size}
    figures = {**origin(), **settings, "views": counts, **ways}
    save("label_accuracy", figures)
    charts.write(draw(figures), options.chart)


if __name__ == "__main__":
    main()
