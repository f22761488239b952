"""YOLO folders and label files: boxes, outlines and points as shares of the image, from 0 to 1.

A label is a line: the class index, then numbers. Values are clipped, because trainers refuse values
above 1.

Each task has a folder with `images`, `labels`, `data.yaml` and `classes.txt`. Trainers find the
labels of an image by replacing `images` by `labels` in its resolved path, so each task needs image
files of its own. They are hard links: they take no space, and unlike symbolic links they resolve to
the task's folder. Object stores have no links and no trainer reads YOLO folders there, so these
files are left out; the dataset's `images` can be linked into the task's folder after download.
"""

import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import ALL_DETECTION_CLASSES
from fastgen.formats.format import DatasetFiles, Files, Same
from fastgen.formats.item import Item
from fastgen.formats.item import detections as visible_detections
from fastgen.formats.outlines import borders, joined
from fastgen.labels.visibility import mask_box, window
from fastgen.sample import Box, Object


def files(task: str, item: Item, lines: str) -> Files:
    """Return the image and the label file of one sample in a task's folder."""
    name = f"{item.split}/{item.stem}"
    return {
        f"{task}/images/{name}.jpg": Same(item.image_path, link_only=True),
        f"{task}/labels/{name}.txt": lines.encode(),
    }


def task_files(
    task: str, classes: Sequence[str], splits: Sequence[str], more: str = ""
) -> DatasetFiles:
    """Yield data.yaml and classes.txt of a task's folder.

    Args:
        task: Name of the folder.
        classes: Class names in order.
        splits: Splits that have images, at least one.
        more: Further lines of data.yaml.
    """
    # Ultralytics needs both `train` and `val`, and stops at an empty folder
    folders = {"train": splits[0], "val": splits[-1], **{each: each for each in splits}}
    lines = [f"{key}: images/{folder}\n" for key, folder in folders.items()]
    lines += [f"nc: {len(classes)}\n", more, "names:\n"]
    lines += [f"  {number}: {name}\n" for number, name in enumerate(classes)]
    # without the key `path`, trainers take folders relative to this file
    yield f"{task}/data.yaml", lines
    yield f"{task}/classes.txt", [f"{name}\n" for name in classes]


def detections(
    objects: Iterable[Object], classes: Sequence[str] = ALL_DETECTION_CLASSES
) -> list[tuple[int, Object, Box]]:
    """Return class index, object and visible box of the objects that the marker task labels.

    Ignored objects are not included, because YOLO files cannot mark them.

    Args:
        objects: Objects of one image.
        classes: Class names in label order, see Sample.marker_classes.
    """
    numbers = {name: number for number, name in enumerate(classes)}
    return [
        (numbers[thing.class_name], thing, box)
        for thing, box in visible_detections(objects)
        if not thing.ignored
    ]


def normalised(box: Box, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Return centre x, y, width and height of a pixel box as shares of the image.

    Args:
        box: (x0, y0, x1, y1) in pixels.
        size: (width, height) of the image.
    """
    (x0, y0, x1, y1), (width, height) = box, size
    return (x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height


def pixel_box(values: Sequence[float], size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Return the pixel box (x0, y0, x1, y1) of a normalised box; the inverse of `normalised`."""
    (x, y, w, h), (width, height) = values, size
    return (x - w / 2) * width, (y - h / 2) * height, (x + w / 2) * width, (y + h / 2) * height


def detection_lines(
    objects: Iterable[Object],
    size: tuple[int, int],
    classes: Sequence[str] = ALL_DETECTION_CLASSES,
) -> str:
    """Return the label file of an image of this size, with a line for each of `detections`."""
    found = detections(objects, classes)
    return "".join(line(index, normalised(box, size)) for index, _, box in found)


def line(index: int, values: Iterable[float]) -> str:
    """Return one label: class index, then the values clipped to 0..1."""
    # outlines have hundreds of values; min and max take four times as long
    clipped = tuple([0.0 if v < 0.0 else 1.0 if v > 1.0 else v for v in values])
    # one format string takes half the time of one per value
    return f"{index}{' %.6f' * len(clipped)}\n" % clipped


def rows(text: str) -> list[tuple[int, list[float]]]:
    """Parse a label file into class index and values of each line.

    Raises:
        ValueError: The text is not a label file.
    """
    lines = [each.split() for each in text.splitlines()]
    return [(int(index), [float(v) for v in values]) for index, *values in lines]


def finite_rows(text: bytes) -> list[tuple[int, list[float]]]:
    """Parse a label file as `rows` does, and check that its values can be drawn.

    Raises:
        ValueError: The file is not a label file, or has negative classes or infinite values.
    """
    found = rows(text.decode())
    if any(index < 0 or not all(map(math.isfinite, numbers)) for index, numbers in found):
        raise ValueError("not a YOLO label file")
    return found


def outline(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return one closed polygon around all parts of a mask, along the outer edges of its pixels.

    Parts are joined by a bridge of zero width between their nearest corners. Holes are filled,
    because one polygon cannot have holes.

    Args:
        mask: bool [H, W].

    Returns:
        Corners float64 [N, 2] as x, y in pixels; N is 0 for an empty mask.
    """
    box = mask_box(mask)
    if box is None:
        return np.zeros((0, 2))
    parts = [
        cv2.approxPolyDP(outer.astype(np.float32)[:, None], 0.5, True)[:, 0].astype(np.float64)
        for outer, *_ in borders(window(mask, box), holes=False)
    ]
    return joined(sorted(parts, key=len, reverse=True)) + box[:2]
