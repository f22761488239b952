"""A contact sheet of a dataset, with the boxes as its label files on disk have them."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DETECTION_CLASSES
from fastgen.overlay import draw_box
from fastgen.sampling import SPLITS

_COLUMNS, _ROWS, _TILE_PX = 6, 4, 400


def contact_sheet(out: Path) -> NDArray[np.uint8]:
    """Up to 24 images of the dataset in folder `out`, spread evenly, as one picture [H, W, 3]."""
    images = [p for split in SPLITS for p in (out / "images" / split).glob("*.jpg")]
    by_camera: dict[str, list[Path]] = {}
    for image in sorted(images, key=lambda p: p.stem):
        by_camera.setdefault(image.stem.split("_", 1)[1], []).append(image)
    # one camera after the other, each spread over the dataset
    count = min(len(images), _COLUMNS * _ROWS)
    share = -(-count // max(len(by_camera), 1))
    chosen = [
        views[i * len(views) // min(share, len(views))]
        for i in range(share)
        for views in by_camera.values()
        if i < len(views)
    ][:count]
    rows = -(-count // _COLUMNS)
    sheet = np.full((rows * _TILE_PX, _COLUMNS * _TILE_PX, 3), 32, np.uint8)
    for i, image_path in enumerate(chosen):
        y, x = i // _COLUMNS * _TILE_PX, i % _COLUMNS * _TILE_PX
        tile = _tile(out, image_path)
        sheet[y : y + tile.shape[0], x : x + tile.shape[1]] = tile
    return sheet


def _tile(out: Path, path: Path) -> NDArray[np.uint8]:
    stored = cv2.imread(str(path))
    assert stored is not None, path
    image = cv2.cvtColor(stored, cv2.COLOR_BGR2RGB)
    scale = _TILE_PX / max(image.shape[:2])
    size = (max(round(image.shape[1] * scale), 1), max(round(image.shape[0] * scale), 1))
    tile = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    labels = out / "imdg/labels" / path.parent.name / f"{path.stem}.txt"
    for line in labels.read_text(encoding="utf-8").splitlines():
        index, *numbers = line.split()
        x, y, width, height = (float(v) for v in numbers)
        box = (
            (x - width / 2) * size[0],
            (y - height / 2) * size[1],
            (x + width / 2) * size[0],
            (y + height / 2) * size[1],
        )
        draw_box(tile, box, DETECTION_CLASSES[int(index)])
    return tile
