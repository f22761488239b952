"""Boxes and labels drawn over images, for people."""

import hashlib

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DAMAGE_VALUES
from fastgen.sample import Sample

Image = NDArray[np.uint8]

_LINE_PX = 1000
"""Side of an image for each pixel of a line's width."""


def class_color(name: str) -> tuple[int, int, int]:
    """A bright RGB colour that stays with a class name."""
    hue = hashlib.blake2b(name.encode(), digest_size=2).digest()
    pixel = np.array([[[int.from_bytes(hue, "little") % 180, 190, 255]]], np.uint8)
    r, g, b = (int(v) for v in cv2.cvtColor(pixel, cv2.COLOR_HSV2RGB)[0, 0])
    return r, g, b


def draw_box(image: Image, box: tuple[float, float, float, float], name: str) -> None:
    """Draw box (x0, y0, x1, y1; x1 and y1 exclusive) with its name into uint8 RGB, in place.

    In large images lines and letters grow, so that they show when the whole is looked at.
    """
    color = class_color(name)
    x0, y0, x1, y1 = (round(v) for v in box)
    line = max(round(max(image.shape[:2]) / _LINE_PX), 1)
    cv2.rectangle(image, (x0, y0), (x1 - 1, y1 - 1), color, line)
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, 0.36 * line
    (width, height), base = cv2.getTextSize(name, font, scale, line)
    top = y0 - height - base if y0 - height - base >= 0 else y0
    left = min(x0, image.shape[1] - width)
    cv2.rectangle(image, (left, top), (left + width, top + height + base), color, -1)
    cv2.putText(image, name, (left, top + height), font, scale, (0, 0, 0), line, cv2.LINE_AA)


def label_colors(labels: NDArray[np.uint16]) -> Image:
    """Labels [H, W] as distinct colours, uint8 [H, W, 3]; 0 is black."""
    values, inverse = np.unique(labels, return_inverse=True)
    palette = np.array([class_color(f"label {v}") if v else (0, 0, 0) for v in values], np.uint8)
    return palette[inverse.reshape(labels.shape)]


def overlay(sample: Sample, image: Image | None = None) -> Image:
    """The sample's image, or `image`, with damage tinted and all visible objects boxed."""
    drawn = (sample.image if image is None else image).copy()
    damaged = sample.damage >= DAMAGE_VALUES.start
    if damaged.any():
        tint = label_colors(sample.damage)[damaged]
        drawn[damaged] = (0.55 * drawn[damaged] + 0.45 * tint).astype(np.uint8)
    for item in sample.objects:
        if item.bbox is not None:
            draw_box(drawn, item.bbox, f"{item.class_name} {item.instance}")
    return drawn
