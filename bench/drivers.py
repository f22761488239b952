"""How alike two datasets are that different drivers made with the same settings.

    python bench/drivers.py ONE OTHER

Both are folders of `fastgen generate` with the same options, for example one made by a GPU and one
by Mesa's rasterizer. Prints how far apart pictures, damage masks, boxes and texts are.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

TASKS = ("container", "imdg", "damage")  # those with boxes in COCO's format
SETTINGS = ("version", "seed", "size", "quality", "cameras", "config", "images")
FAR = 16
"""Steps of 255 by which a pixel is off that one would see."""


def pairs(one: Path, other: Path, pattern: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pictures of the same name; of what is in one alone, the other's is black."""
    names = {path.relative_to(folder) for folder in (one, other) for path in folder.glob(pattern)}
    for name in sorted(names):
        read = [cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED) for folder in (one, other)]
        found = [image for image in read if image is not None]
        if not found:
            raise SystemExit(f"{one / name}: is no picture; see fastgen verify {one}")
        first, second = (np.zeros_like(found[0]) if image is None else image for image in read)
        yield first, second


def boxes(folder: Path, task: str) -> dict[tuple[str, int, int], np.ndarray]:
    """Edges (left, top, right, bottom) by picture, class, and place in the order of these: where
    one is missing, those after it are taken for others."""
    found: dict[tuple[str, int, int], np.ndarray] = {}
    for path in sorted((folder / task).glob("coco_*.json")):
        coco = json.loads(path.read_text(encoding="utf-8"))
        names = {image["id"]: image["file_name"] for image in coco["images"]}
        seen: Counter[tuple[str, int]] = Counter()
        for item in coco["annotations"]:
            key = names[item["image_id"]], item["category_id"]
            x, y, width, height = item["bbox"]
            found[*key, seen[key]] = np.array([x, y, x + width, y + height])
            seen[key] += 1
    return found


def texts(folder: Path) -> set[str]:
    """Lines of all text labels."""
    files = folder.glob("text/*/labels.txt")
    return {line for path in files for line in path.read_text(encoding="utf-8").splitlines()}


def main() -> None:
    """Print a line for each kind of content."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("one", type=Path)
    parser.add_argument("other", type=Path)
    options = parser.parse_args()
    folders = options.one, options.other
    made = [json.loads((folder / "dataset.json").read_text(encoding="utf-8")) for folder in folders]
    unlike = [name for name in SETTINGS if made[0][name] != made[1][name]]
    if unlike:
        raise SystemExit(f"{options.one} and {options.other}: differ in {', '.join(unlike)}")
    for folder, settings in zip(folders, made, strict=True):
        print(f"{folder}: {settings['images']} images, {settings['renderer']}")
    apart = [
        np.abs(np.subtract(one, other, dtype=np.int16))
        for one, other in pairs(*folders, "images/*/*")
    ]
    mean = np.mean([image.mean() for image in apart])
    far = np.mean([(image.max(axis=-1) > FAR).mean() for image in apart])
    print(f"pictures: {mean:.2f} of 255 apart, {1e6 * far:.0f} in a million pixels by over {FAR}")
    masks = list(pairs(*folders, "damage/masks/*/*"))
    differing = sum(int((one != other).sum()) for one, other in masks)
    labelled = sum(int((one > 0).sum()) for one, _ in masks)
    print(f"damage masks: {differing} pixels differ, of {labelled} that show the container")
    for task in TASKS:
        first, second = (boxes(folder, task) for folder in folders)
        steps = [np.abs(first[key] - second[key]).max() for key in first.keys() & second.keys()]
        alike = sum(step == 0 for step in steps)
        alone = len(first.keys() ^ second.keys())
        print(
            f"{task}: {len(steps)} boxes, {alike} the same, the others by up to "
            f"{max(steps, default=0):g} pixels; in one alone {alone}"
        )
    said, written = (texts(folder) for folder in folders)
    print(f"texts: {len(said & written)} the same, in one alone {len(said ^ written)}")


if __name__ == "__main__":
    main()
