"""Where on the atlas a lookup of the material layers may meet a decal; elsewhere it is plain."""

import numpy as np
from numpy.typing import NDArray

from fastgen.render.decal_tables import MARGIN_MM
from fastgen.render.programs import NEAR_CELL_MM
from fastgen.scene.limits import DECAL_KINDS


def decals_near(
    table: NDArray[np.float32], atlas_size_mm: tuple[float, float]
) -> NDArray[np.uint32]:
    """Cells of NEAR_CELL_MM of the atlas, a byte each: 1 where any point of a cell is no farther
    from a decal than antialiasing reaches, decal_tables.MARGIN_MM; some beside those too. As the
    shader reads them, uint32 [rows, columns / 4]: four a number, the first in its lowest byte.

    table: as of decal_tables.DecalTables, without rows that are no decal's.
    """
    columns, rows = (int(np.ceil(side / NEAR_CELL_MM)) for side in atlas_size_mm)
    found = np.zeros((rows, -(-columns // 4) * 4), np.uint8)
    # from the middle of a cell; no point of it is farther from there
    margin = MARGIN_MM / NEAR_CELL_MM + 0.5**0.5
    for turn, place, _, (kind, *_), _ in table.tolist():
        (cos, sin), (x, y, *half) = turn[:2], (value / NEAR_CELL_MM for value in place)
        # the four sides of a marker, on its point, lie aslant
        is_marker = kind == DECAL_KINDS["marker"]
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
