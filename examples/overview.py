"""Picture of one view with its labels: image, boxes, ids, depth and damage; docs/overview.jpg.

python examples/overview.py docs/overview.jpg
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from captioned import captioned
from numpy.typing import NDArray

from fastgen import Config, Generator
from fastgen.files.images import jpeg, write
from fastgen.overlay import DAMAGE_GREYS, ID_GREYS, depth_colors, label_colors
from fastgen.sample import Sample

CONFIG = Config.from_values(
    {"damage": {"probability": 1.0}, "markings": {"marked_containers": 1.0}}, Config.preset("gate")
)
SEED, INDEX, CAMERA = 3, 1, "rear"
SIDE, GAP, STRIP = 640, 6, 34
"""Pixels: side of the large image, gap between images, and height of the captions."""


def scaled(image: NDArray[np.uint8], side: int, words: str) -> NDArray[np.uint8]:
    """Return an image scaled to a side, with a caption below."""
    image = np.asarray(cv2.resize(image, (side, side), interpolation=cv2.INTER_AREA), np.uint8)
    return captioned(image, words, STRIP, letters=0.58)


def picture(large: NDArray[np.uint8], sample: Sample) -> NDArray[np.uint8]:
    """Return a large image at the left and four labels of the same view at the right."""
    side = sample.image.shape[0]
    parts = {
        "boxes, texts, damage": sample.overlay(),
        "instance ids": label_colors(sample.ids, ID_GREYS),
        "depth": depth_colors(sample.depth),
        "damage classes": label_colors(sample.damage, DAMAGE_GREYS),
    }
    small = [scaled(image, side, words) for words, image in parts.items()]
    white = np.full((small[0].shape[0], GAP, 3), 255, np.uint8)
    rows = [np.concatenate([a, white, b], axis=1) for a, b in (small[:2], small[2:])]
    line = np.full((GAP, rows[0].shape[1], 3), 255, np.uint8)
    right = np.concatenate([rows[0], line, rows[1]])
    left = scaled(large, SIDE, "image")
    between = np.full((left.shape[0], GAP, 3), 255, np.uint8)
    return np.concatenate([left, between, right], axis=1)


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="JPEG file to write")
    parser.add_argument("--index", type=int, default=INDEX)
    parser.add_argument("--camera", default=CAMERA)
    options = parser.parse_args()
    side = (SIDE + STRIP - GAP) // 2 - STRIP
    found = []
    for pixels in (2 * SIDE, side):
        with Generator(CONFIG, seed=SEED, size=(pixels, pixels), quality="fine") as generator:
            found.append(generator.render(index=options.index, camera=options.camera))
    write(options.out, jpeg(picture(found[0].image, found[1])))


if __name__ == "__main__":
    main()
