"""Table of scenes and labels of 100 indices, which must not change by accident.

    python -m tests.stability.label_table

writes the table anew. Do this only for a change that is meant to alter scenes or labels, and name
the change in the changelog: datasets of an earlier version cannot be continued after it.
"""

import csv
import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fastgen import Config, Generator
from fastgen.sample import Object

TABLE = Path(__file__).with_name("label_table.csv")
SIZE = (160, 160)
SEED = 2048
COUNTS = {"seafront": 76, "crane": 12, "gate": 4, "yard": 4, "quay": 4}
"""Number of indices by preset."""

SIGNIFICANT = 6
"""Digits of the numbers of scenes that are hashed. CPUs differ in the last of a double's 16."""


def rounded(value: Any) -> Any:
    """Return JSON values with every number rounded to SIGNIFICANT digits."""
    if isinstance(value, dict):
        return {key: rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(each) for each in value]
    return float(f"{value:.{SIGNIFICANT}g}") if isinstance(value, float) else value


def digest(value: Any) -> str:
    """Return a short hash of JSON values."""
    text = json.dumps(rounded(value), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def measures(item: Object) -> list[float]:
    """Return the coordinates of the quad, and the bounds and the size of the outline, in pixels.

    A CPU may drop or keep an outline's point on a straight line, which changes none of these.
    """
    quad = [] if item.quad is None else np.ravel(item.quad).tolist()
    points = np.reshape(item.polygon, (-1, 2))
    if not len(points):
        return quad
    x, y = points.T
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    return [*quad, *points.min(axis=0).tolist(), *points.max(axis=0).tolist(), float(area**0.5)]


def weighted_sum(values: Sequence[float]) -> float:
    """Return a sum of values whose weights, from 1 to 2, differ from value to value.

    It changes at least as much as a single value that changes. Unlike a hash of rounded values, it
    hardly changes with their last digits.
    """
    weights = 1 + np.modf(np.arange(1, len(values) + 1) * 0.618034)[0]
    return float(weights @ np.asarray(values, float))


def rows() -> Iterator[dict[str, str | int | float]]:
    """Yield a row for each index.

    What the labels name is hashed, and their coordinates are summed. Pixels are counted, because
    rounding in a CPU's vector unit decides about pixels on an edge.
    """
    for preset, count in COUNTS.items():
        with Generator(Config.preset(preset), seed=SEED, size=SIZE, quality="draft") as generator:
            for index in range(count):
                scene = generator.scene(index)
                camera = scene.cameras[index % len(scene.cameras)].name
                # labels do not depend on light, and preparing that of one place is enough
                light = replace(scene.environment, name="sky", yaw_deg=0.0)
                sample = generator.render(scene=replace(scene, environment=light), camera=camera)
                labels = [
                    (item.id, item.class_name, item.instance, item.text) for item in sample.objects
                ]
                places = [value for item in sample.objects for value in measures(item)]
                yield {
                    "preset": preset,
                    "index": index,
                    "camera": camera,
                    "scene": digest(json.loads(scene.to_json())),
                    "labels": digest(labels),
                    "places_px": round(weighted_sum(places), 3),
                    "object_px": int(np.count_nonzero(sample.ids)),
                    "damage_px": int(np.count_nonzero(sample.damage > 200)),
                }


def main() -> None:
    """Write the table."""
    found = list(rows())
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(found[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)
    print(f"wrote {len(found)} rows to {TABLE}")


if __name__ == "__main__":
    main()
