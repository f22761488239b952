"""Picture of the panoramas of the port with their names: docs/panoramas.jpg.

python examples/panoramas.py docs/panoramas.jpg
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from captioned import beside, captioned, write_jpeg
from numpy.typing import NDArray

from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.light.hdri import bundled_hdris, load_radiance

SIZE = (424, 212)
GREY = 0.18
"""Linear value to which the median luminance is exposed."""


def shown(path: Path) -> NDArray[np.uint8]:
    """Return an HDRI as an sRGB image, exposed to its median luminance."""
    light = cv2.resize(load_radiance(path), SIZE, interpolation=cv2.INTER_AREA)
    luminance = light @ np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec. 709
    return tone_map_and_encode(light * np.float32(GREY / np.median(luminance)))


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="JPEG file to write")
    options = parser.parse_args()
    ports = {n: path for n, path in bundled_hdris().items() if n.startswith("port_")}
    tiles = [captioned(shown(path), name) for name, path in ports.items()]
    write_jpeg(options.out, beside(tiles, 3), 84)


if __name__ == "__main__":
    main()
