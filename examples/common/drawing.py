"""Drawing of detections onto images."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import torch

from common import charts
from common.data import Kept

_COLORS = ((255, 220, 0), (0, 200, 255), (255, 60, 60), (90, 255, 90), (255, 110, 255))
_MASK_SHARE = 0.35


def drawn(
    image: torch.Tensor,
    found: Mapping[str, torch.Tensor],
    names: Sequence[str],
    least_score: float,
) -> torch.Tensor:
    """Return a copy of an image uint8 [3, H, W] with its detections drawn on it.

    Draws box, class name and mask of each detection with a score of at least `least_score`. The
    first class gets no mask.
    """
    canvas = np.ascontiguousarray(image.permute(1, 2, 0).numpy())
    for i in (found["scores"] >= least_score).nonzero()[:, 0].tolist():
        label = int(found["labels"][i])
        color = _COLORS[(label - 1) % len(_COLORS)]
        if "masks" in found and label > 1:
            inside = found["masks"][i].numpy()
            tinted = canvas[inside] * (1 - _MASK_SHARE) + np.array(color) * _MASK_SHARE
            canvas[inside] = tinted.astype(np.uint8)
        x0, y0, x1, y1 = (round(v) for v in found["boxes"][i].tolist())
        cv2.rectangle(canvas, (x0, y0), (x1 - 1, y1 - 1), color, 1)
        at = (x0, max(y0 - 2, 9))
        cv2.putText(canvas, names[label - 1], at, cv2.FONT_HERSHEY_SIMPLEX, 0.33, color, 1)
    return torch.from_numpy(canvas.transpose(2, 0, 1).copy())


def found_pictures(
    data: Kept,
    found: Sequence[Mapping[str, torch.Tensor]],
    names: Sequence[str],
    least_score: float,
    path: Path,
    count: int = 8,
) -> None:
    """Write the first images of `data` with their detections as one PNG."""
    images = [drawn(data[i][0], found[i], names, least_score) for i in range(min(count, len(data)))]
    charts.pictures(images, [f"test image {i}" for i in range(len(images))], path)
