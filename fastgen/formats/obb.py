"""Oriented boxes of texts and markers, as a folder for YOLO.

A label is the class index and the four corners of the whole print. If the image cuts the print, the
label is the smallest rectangle around the part inside, because trainers refuse points outside.
"""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.config.config import Config
from fastgen.formats import yolo
from fastgen.formats.format import DatasetFiles, Files, Format
from fastgen.formats.item import Item
from fastgen.sample import Box, Object


def oriented_box(thing: Object, box: Box, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the corners [4, 2] of a print in pixels, inside the image.

    Args:
        thing: A text or marker.
        box: Its visible box. A print that is partly behind the camera has no corners, so the
            corners of this box are returned.
        size: (width, height) of the image.
    """
    x0, y0, x1, y1 = box
    if not thing.quad:
        return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], np.float64)
    quad = np.reshape(thing.quad, (4, 2))
    if (quad >= 0).all() and (quad <= size).all():
        return quad
    width, height = size
    image = np.array([(0, 0), (width, 0), (width, height), (0, height)], np.float32)
    _, inside = cv2.intersectConvexConvex(quad.astype(np.float32), image)
    return np.clip(cv2.boxPoints(cv2.minAreaRect(inside)), 0, size)


class _Obb(Format):
    name = "obb"

    def sample_files(self, item: Item) -> tuple[Files, Any]:
        sample, size = item.sample, item.sample.view.size
        lines = [
            yolo.line(number - 1, (oriented_box(thing, box, size) / size).ravel().tolist())
            for number, thing, box in yolo.detections(sample.objects, sample.marker_classes)
            if thing.class_name != "container"
        ]
        return yolo.files(self.name, item, "".join(lines)), None

    def folders(self, split: str) -> Sequence[str]:
        return (f"obb/images/{split}", f"obb/labels/{split}")

    def shared_files(self, splits: Sequence[str], config: Config) -> DatasetFiles:
        # the first class is the container
        return yolo.task_files(self.name, config.markings.detection_classes[1:], splits)


FORMAT = _Obb()
