"""YOLO text labels, normalised to the image and clipped to it: trainers refuse values beyond 1."""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.sample import Box, Object, Sample


def detections(objects: Iterable[Object]) -> list[tuple[int, Object, Box]]:
    """Class, object and visible box of what is labelled in the marker task, ignored ones left out:
    the format cannot tell them from the rest."""
    return [
        (DETECTION_CLASSES.index(item.class_name), item, item.bbox)
        for item in objects
        if item.class_name in DETECTION_CLASSES and item.bbox is not None and not item.ignored
    ]


def normalised(box: Box, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Centre x, y, width and height of a pixel box as shares of an image of (width, height)."""
    (x0, y0, x1, y1), (width, height) = box, size
    return (x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height


def detection_lines(objects: Iterable[Object], size: tuple[int, int]) -> str:
    """A line for each of `detections`: class, box centre x, y, width, height."""
    found = detections(objects)
    return "".join(_line(index, normalised(box, size)) for index, _, box in found)


def segmentation_lines(sample: Sample) -> str:
    """A line an instance of the damage task: class and one polygon around all its parts.

    Holes cannot be told in this format and are filled; the PNG and COCO masks keep them.
    """
    height, width = sample.damage.shape
    lines = []
    for value in (0, *np.unique(sample.damage[sample.damage >= 200]).tolist()):
        mask = sample.damage == value if value else sample.damage > 0
        polygon = _outline(mask)
        if len(polygon) < 3:
            continue
        points = np.clip((polygon + 0.5) / (width, height), 0, 1)
        index = int(value) // 100 - 1 if value else 0
        assert index < len(SEGMENTATION_CLASSES)
        lines.append(_line(index, points.ravel().tolist()))
    return "".join(lines)


def _line(index: int, values: Iterable[float]) -> str:
    return f"{index} " + " ".join(f"{min(max(v, 0.0), 1.0):.6f}" for v in values) + "\n"


def _outline(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """One closed polygon [N, 2] of pixel indices around all parts of a mask.

    Parts are joined by a bridge between their nearest corners, there and back.
    """
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    parts = [cv2.approxPolyDP(c, 0.7, True)[:, 0].astype(np.float64) for c in found]
    parts = sorted((p for p in parts if len(p) > 2), key=len, reverse=True)
    if not parts:
        return np.zeros((0, 2))
    joined = parts[0]
    for part in parts[1:]:
        gap = np.linalg.norm(joined[:, None] - part[None], axis=-1)
        i, j = np.unravel_index(int(gap.argmin()), gap.shape)
        loop = np.concatenate([part[j:], part[: j + 1]])
        joined = np.concatenate([joined[: i + 1], loop, joined[i:]])
    return joined
