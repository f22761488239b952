"""YOLO text labels, normalised to the image and clipped to it: trainers refuse values beyond 1."""

import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen import formats
from fastgen.classes import DETECTION_CLASSES
from fastgen.labels.visibility import mask_box, window
from fastgen.sample import Box, Object


def detections(objects: Iterable[Object]) -> list[tuple[int, Object, Box]]:
    """Class, object and visible box of formats.detections, ignored ones left out: the format cannot
    tell them from the rest."""
    return [
        (DETECTION_CLASSES.index(item.class_name), item, box)
        for item, box in formats.detections(objects)
        if not item.ignored
    ]


def normalised(box: Box, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Centre x, y, width and height of a pixel box as shares of an image of (width, height)."""
    (x0, y0, x1, y1), (width, height) = box, size
    return (x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height


def pixel_box(values: Sequence[float], size: tuple[int, int]) -> tuple[float, float, float, float]:
    """The pixel box (x0, y0, x1, y1) of what `normalised` gave: its inverse."""
    (x, y, w, h), (width, height) = values, size
    return (x - w / 2) * width, (y - h / 2) * height, (x + w / 2) * width, (y + h / 2) * height


def detection_lines(objects: Iterable[Object], size: tuple[int, int]) -> str:
    """A line for each of `detections`: class, box centre x, y, width, height."""
    found = detections(objects)
    return "".join(line(index, normalised(box, size)) for index, _, box in found)


def line(index: int, values: Iterable[float]) -> str:
    """One label: class, then numbers clipped to 0..1."""
    clipped = tuple([min(max(v, 0.0), 1.0) for v in values])
    # outlines have hundreds: one format for all of them takes half the time of one each
    return f"{index}{' %.6f' * len(clipped)}\n" % clipped


def rows(text: str) -> list[tuple[int, list[float]]]:
    """Class and numbers of each `line` of a file. Raises ValueError for text that is none."""
    lines = [each.split() for each in text.splitlines()]
    return [(int(index), [float(v) for v in values]) for index, *values in lines]


def finite_rows(text: bytes) -> list[tuple[int, list[float]]]:
    """Return `rows` of a file. Raises ValueError for negative classes and infinite numbers."""
    found = rows(text.decode())
    if any(index < 0 or not all(map(math.isfinite, numbers)) for index, numbers in found):
        raise ValueError("not a YOLO label file")
    return found


def outline(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """One closed polygon [N, 2] along the pixels' outer borders, around all parts of a mask.

    Parts are joined by a bridge between their nearest corners, there and back. Holes cannot be told
    in a polygon and are filled.
    """
    box = mask_box(mask)
    if box is None:
        return np.zeros((0, 2))
    # with pixels cut in four, contours run through quarters at the border, whose outer edge is it
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
