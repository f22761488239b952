"""Contact sheet: small copies of a dataset's images with the labels from its files drawn on."""

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.dataset.job import scene_and_camera
from fastgen.dataset.storage import Folder
from fastgen.errors import OutputError
from fastgen.files.images import decode
from fastgen.formats.format import Format
from fastgen.overlay import draw_outlines

_COLUMNS, _ROWS, _TILE_PX = 6, 4, 400


def contact_sheet(
    out: Path, images: Sequence[tuple[str, str]], formats: Sequence[Format]
) -> NDArray[np.uint8]:
    """Draw up to 24 images of a dataset, evenly spread, as one picture.

    Args:
        out: Folder of the dataset.
        images: Split and stem of each image, at least one.
        formats: Formats whose labels are drawn, the first one on top.

    Returns:
        uint8 RGB [H, W, 3].

    Raises:
        OutputError: A file cannot be read; the message names its image.
    """
    by_camera: dict[str, list[Path]] = {}
    for split, stem in sorted(images, key=lambda image: image[1]):
        path = out / "images" / split / f"{stem}.jpg"
        by_camera.setdefault(scene_and_camera(stem)[1], []).append(path)
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
            tiles.append(_tile(out, image_path, formats))
        except (cv2.error, OSError, OutputError, ValueError, IndexError):
            raise OutputError(
                f"{image_path}: the image or one of its label files is damaged; "
                f"run fastgen verify {out} --repair"
            ) from None
    height, width = np.max([tile.shape[:2] for tile in tiles], axis=0)
    columns = min(count, _COLUMNS)
    sheet = np.full((-(-count // columns) * height, columns * width, 3), 32, np.uint8)
    for i, tile in enumerate(tiles):
        y, x = i // columns * height, i % columns * width
        sheet[y : y + tile.shape[0], x : x + tile.shape[1]] = tile
    return sheet


def _tile(out: Path, path: Path, formats: Sequence[Format]) -> NDArray[np.uint8]:
    storage = Folder(out)
    image = decode(storage.read(path.relative_to(out).as_posix()))
    scale = _TILE_PX / max(image.shape[:2])
    size = (max(round(image.shape[1] * scale), 1), max(round(image.shape[0] * scale), 1))
    tile = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    name = f"{path.parent.name}/{path.stem}"
    found = [each.outlines(size, storage.read, name) for each in reversed(formats)]
    draw_outlines(tile, list(chain.from_iterable(found)))
    return tile
