"""Photographs of noise, for tests of `fastgen fit`."""

import numpy as np

from fastgen.files.images import encode_picture


def photographs_in(folder, count, size=(96, 80)):
    """Write a folder of pictures 0.png, 1.png and so on, and return it."""
    folder.mkdir()
    rng = np.random.default_rng(5)
    for k in range(count):
        pixels = rng.integers(0, 255, (size[1], size[0], 3), np.uint8)
        (folder / f"{k}.png").write_bytes(encode_picture(pixels, ".png"))
    return folder
