"""rapidocr, a reader trained on real text, on our identifiers and on real ones."""

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
from peers import SCRIPTS, Peer
from real_crops import Pixels

RAPIDOCR = Peer(
    "rapidocr",
    "with_rapidocr.py",
    environment="rapidocr",
    # --no-deps, because rapidocr requires the variant of OpenCV that needs a display's libraries
    requirements=(
        "--no-deps",
        "rapidocr-onnxruntime==1.4.4",
        *("onnxruntime", "numpy", "opencv-python-headless", "pyclipper", "shapely", "pillow"),
        *("pyyaml", "six", "tqdm", "flatbuffers", "packaging", "protobuf"),
    ),
)
"""The reader with its models, in an environment of its own."""

Text = tuple[str, float, float, float, float]
"""Letters that were read, and their box x0, y0, x1, y1 in pixels."""


def read_texts(pictures: Sequence[Pixels], threads: int) -> list[list[Text]]:
    """Return the texts that rapidocr reads in each picture.

    Raises:
        SystemExit: rapidocr failed.
    """
    with tempfile.TemporaryDirectory() as place:
        for number, pixels in enumerate(pictures):
            cv2.imwrite(f"{place}/{number:06d}.png", pixels[:, :, ::-1])
        out = Path(place) / "texts.json"
        script = str(SCRIPTS / RAPIDOCR.script)
        command = [str(RAPIDOCR.interpreter), script, place, str(out), str(threads)]
        variables = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        done = subprocess.run(command, capture_output=True, text=True, env=variables)
        if done.returncode:
            raise SystemExit(f"rapidocr failed: {done.stderr.strip()[-300:]}")
        found = json.loads(out.read_text(encoding="utf-8"))
    return [[tuple(text) for text in found[name]] for name in sorted(found)]


def joined(texts: Sequence[Text], column: bool) -> str:
    """Return the letters and digits of all texts in reading order.

    Texts whose middles are within half a text's height are one line, read from left to right. In
    columns, texts above one another are one column, read from top to bottom.
    """
    along, across = (1, 0) if column else (0, 1)

    def ends(text: Text, axis: int) -> tuple[float, float]:
        _, *box = text
        return box[axis], box[2 + axis]

    def middle(text: Text) -> float:
        return sum(ends(text, across)) / 2

    lines: list[list[Text]] = []
    for text in sorted(texts, key=middle):
        low, high = ends(lines[-1][0], across) if lines else (0.0, 0.0)
        if lines and abs(middle(text) - (low + high) / 2) < (high - low) / 2:
            lines[-1].append(text)
        else:
            lines.append([text])
    ordered = [t for line in lines for t in sorted(line, key=lambda t: ends(t, along)[0])]
    return "".join(c for t in ordered for c in t[0].upper() if c.isascii() and c.isalnum())


def contains_code(texts: Sequence[Text], code: str, column: bool) -> bool:
    """Test whether the texts contain the owner code and serial number of an identifier."""
    return code[:10] in joined(texts, column)
