"""Places of charts in the atlas of a mesh."""

from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GUTTER_MM = 16.0
"""Space between charts: mip level 3 of a 2 mm texel does not mix neighbours."""


@dataclass(frozen=True, eq=False)
class Packing:
    """Places of boxes in the atlas.

    Attributes:
        corners: Lower left corners [N, 2].
        turned: bool [N], True for boxes turned by 90 degrees.
        size: Width and height of the atlas.
    """

    corners: Array
    turned: NDArray[np.bool_]
    size: tuple[float, float]


def packed(sizes: Array, last: NDArray[np.bool_]) -> Packing:
    """Return places for boxes [N, 2]; the atlas has the shortest longer side of several widths.

    Boxes of `last` bool [N] are placed after the others and do not change their places.
    """
    padded = np.ceil(sizes + GUTTER_MM)
    first = padded[~last]
    widest = float(first.max())
    width = min(
        np.linspace(widest, 2 * widest, 31).tolist(),
        key=lambda width: max(_shelves(first, last[~last], width).size),
    )
    packing = _shelves(padded, last, width)
    return replace(packing, corners=packing.corners + GUTTER_MM / 2)


def _shelves(padded: Array, last: NDArray[np.bool_], limit: float) -> Packing:
    """Place boxes on shelves no wider than `limit`.

    First-fit decreasing height (Coffman, Garey, Johnson and Tarjan 1980), except that a long part
    that fits on no shelf upright is turned and queued again by its new height.
    """
    corners = np.empty_like(padded)
    turned = np.zeros(len(padded), bool)
    waiting = [
        (late, -height, -width, i)
        for i, (late, width, height) in enumerate(np.column_stack([last, padded]).tolist())
    ]
    heapify(waiting)
    shelves: list[list[float]] = []
    top = 0.0
    while waiting:
        late, height, width, i = heappop(waiting)
        height, width = -height, -width
        shelf = next((s for s in shelves if s[0] + width <= limit and height <= s[2]), None)
        if shelf is None and height > 2 * width and not turned[i]:
            turned[i] = True
            heappush(waiting, (late, -width, -height, i))
            continue
        if shelf is None:
            shelf = [0.0, top, height]
            shelves.append(shelf)
            top += height
        corners[i] = shelf[:2]
        shelf[0] += width
    return Packing(corners, turned, (max(shelf[0] for shelf in shelves), top))
