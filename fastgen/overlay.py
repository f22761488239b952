"""Pictures for people: labels drawn over images, and images that notebooks show."""

import colorsys
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol
from zlib import crc32

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import (
    ALL_DAMAGE_CLASSES,
    CONTAINER_ID,
    DAMAGE_CLASSES,
    DAMAGE_VALUES,
    MARK_CLASSES,
    MARKER_CLASSES,
    SPREADER_ID,
    UNDAMAGED_CONTAINER,
)
from fastgen.files.images import png
from fastgen.scene.limits import MAX_NEIGHBOURS

Image = NDArray[np.uint8]


class Picture(np.ndarray[tuple[int, ...], np.dtype[np.uint8]]):
    """An sRGB image, uint8 [H, W, 3], that notebooks show. It is a NumPy array in every way."""

    def _repr_png_(self) -> bytes | None:
        """Return the picture as PNG; None if a slice is not an image."""
        if self.dtype != np.uint8 or self.ndim != 3 or self.shape[2] != 3 or not self.size:
            return None
        return png(self)


class Drawn(Protocol):
    """The fields of an Object that `overlay` reads."""

    @property
    def class_name(self) -> str: ...
    @property
    def instance(self) -> int: ...
    @property
    def bbox(self) -> tuple[int, int, int, int] | None: ...
    @property
    def background(self) -> bool: ...


_SURROUNDINGS = (150, 150, 150)
_LINE_PX = 1000
"""Image side in pixels for each pixel of line width."""

ID_GREYS = MappingProxyType({CONTAINER_ID: 200, SPREADER_ID: 110})
DAMAGE_GREYS = MappingProxyType(
    {UNDAMAGED_CONTAINER + k: 200 - 8 * k for k in range(1 + MAX_NEIGHBOURS)}
)

_GOLDEN = (5**0.5 - 1) / 2

_LATER = ALL_DAMAGE_CLASSES[len(DAMAGE_CLASSES) :]
_STRONG = ("container", "text", *DAMAGE_CLASSES, "spreader", "seal", *_LATER)
_PALE = (*MARKER_CLASSES, *MARK_CLASSES)


def class_color(name: str) -> tuple[int, int, int]:
    """Return the RGB colour of a class.

    Markers and marks have pale colours, also those of a configuration. All other classes have
    strong colours that differ clearly.
    """
    if name not in _STRONG and name not in _PALE:
        return _color(crc32(name.encode(errors="replace")), 0.4, 1.0)
    names, saturation = (_STRONG, 0.85) if name in _STRONG else (_PALE, 0.4)
    return _color(names.index(name), saturation, 1.0)


