"""Images of errors: our render, the path tracer's, and FLIP."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from reference_set import Case

FLIP_SHOWN = 0.5
"""FLIP value that the error maps show as the brightest colour."""

_HEAD_PX = 24

Array = NDArray[np.floating]
Picture = NDArray[np.uint8]
Panels = tuple[Array, Array, Array]
"""Our image and the reference as sRGB [H, W, 3] in 0..1, and FLIP [H, W]."""


def heat(error: Array) -> Picture:
    """Return FLIP as BGR colours from black over red to the brightest at FLIP_SHOWN."""
    levels = np.asarray(np.clip(error / FLIP_SHOWN, 0, 1) * 255 + 0.5, np.uint8)
    return np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO), np.uint8)


def bgr(image: Array) -> Picture:
    """Convert sRGB in 0..1 to 8-bit BGR for OpenCV."""
    return np.ascontiguousarray(np.asarray(image * 255 + 0.5, np.uint8)[..., ::-1])


def picture(test: Array, reference: Array, error: Array) -> Picture:
    """Return our image, the reference, FLIP and the signed difference, BGR [H, 4W, 3].

    In the signed difference, red means that our image is brighter and blue that it is darker.
    """
    signed = (test - reference).mean(axis=2)
    lean = np.stack([np.maximum(signed, 0), np.zeros_like(signed), np.maximum(-signed, 0)], axis=2)
    return np.hstack([bgr(test), bgr(reference), heat(error), bgr(np.clip(lean * 4, 0, 1))])


def contact_picture(rows: Sequence[tuple[Case, Panels]]) -> Picture:
    """Return two cases per row, each with our image, the reference and FLIP under captions."""
    tiles = []
    for case, (test, reference, error) in rows:
        state = (
            f"{'damaged' if case.damaged else 'undamaged'}, {'rusty' if case.rusty else 'clean'}"
        )
        names = (f"fastgen: {case.light}, {case.camera}, {state}", "Cycles, 1024 samples", "FLIP")
        panels = (bgr(test), bgr(reference), heat(error))
        tiles.append(np.hstack([_titled(p, n) for p, n in zip(panels, names, strict=True)]))
    if len(tiles) % 2:
        tiles.append(np.full_like(tiles[0], 255))
    gap = np.full((tiles[0].shape[0], 8, 3), 255, np.uint8)
    pairs = zip(tiles[::2], tiles[1::2], strict=True)
    body = np.vstack([np.hstack([left, gap, right]) for left, right in pairs])
    return np.vstack([body, _scale(body.shape[1])])


def _titled(panel: Picture, text: str) -> Picture:
    head = np.full((_HEAD_PX, panel.shape[1], 3), 255, np.uint8)
    _write(head, text, 4)
    return np.vstack([head, panel])


def _write(image: Picture, text: str, x: int) -> None:
    at = (x, _HEAD_PX - 8)
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA)


def _scale(width: int) -> Picture:
    """Return a colour bar of FLIP with its values."""
    strip = np.full((_HEAD_PX, width, 3), 255, np.uint8)
    bar = heat(np.repeat(np.linspace(0, FLIP_SHOWN, 300)[None], _HEAD_PX - 8, axis=0))
    _write(strip, "FLIP 0", 4)
    strip[4 : 4 + bar.shape[0], 70:370] = bar
    _write(strip, f"{FLIP_SHOWN:g} and more", 378)
    return strip


def write_picture(path: Path, image: Picture) -> None:
    """Write PNG, or JPEG at quality 88 if the name ends in .jpg."""
    path.parent.mkdir(parents=True, exist_ok=True)
    options = [cv2.IMWRITE_JPEG_QUALITY, 88] if path.suffix == ".jpg" else []
    if not cv2.imwrite(str(path), image, options):
        raise SystemExit(f"{path}: cannot write the image; check the folder and the file extension")
