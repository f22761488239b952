"""Boxes and labels drawn over images, for people."""

import colorsys
from collections.abc import Mapping
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import (
    CONTAINER_ID,
    DAMAGE_CLASSES,
    DAMAGE_VALUES,
    MARKER_CLASSES,
    SOUND_CONTAINER,
    SPREADER_ID,
)
from fastgen.sample import Sample

Image = NDArray[np.uint8]

_LINE_PX = 1000
"""Side of an image for each pixel of a line's width."""

ID_GREYS = MappingProxyType({CONTAINER_ID: 200, SPREADER_ID: 110})
DAMAGE_GREYS = MappingProxyType({SOUND_CONTAINER: 200})

_GOLDEN = (5**0.5 - 1) / 2

_CLASSES = ("container", "text", *DAMAGE_CLASSES, *MARKER_CLASSES)


def class_color(name: str) -> tuple[int, int, int]:
    """A bright RGB colour that stays with a class name: hues a golden ratio apart, so that those of
    containers, texts and damages are far from each other. All but known classes share one."""
    number = _CLASSES.index(name) if name in _CLASSES else len(_CLASSES)
    r, g, b = (round(255 * part) for part in colorsys.hsv_to_rgb(number * _GOLDEN % 1, 0.75, 1.0))
    return r, g, b


def draw_box(image: Image, box: tuple[float, float, float, float], name: str) -> None:
    """Draw box (x0, y0, x1, y1; x1 and y1 exclusive) with its name into uint8 RGB, in place.

    In large images lines and letters grow, so that they show when the whole is looked at.
    """
    x0, y0, x1, y1 = (round(v) for v in box)
    cv2.rectangle(image, (x0, y0), (x1 - 1, y1 - 1), class_color(name), _line(image))
    _write(image, x0, y0, name)


def draw_outline(image: Image, points: NDArray[np.floating], name: str) -> None:
    """As `draw_box`, of a closed polygon [N, 2]."""
    pixels = np.rint(points).astype(np.int32)
    cv2.polylines(image, [pixels], True, class_color(name), _line(image), cv2.LINE_AA)
    left, top = pixels.min(axis=0).tolist()
    _write(image, left, top, name)


def _line(image: Image) -> int:
    """Width of lines in pixels."""
    return max(round(max(image.shape[:2]) / _LINE_PX), 1)


def _write(image: Image, left: int, bottom: int, name: str) -> None:
    """Write a name on its class's colour, above a row where there is room."""
    line, font = _line(image), cv2.FONT_HERSHEY_SIMPLEX
    (width, height), base = cv2.getTextSize(name, font, 0.36 * line, line)
    top = bottom - height - base if bottom - height - base >= 0 else bottom
    left = min(left, image.shape[1] - width)
    cv2.rectangle(image, (left, top), (left + width, top + height + base), class_color(name), -1)
    place = left, top + height
    cv2.putText(image, name, place, font, 0.36 * line, (0, 0, 0), line, cv2.LINE_AA)


def label_colors(labels: NDArray[np.uint16], greys: Mapping[int, int]) -> Image:
    """Labels [H, W] as colours, uint8 [H, W, 3], the same for a label in every image; those of a
    few dozen numbers in a row can be told apart. 0 is black.

    greys: of labels that shall be grey, how bright; ID_GREYS or DAMAGE_GREYS.
    """
    values, inverse = np.unique(labels, return_inverse=True)
    palette = np.array([_label_color(int(value), greys) for value in values], np.uint8)
    return palette[inverse.reshape(labels.shape)]


def _label_color(value: int, greys: Mapping[int, int]) -> tuple[int, ...]:
    """Hues a golden ratio apart, which no run of numbers repeats, at nine tones in turn."""
    if value == 0 or value in greys:
        return (greys.get(value, 0),) * 3
    saturation, brightness = (0.75, 0.45, 0.95)[value % 3], (1.0, 0.8, 0.6)[value // 3 % 3]
    color = colorsys.hsv_to_rgb(value * _GOLDEN % 1, saturation, brightness)
    return tuple(round(255 * part) for part in color)


def overlay(sample: Sample, image: Image | None = None) -> Image:
    """The sample's image, or `image`, with damage tinted and all visible objects boxed."""
    drawn = (sample.image if image is None else image).copy()
    damaged = sample.damage >= DAMAGE_VALUES.start
    if damaged.any():
        tint = label_colors(sample.damage, DAMAGE_GREYS)[damaged]
        drawn[damaged] = (0.55 * drawn[damaged] + 0.45 * tint).astype(np.uint8)
    for item in sample.objects:
        if item.bbox is not None:
            draw_box(drawn, item.bbox, f"{item.class_name} {item.instance}")
    return drawn
