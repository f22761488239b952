"""YOLO label files: boxes and outlines as shares of the image, from 0 to 1.

A label is a line: the class index, then numbers. Values are clipped, because trainers refuse values
above 1.
"""

import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import ALL_DETECTION_CLASSES
from fastgen.formats import item
from fastgen.labels.visibility import mask_box, window
from fastgen.sample import Box, Object


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
        for thing, box in item.detections(objects)
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
    clipped = tuple([min(max(v, 0.0), 1.0) for v in values])
    # outlines have hundreds of values; one format string takes half the time of one per value
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
    # contours run through pixel centres; at twice the size they round to the pixels' outer edges
    seen = window(mask, box).view(np.uint8)
    quarters = cv2.resize(seen, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    found, _ = cv2.findContours(quarters, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    borders = [((contour + 1) // 2).astype(np.float32) for contour in found]
    parts = [cv2.approxPolyDP(each, 0.5, True)[:, 0].astype(np.float64) for each in borders]
    parts = sorted((part + box[:2] for part in parts), key=len, reverse=True)
    joined = parts[0]
    for part in parts[1:]:
        gap = np.linalg.norm(joined[:, None] - part[None], axis=-1)
        i, j = np.unravel_index(int(gap.argmin()), gap.shape)
        loop = np.concatenate([part[j:], part[: j + 1]])
        joined = np.concatenate([joined[: i + 1], loop, joined[i:]])
    return joined
