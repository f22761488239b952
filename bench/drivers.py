"""Compare two datasets made by different drivers with the same settings.

    python bench/drivers.py ONE OTHER

Both are folders written by `fastgen generate` with the same options, for example one on a GPU and
one with Mesa's software rasterizer. Prints the differences of images, damage masks, boxes and
texts.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import reporting  # noqa: F401 makes the fastgen of this checkout importable

from fastgen.dataset.verify import examine
from fastgen.errors import FastgenError

TASKS = ("container", "imdg", "damage")  # the tasks with boxes in COCO format
SETTINGS = ("version", "seed", "size", "quality", "cameras", "environments", "config", "images")
FAR = 16
"""Visible difference of a pixel, in steps of 255."""


def checked(one: Path, other: Path) -> list[dict[str, Any]]:
    """Return the contents of both dataset.json files.

    Raises:
        SystemExit: A dataset is incomplete, or the two were made with different settings.
    """
    made = []
    for folder in (one, other):
        try:
            found = examine(str(folder))
        except FastgenError as error:
            raise SystemExit(str(error)) from None
        if found.faults:
            raise SystemExit(f"{folder}: {found.faults[0]}")
        if found.manifest["format"] != "seafront":
            raise SystemExit(f"{folder}: contains tar files; make it with --format seafront")
        made.append(found.manifest)
    unlike = [name for name in SETTINGS if made[0][name] != made[1][name]]
    if unlike:
        raise SystemExit(f"{one} and {other} differ in these settings: {', '.join(unlike)}")
    return made


def pairs(one: Path, other: Path, pattern: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the images with the same name in both folders."""
    for path in sorted(one.glob(pattern)):
        yield iio.imread(path), iio.imread(other / path.relative_to(one))


def boxes(folder: Path, task: str) -> dict[tuple[str, int, int], np.ndarray]:
    """Return the box edges (left, top, right, bottom) of a task.

    The key is the image, the class, and a running number within both. If one dataset lacks a box,
    the boxes after it are compared with the wrong ones. Container boxes are in every task and count
    only for the task `container`.
    """
    found: dict[tuple[str, int, int], np.ndarray] = {}
    for path in sorted((folder / task).glob("coco_*.json")):
        coco = json.loads(path.read_text(encoding="utf-8"))
        names = {image["id"]: image["file_name"] for image in coco["images"]}
        seen: Counter[tuple[str, int]] = Counter()
        for item in coco["annotations"]:
            if item["category_id"] == 1 and task != "container":
                continue
            key = names[item["image_id"]], item["category_id"]
            x, y, width, height = item["bbox"]
            found[*key, seen[key]] = np.array([x, y, x + width, y + height])
            seen[key] += 1
    return found


def texts(folder: Path) -> set[str]:
    """Return the lines of all text labels."""
    files = folder.glob("text/*/labels.txt")
    return {line for path in files for line in path.read_text(encoding="utf-8").splitlines()}


def main() -> None:
    """Print a line per kind of content."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("one", type=Path, help="folder of a dataset")
    parser.add_argument("other", type=Path, help="folder of the other driver's dataset")
    options = parser.parse_args()
    folders = options.one, options.other
    for folder, made in zip(folders, checked(*folders), strict=True):
        print(f"{folder}: {made['images']} images, {made['backend']} {made['renderer']}")
    apart = [
        np.abs(np.subtract(one, other, dtype=np.int16))
        for one, other in pairs(*folders, "images/*/*")
    ]
    mean = np.mean([image.mean() for image in apart])
    far = np.mean([(image.max(axis=-1) > FAR).mean() for image in apart])
    print(
        f"images: mean difference {mean:.2f} of 255; "
        f"{1e6 * far:.0f} pixels per million differ by more than {FAR}"
    )
    masks = list(pairs(*folders, "damage/masks/*/*"))
    differing = sum(int((one != other).sum()) for one, other in masks)
    labelled = sum(int((one > 0).sum()) for one, _ in masks)
    print(f"damage masks: {differing} pixels differ; {labelled} show the container")
    for task in TASKS:
        first, second = (boxes(folder, task) for folder in folders)
        steps = [np.abs(first[key] - second[key]).max() for key in first.keys() & second.keys()]
        moved = [step for step in steps if step > 0]
        alone = len(first.keys() ^ second.keys())
        print(
            f"{task}: {len(moved)} of {len(steps)} boxes differ, by up to "
            f"{max(moved, default=0):g} pixels; {alone} are in only one dataset"
        )
    said, written = (texts(folder) for folder in folders)
    print(f"texts: {len(said & written)} are the same, {len(said ^ written)} in only one dataset")


if __name__ == "__main__":
    main()
