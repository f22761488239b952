"""Table of scenes and labels of 100 indices, which must not change by accident.

    python -m tests.stability.label_table

writes the table anew. Do this only for a change that is meant to alter scenes or labels, and name
the change in the changelog: datasets of an earlier version cannot be continued after it.
"""

import csv
import hashlib
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fastgen import Config, Generator

TABLE = Path(__file__).with_name("label_table.csv")
SIZE = (160, 160)
SEED = 2048
COUNTS = {"seafront": 76, "crane": 12, "gate": 4, "yard": 4, "quay": 4}
"""Number of indices by preset."""

SIGNIFICANT = 6
"""Digits of the numbers of scenes that are hashed. CPUs differ in the last of a double's 16."""

LABEL_DIGITS = 4
"""Digits of the numbers of labels, a tenth of a pixel. With six, CPUs disagreed in five rows."""


def rounded(value: Any, digits: int) -> Any:
    """Return JSON values with every number rounded to `digits`."""
    if isinstance(value, dict):
        return {key: rounded(each, digits) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(each, digits) for each in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


def digest(value: Any, digits: int = SIGNIFICANT) -> str:
    """Return a short hash of JSON values."""
    text = json.dumps(rounded(value, digits), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def rows() -> Iterator[dict[str, str | int]]:
    """Yield a row for each index.

    Labels that come from geometry alone are hashed. Pixels are counted, because rounding in a CPU's
    vector unit decides about pixels on an edge.
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
                    (item.id, item.class_name, item.instance, item.text, item.polygon, item.quad)
                    for item in sample.objects
                ]
                yield {
                    "preset": preset,
                    "index": index,
                    "camera": camera,
                    "scene": digest(json.loads(scene.to_json())),
                    "labels": digest(labels, LABEL_DIGITS),
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
