"""Map of the atlas cells in which a lookup of the material layers may touch a decal."""

import numpy as np
from numpy.typing import NDArray

from fastgen.render.constants import NEAR_CELL_MM
from fastgen.render.decal_tables import MARGIN_MM
from fastgen.render.zone_codes import DECAL_SHEET
from fastgen.scene.limits import DECAL_KINDS


def decals_near(
    table: NDArray[np.float32], atlas_size_mm: tuple[float, float], margin_mm: float = MARGIN_MM
) -> NDArray[np.uint32]:
    """Return the cells of the atlas that lie near a decal.

    A cell is 1 if any point in the cell lies within `margin_mm` of a decal. A few more cells around
    it may be 1 as well.

    Args:
        table: Rows of DecalTables.table that hold decals, float32 [N, DECAL_TEXELS, 4].
        atlas_size_mm: Width and height of the atlas.
        margin_mm: Distance from a decal within which pixels may show it.

    Returns:
        uint32 [rows, columns / 4], one byte per cell of side NEAR_CELL_MM. Each number holds four
        neighbouring cells, the first in the lowest byte.
    """
    columns, rows = (int(np.ceil(side / NEAR_CELL_MM)) for side in atlas_size_mm)
    found = np.zeros((rows, -(-columns // 4) * 4), np.uint8)
    # Distances are measured from a cell's centre; its farthest point is half a diagonal away.
    margin = margin_mm / NEAR_CELL_MM + 0.5**0.5
    for turn, place, _, (kind, *_), _ in table.tolist():
        (cos, sin), (x, y, *half) = turn[:2], (value / NEAR_CELL_MM for value in place)
        # A marker is a diamond. Its sides are diagonal, so its corners move out farther.
        is_marker = kind % DECAL_SHEET == DECAL_KINDS["marker"]
        reach = [side + margin * (2**0.5 if is_marker else 1.0) for side in half]
        wide = abs(cos) * reach[0] + abs(sin) * reach[1]
        high = abs(sin) * reach[0] + abs(cos) * reach[1]
        left, top = max(int(np.ceil(x - wide - 0.5)), 0), max(int(np.ceil(y - high - 0.5)), 0)
        window = found[top : max(int(y + high + 0.5), 0), left : max(int(x + wide + 0.5), 0)]
        if not is_marker and min(abs(cos), abs(sin)) == 0:
            window[:] = 1
            continue
        across = np.arange(left, left + window.shape[1]) + (0.5 - x)
        down = (np.arange(top, top + window.shape[0]) + (0.5 - y))[:, None]
        along, beside = np.abs(cos * across + sin * down), np.abs(cos * down - sin * across)
        if is_marker:
            window |= along + beside <= reach[0]
        else:
            window |= (along <= reach[0]) & (beside <= reach[1])
    return found.view("<u4").astype(np.uint32, copy=False)
