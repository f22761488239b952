"""Pictures of the label files of one image, for docs/output_pictures.md: docs/outputs/NAME.jpg.

fastgen generate OUT --preset gate --seed 3 --images 2 --cameras rear --quality fine \
    --set damage.probability=1 --set markings.marked_containers=1 --set seals.probability=1 \
    --also obb,semantic,depth,normals,ids,text_parts
python examples/output_pictures.py OUT
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from captioned import beside, write_jpeg
from numpy.typing import NDArray
from PIL import Image

from fastgen.formats import yolo
from fastgen.overlay import (
    DAMAGE_GREYS,
    ID_GREYS,
    Outline,
    depth_colors,
    draw_outlines,
    label_colors,
)

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "outputs"
NAME = "train/s3_000001_rear"
WIDTH_PX, QUALITY = 640, 82
_CROP_HEIGHT_PX = 60

Picture = NDArray[np.uint8]


def rows(out: Path, task: str) -> Iterator[tuple[str, list[float]]]:
    """Yield the class and the numbers of each line of a YOLO label file."""
    classes = (out / task / "classes.txt").read_text(encoding="utf-8").split()
    for line in (out / task / "labels" / f"{NAME}.txt").read_text(encoding="utf-8").splitlines():
        number, *values = line.split()
        yield classes[int(number)], [float(value) for value in values]


def polygon(values: list[float], size: tuple[int, int], name: str) -> Outline:
    """Return an outline of normalised points x0, y0, x1, y1, ..."""
    return Outline(np.reshape(values, (-1, 2)) * size, name, name)


def with_keypoints(image: Picture, found: list[tuple[str, list[float]]]) -> Picture:
    """Return an image with boxes and numbered keypoints; hidden keypoints are hollow."""
    drawn = image.copy()
    size = image.shape[1], image.shape[0]
    boxes = [Outline.of_box(yolo.pixel_box(values[:4], size), name) for name, values in found]
    draw_outlines(drawn, boxes)
    for _, values in found:
        for number, (x, y, seen) in enumerate(np.reshape(values[4:], (-1, 3)).tolist()):
            if seen:
                at = round(x * size[0]), round(y * size[1])
                cv2.circle(drawn, at, 5, (255, 230, 0), -1 if seen == 2 else 1, cv2.LINE_AA)
                beside_it = at[0] + 8, at[1] + 5
                for color, width in (((0, 0, 0), 3), ((255, 230, 0), 1)):
                    font = cv2.FONT_HERSHEY_SIMPLEX
                    cv2.putText(drawn, str(number), beside_it, font, 0.5, color, width, cv2.LINE_AA)
    return drawn


def crops(out: Path) -> Picture:
    """Return the text crop of the image, and those of its parts, one below another."""
    split, stem = NAME.split("/")
    paths = [
        *sorted((out / "text" / split).glob(f"{stem}_*.png")),
        *sorted((out / "text_parts" / split).glob(f"{stem}_*.png")),
    ]
    tiles = []
    for path in paths:
        image = np.asarray(Image.open(path).convert("RGB"))
        scale = _CROP_HEIGHT_PX / image.shape[0]
        width = round(image.shape[1] * scale)
        image = cv2.resize(image, (width, _CROP_HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
        tile = np.full((_CROP_HEIGHT_PX + 6, WIDTH_PX // 2, 3), 255, np.uint8)
        part = image[:, : tile.shape[1]]
        tile[:_CROP_HEIGHT_PX, : part.shape[1]] = part
        tiles.append(tile)
    return beside(tiles, 2)


def pictures(out: Path) -> dict[str, Picture]:
    """Return a picture uint8 [H, W, 3] of each kind of label file."""

    def read(path: str) -> NDArray[np.uint16]:
        return np.asarray(Image.open(out / path))

    def outlined(outlines: list[Outline]) -> Picture:
        drawn = image.copy()
        draw_outlines(drawn, outlines)
        return drawn

    image = np.asarray(Image.open(out / f"images/{NAME}.jpg").convert("RGB"))
    size = image.shape[1], image.shape[0]
    depth_mm = read(f"depth/{NAME}.png")
    boxes = [Outline.of_box(yolo.pixel_box(v, size), name) for name, v in rows(out, "imdg")]
    return {
        "image": image,
        "imdg": outlined(boxes),
        "obb": outlined([polygon(v, size, name) for name, v in rows(out, "obb")]),
        "container": with_keypoints(image, list(rows(out, "container"))),
        "damage": outlined(
            [polygon(v, size, name) for name, v in rows(out, "damage") if name != "container"]
        ),
        "masks": label_colors(read(f"damage/masks/{NAME}.png"), DAMAGE_GREYS),
        "semantic": np.asarray(Image.open(out / f"semantic/masks/{NAME}.png").convert("RGB")),
        "ids": label_colors(read(f"ids/{NAME}.png"), ID_GREYS),
        "depth": depth_colors(np.where(depth_mm > 0, depth_mm / 1e3, np.inf)),
        "normals": np.asarray(Image.open(out / f"normals/{NAME}.png").convert("RGB")),
        "text": crops(out),
    }


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("dataset", type=Path, help="OUT of the command above")
    options = parser.parse_args()
    for name, picture in pictures(options.dataset).items():
        height = round(picture.shape[0] * WIDTH_PX / picture.shape[1])
        scaled = cv2.resize(picture, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
        write_jpeg(FOLDER / f"{name}.jpg", np.asarray(scaled, np.uint8), QUALITY)


if __name__ == "__main__":
    main()
