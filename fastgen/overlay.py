"""Pictures for people: labels drawn over images, and images that notebooks show."""

import colorsys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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


_BACKGROUND_COLOR = (150, 150, 150)
_LINE_PX = 1000
"""Image side in pixels for each pixel of line width."""

_FONT, _LETTERS = cv2.FONT_HERSHEY_SIMPLEX, 0.36
"""Font of captions, and its scale for lines of one pixel."""

_REACH = 10
"""Distance in line heights up to which a caption may be moved."""

_HIDING, _COVERING = 30.0, 60.0
"""Costs of hiding a whole box and of covering a caption, as distances in line heights."""

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


@dataclass(frozen=True)
class Outline:
    """An outline to draw in the colour of its class, with a caption.

    Attributes:
        points: Polygon [N, 2] in pixels along the outer borders of pixels.
        class_name: Class, which decides the colour.
        caption: Text at the outline.
    """

    points: NDArray[np.floating]
    class_name: str
    caption: str

    @staticmethod
    def of_box(
        box: tuple[float, float, float, float], class_name: str, caption: str = ""
    ) -> "Outline":
        """Return the outline of a box (x0, y0, x1, y1) in pixels, where x1 and y1 are exclusive."""
        x0, y0, x1, y1 = box
        x1, y1 = x1 - 1, y1 - 1
        corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], float)
        return Outline(corners, class_name, caption or class_name)


def draw_outlines(image: Image, outlines: Sequence[Outline]) -> None:
    """Draw outlines with captions that cover other outlines as little as possible.

    A caption without room beside its outline is moved away and connected to it by a line. Lines and
    letters are larger in large images, so that they are visible in the whole image.

    Args:
        image: uint8 RGB [H, W, 3], changed in place.
        outlines: Outlines; later ones are drawn over earlier ones.
    """
    if not outlines:
        return
    line = _line(image)
    most = np.array(image.shape[1::-1]) - 1
    boxes = np.array([(*each.points.min(axis=0), *each.points.max(axis=0)) for each in outlines])
    for outline in outlines:
        pixels = np.clip(np.rint(outline.points), 0, most).astype(np.int32)
        smooth = cv2.LINE_AA if len(pixels) > 4 else cv2.LINE_8
        cv2.polylines(image, [pixels], True, class_color(outline.class_name), line, smooth)
    taken = np.zeros((0, 4))
    captions = []
    for i in np.argsort(_areas(boxes), kind="stable"):  # small objects have the least choice
        text = cv2.getTextSize(outlines[i].caption, _FONT, _LETTERS * line, line)
        (width, height), base = text
        place = caption_place(boxes, int(i), (width, height + base), taken, image.shape[1::-1])
        taken = np.concatenate([taken, place[None]])
        captions.append((outlines[i], boxes[i], place, base))
    for outline, box, place, _ in captions:
        start, end = _gap(box, place)
        if np.abs(end - start).max() > 2 * line:
            a, b = np.rint([start, end]).astype(int).tolist()
            cv2.line(image, a, b, class_color(outline.class_name), line, cv2.LINE_AA)
    for outline, _, place, base in captions:
        x0, y0, x1, y1 = np.rint(place).astype(int).tolist()
        cv2.rectangle(image, (x0, y0), (x1, y1), class_color(outline.class_name), -1)
        scale, black = _LETTERS * line, (0, 0, 0)
        cv2.putText(image, outline.caption, (x0, y1 - base), _FONT, scale, black, line, cv2.LINE_AA)


def caption_place(
    boxes: NDArray[np.floating],
    index: int,
    size: tuple[int, int],
    taken: NDArray[np.floating],
    image_size: Sequence[int],
) -> NDArray[np.float64]:
    """Return a place for a caption that is near its box and covers little else.

    Args:
        boxes: x0, y0, x1 and y1 of all boxes [N, 4] in pixels.
        index: Box of the caption.
        size: Width and height of the caption.
        taken: Places of the captions so far [K, 4], which it avoids.
        image_size: Width and height of the image.

    Returns:
        x0, y0, x1 and y1, float64 [4].
    """
    width, height = size
    x0, y0, x1, y1 = boxes[index]
    steps = np.arange(-_REACH, _REACH + 1) * height
    x = np.concatenate([x0 + steps, [x1, x0 - width, x1 - width]])
    y = np.concatenate([y0 - height + steps, [y0, y1, y1 - height]])
    x = np.clip(x, 0, max(image_size[0] - width - 1, 0))
    y = np.clip(y, 0, max(image_size[1] - height - 1, 0))
    corners = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    places = np.concatenate([corners, corners + (width, height)], axis=1)
    hidden = _overlaps(x, y, size, boxes, 1 / _areas(boxes))
    covered = _overlaps(x, y, size, taken, 1 / (width * height))
    away = np.linalg.norm(np.subtract(*_gap(boxes[index], places)), axis=-1) / height
    # ties go to the caption above the left corner
    usual = np.linalg.norm(corners - (x0, y0 - height), axis=1) / height
    cost = _HIDING * hidden + _COVERING * covered + away + 0.1 * usual
    return np.asarray(places[int(cost.argmin())])


def _areas(boxes: NDArray[np.floating]) -> NDArray[np.float64]:
    sides = np.maximum(boxes[:, 2:] - boxes[:, :2], 1.0)
    return np.asarray(sides.prod(axis=1))


def _overlaps(
    x: NDArray[np.floating],
    y: NDArray[np.floating],
    size: tuple[int, int],
    boxes: NDArray[np.floating],
    weights: NDArray[np.floating] | float,
) -> NDArray[np.float64]:
    """Return the weighted sums [Y * X] of the areas that captions at y and x share with boxes."""
    width, height = size
    across = np.minimum(x[:, None] + width, boxes[:, 2]) - np.maximum(x[:, None], boxes[:, 0])
    down = np.minimum(y[:, None] + height, boxes[:, 3]) - np.maximum(y[:, None], boxes[:, 1])
    # places are a grid, so an area is the product of a term of the column and one of the row
    return np.asarray((np.maximum(down, 0) * weights @ np.maximum(across, 0).T).ravel())


def _gap(
    a: NDArray[np.floating], b: NDArray[np.floating]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points [..., 2] of boxes [..., 4] a and b that are nearest to each other."""
    middle = (np.maximum(a[..., :2], b[..., :2]) + np.minimum(a[..., 2:], b[..., 2:])) / 2
    return tuple(np.clip(middle, box[..., :2], box[..., 2:]) for box in (a, b))


def _line(image: Image) -> int:
    """Return the width of lines in pixels."""
    width: int = max(round(max(image.shape[:2]) / _LINE_PX), 1)
    return width


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
            cv2.rectangle(drawn, (x0, y0), (x1 - 1, y1 - 1), _BACKGROUND_COLOR, 1)
    outlines = [
        Outline.of_box(item.bbox, item.class_name, f"{item.class_name} {item.instance}")
        for item in objects
        if item.bbox is not None and not item.background
    ]
    draw_outlines(drawn, outlines)
    return drawn.view(Picture)
