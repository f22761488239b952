"""Outlines of masks along the outer edges of their pixels."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""Corners [N, 2] of a closed polygon as x, y in pixels."""


def borders(mask: NDArray[np.bool_], holes: bool = True) -> list[list[Points]]:
    """Return the border of each part of a mask, followed by the borders of the part's holes.

    Borders run along the edges between pixels, so all coordinates are whole numbers. Pixels that
    touch at a corner belong to one part. Holes run in the opposite direction.

    Args:
        mask: bool [H, W].
        holes: Return the borders of holes and of parts inside holes. Otherwise holes are filled.
    """
    # contours run through pixel centres; at twice the size they round to the pixels' outer edges
    doubled = cv2.resize(mask.view(np.uint8), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    contours, tree = cv2.findContours(
        doubled, cv2.RETR_CCOMP if holes else cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
    )
    parts: dict[int, list[Points]] = {}
    inner: list[tuple[int, Points]] = []
    for number, contour in enumerate(contours):
        corners = (contour[:, 0] + 1) // 2
        moved = (corners != corners[np.arange(-1, len(corners) - 1)]).any(axis=1)
        points = corners[moved].astype(np.float64)
        outer = int(tree[0, number, 3])
        if outer < 0:
            parts[number] = [points]
        else:
            inner.append((outer, points))
    for outer, points in inner:
        parts[outer].append(points)
    return list(parts.values())


def joined(loops: Sequence[Points]) -> Points:
    """Return one closed polygon of several, with a bridge of zero width to each further one.

    A bridge connects nearest corners. Rasterizers that count crossings ignore it, because the
    polygon passes it once in each direction.
    """
    whole = loops[0]
    for loop in loops[1:]:
        gap = np.linalg.norm(whole[:, None] - loop[None], axis=-1)
        i, j = np.unravel_index(int(gap.argmin()), gap.shape)
        around = np.concatenate([loop[j:], loop[: j + 1]])
        whole = np.concatenate([whole[: i + 1], around, whole[i:]])
    return whole


def polygons(mask: NDArray[np.bool_]) -> list[Points]:
    """Return a polygon around each part of a mask, from which pycocotools makes the same mask.

    The border of a hole is joined to that of its part.

    Args:
        mask: bool [H, W].
    """
    return [joined(part) for part in borders(mask)]