def class_hex(name: str) -> str:
    """Return the colour of a class as pages write it, #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*class_color(name))


def _color(number: int, saturation: float, brightness: float) -> tuple[int, int, int]:
    """Return a colour whose hue advances by the golden ratio per number, which never repeats."""
    hue = number * _GOLDEN % 1
    r, g, b = (round(255 * part) for part in colorsys.hsv_to_rgb(hue, saturation, brightness))
    return r, g, b


def draw_box(
    image: Image, box: tuple[float, float, float, float], class_name: str, caption: str = ""
) -> None:
    """Draw a box in the colour of its class.

    Lines and letters are larger in large images, so that they are visible in the whole image.

    Args:
        image: uint8 RGB [H, W, 3], changed in place.
        box: (x0, y0, x1, y1) in pixels; x1 and y1 are exclusive.
        class_name: Class, which decides the colour.
        caption: Text at the box; by default the class name.
    """
    x0, y0, x1, y1 = (round(v) for v in box)
    color = class_color(class_name)
    cv2.rectangle(image, (x0, y0), (x1 - 1, y1 - 1), color, _line(image))
    _write(image, x0, y0, caption or class_name, color)


def draw_outline(image: Image, points: NDArray[np.floating], class_name: str) -> None:
    """Draw a closed polygon in the colour of its class, with the class name.

    Args:
        image: uint8 RGB [H, W, 3], changed in place.
        points: Polygon [N, 2] along the outer borders of pixels.
        class_name: Class, which decides the colour.
    """
    pixels = np.rint(np.minimum(points, np.array(image.shape[1::-1]) - 1)).astype(np.int32)
    color = class_color(class_name)
    cv2.polylines(image, [pixels], True, color, _line(image), cv2.LINE_AA)
    left, top = pixels.min(axis=0).tolist()
    _write(image, left, top, class_name, color)


def _line(image: Image) -> int:
    """Return the width of lines in pixels."""
    width: int = max(round(max(image.shape[:2]) / _LINE_PX), 1)
    return width


def _write(image: Image, left: int, bottom: int, text: str, color: tuple[int, int, int]) -> None:
    """Write on a background of `color`, above a row if there is space, else below it."""
    line, font = _line(image), cv2.FONT_HERSHEY_SIMPLEX
    (width, height), base = cv2.getTextSize(text, font, 0.36 * line, line)
    top = bottom - height - base if bottom - height - base >= 0 else bottom
    left = max(min(left, image.shape[1] - width), 0)
    cv2.rectangle(image, (left, top), (left + width, top + height + base), color, -1)
    place = left, top + height
    cv2.putText(image, text, place, font, 0.36 * line, (0, 0, 0), line, cv2.LINE_AA)


def label_colors(labels: NDArray[np.uint16], greys: Mapping[int, int]) -> Image:
    """Show a label image in colours.

    Args:
        labels: uint16 [H, W].
        greys: Brightness of the labels to show in grey, such as ID_GREYS or DAMAGE_GREYS.

    Returns:
        uint8 [H, W, 3]. A label has the same colour in every image, and a few dozen consecutive
        labels have distinguishable colours. 0 is black.
    """
    values, inverse = np.unique(labels, return_inverse=True)
    palette = np.array([_label_color(int(value), greys) for value in values], np.uint8)
    return palette[inverse.reshape(labels.shape)]


def depth_colors(depth_m: NDArray[np.float32]) -> Image:
    """Show a depth image in colours, in equal steps of its logarithm.

    Args:
        depth_m: Depth [H, W] in metres, infinite where void.

    Returns:
        uint8 [H, W, 3]. The nearest pixel is bright; the farthest 2% are dark, and void is black.
    """
    seen = np.isfinite(depth_m)
    if not seen.any():
        return np.zeros((*depth_m.shape, 3), np.uint8)
    near, far = np.log(np.quantile(depth_m[seen], [0.0, 0.98]))
    share = (far - np.log(np.where(seen, depth_m, 1.0))) / max(float(far - near), 1e-6)
    levels = (np.clip(share, 0, 1) * 255).astype(np.uint8)
    colors = np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS)[..., ::-1], np.uint8)
    return np.where(seen[..., None], colors, np.uint8(0))


def _label_color(value: int, greys: Mapping[int, int]) -> tuple[int, ...]:
    """Return a colour of `_color` in one of nine alternating tones."""
    if value == 0 or value in greys:
        return (greys.get(value, 0),) * 3
    saturation, brightness = (0.75, 0.45, 0.95)[value % 3], (1.0, 0.8, 0.6)[value // 3 % 3]
    return _color(value, saturation, brightness)


def overlay(image: Image, damage: NDArray[np.uint16], objects: Sequence[Drawn]) -> Picture:
    """Return an image with tinted damages and boxes of visible objects.

    Containers of the panorama have thin grey boxes without captions.

    Args:
        image: uint8 sRGB [H, W, 3].
        damage: Damage target uint16 [H, W], see `Frame`.
        objects: The objects in the image.
    """
    drawn = image.copy()
    damaged = damage >= DAMAGE_VALUES.start
    if damaged.any():
        tint = label_colors(damage, DAMAGE_GREYS)[damaged]
        drawn[damaged] = (0.55 * drawn[damaged] + 0.45 * tint).astype(np.uint8)
    for item in objects:
        if item.bbox is not None and item.background:
            x0, y0, x1, y1 = item.bbox
            cv2.rectangle(drawn, (x0, y0), (x1 - 1, y1 - 1), _SURROUNDINGS, 1)
    for item in objects:
        if item.bbox is not None and not item.background:
            caption = f"{item.class_name} {item.instance}"
            draw_box(drawn, item.bbox, item.class_name, caption)
    return drawn.view(Picture)
