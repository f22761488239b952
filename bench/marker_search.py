"""Search for markers in whole images with a classifier of windows, at several scales."""

from typing import NamedTuple

import cv2
import numpy as np
from crop_networks import STRIDE, Classifier
from numpy.typing import NDArray
from panel_crops import MARGIN, Pixels
from rendered_crops import MARKER_PX

from fastgen.classes import MARKER_CLASSES

Boxes = NDArray[np.float64]
"""Boxes x0, y0, x1, y1 in pixels [N, 4]."""

_SIDES = (28, 36, 48, 64, 86, 115, 154)
"""Window sides in image pixels."""

_LEAST_SCORE = 0.02
_CANDIDATES = 400
_SAME_PLACE = 0.2


class Found(NamedTuple):
    """Markers found in an image, best first: boxes [N, 4], class numbers [N] and scores [N]."""

    boxes: Boxes
    classes: NDArray[np.int64]
    scores: NDArray[np.float64]


def search(model: Classifier, image: Pixels) -> Found:
    """Find markers in an image [H, W, 3]; of overlapping boxes only the best one is kept.

    The last class of the model is the background.
    """
    boxes, shares = [], []
    for side in _SIDES:
        scale = MARKER_PX / side
        size = tuple(int(n * scale) // STRIDE * STRIDE for n in image.shape[1::-1])
        if min(size) < MARKER_PX:
            continue
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        scores = model.window_shares(cv2.resize(image, size, interpolation=way).astype(np.uint8))
        rows, columns = np.nonzero(scores[..., : len(MARKER_CLASSES)].max(axis=2) > _LEAST_SCORE)
        corner = np.stack([columns, rows], axis=1) * STRIDE / scale
        rim = side * MARGIN / (1 + MARGIN) / 2
        boxes.append(np.concatenate([corner + rim, corner + side - rim], axis=1))
        shares.append(scores[rows, columns, : len(MARKER_CLASSES)])
    if not boxes:
        return Found(np.empty((0, 4)), np.empty(0, np.int64), np.empty(0))
    every, share = np.concatenate(boxes), np.concatenate(shares).astype(float)
    order = np.argsort(-share.max(axis=1))[:_CANDIDATES]
    kept: list[int] = []
    for k in order.tolist():
        if not len(kept) or overlap(every[k][None], every[kept]).max() < _SAME_PLACE:
            kept.append(k)
    return Found(every[kept], share[kept].argmax(axis=1), share[kept].max(axis=1))


def overlap(a: Boxes, b: Boxes) -> NDArray[np.float64]:
    """Return the intersection over union [N, M] of boxes [N, 4] and [M, 4]."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=2)
    sizes = [(x[:, 2:] - x[:, :2]).prod(axis=1) for x in (a, b)]
    union = sizes[0][:, None] + sizes[1][None] - shared
    return np.asarray(shared / np.maximum(union, 1e-9))


def true_scores(found: Found, boxes: Boxes, classes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return for each true marker the best score of a find of its class on it, or 0."""
    if not len(found.boxes) or not len(boxes):
        return np.zeros(len(boxes))
    right = (overlap(boxes, found.boxes) >= 0.35) & (classes[:, None] == found.classes)
    return np.asarray(np.where(right, found.scores, 0.0).max(axis=1))
