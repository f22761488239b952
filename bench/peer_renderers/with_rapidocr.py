"""Reader rapidocr on a folder of pictures: python with_rapidocr.py PICTURES OUT.json THREADS.

Writes, for each PNG by name, its texts as [text, x0, y0, x1, y1] with the box in pixels.
"""

import json
import sys
from pathlib import Path

import cv2
from rapidocr_onnxruntime import RapidOCR


def main(pictures: Path, out: Path, threads: int) -> None:
    """Read all PNG files."""
    reader = RapidOCR(intra_op_num_threads=threads)
    found: dict[str, list[list[object]]] = {}
    for path in sorted(pictures.glob("*.png")):
        texts, _ = reader(cv2.imread(str(path)))
        found[path.name] = [
            [text, *_box([(float(x), float(y)) for x, y in corners])]
            for corners, text, _ in texts or ()
        ]
    out.write_text(json.dumps(found), encoding="utf-8")


def _box(corners: list[tuple[float, float]]) -> tuple[float, float, float, float]:
    x, y = zip(*corners, strict=True)
    return min(x), min(y), max(x), max(y)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]))
