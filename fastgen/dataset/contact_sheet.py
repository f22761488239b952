"""A contact sheet of a dataset, with boxes and outlines as its label files on disk have them."""

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.errors import OutputError
from fastgen.formats.yolo import pixel_box, rows
from fastgen.labels.overlay import draw_box, draw_outline

_COLUMNS, _ROWS, _TILE_PX = 6, 4, 400


def contact_sheet(out: Path, images: Sequence[tuple[str, str]]) -> NDArray[np.uint8]:
    """Up to 24 of `images`, (split, stem) each, of the dataset in folder `out`.

    At least one; they are spread evenly. Returns one picture uint8 [H, W, 3]. Raises OutputError
    that names a file which is not as it was written.
    """
    by_camera: dict[str, list[Path]] = {}
    for split, stem in sorted(images, key=lambda image: image[1]):
        path = out / "images" / split / f"{stem}.jpg"
        by_camera.setdefault(stem.split("_", 1)[1], []).append(path)
    # one camera after the other, each spread over the dataset
    count = min(len(images), _COLUMNS * _ROWS)
    share = -(-count // max(len(by_camera), 1))
    chosen = [
        views[i * len(views) // min(share, len(views))]
        for i in range(share)
        for views in by_camera.values()
        if i < len(views)
    ][:count]
    tiles = []
    for image_path in chosen:
        try:
            tiles.append(_tile(out, image_path))
        except (cv2.error, OSError, ValueError, IndexError):
            raise OutputError(
                f"{image_path}: it or its labels are damaged; run fastgen verify {out} --repair"
            ) from None
    height, width = tiles[0].shape[:2]  # of all: a dataset has one size
    columns = min(count, _COLUMNS)
    sheet = np.full((-(-count // columns) * height, columns * width, 3), 32, np.uint8)
    for i, tile in enumerate(tiles):
        y, x = i // columns * height, i % columns * width
        sheet[y : y + height, x : x + width] = tile
    return sheet


def _tile(out: Path, path: Path) -> NDArray[np.uint8]:
    # not imread, which ends the process at a path that is not UTF-8
    stored = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
    if stored is None:
        raise ValueError
    image = cv2.cvtColor(stored, cv2.COLOR_BGR2RGB)
    scale = _TILE_PX / max(image.shape[:2])
    size = (max(round(image.shape[1] * scale), 1), max(round(image.shape[0] * scale), 1))
    tile = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    name = f"{path.parent.name}/{path.stem}.txt"
    for index, numbers in _labels(out / "imdg/labels" / name):
        draw_box(tile, pixel_box(numbers, size), DETECTION_CLASSES[index])
    for index, numbers in _labels(out / "damage/yolo" / name):
        if index:  # the container has its box
            draw_outline(tile, np.reshape(numbers, (-1, 2)) * size, SEGMENTATION_CLASSES[index])
    return tile


def _labels(path: Path) -> list[tuple[int, list[float]]]:
    """As yolo.rows. Raises ValueError for what cannot be drawn."""
    found = rows(path.read_text(encoding="utf-8"))
    if any(index < 0 or not all(map(math.isfinite, numbers)) for index, numbers in found):
        raise ValueError
    return found
