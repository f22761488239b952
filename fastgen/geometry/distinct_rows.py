"""Distinct rows of an array in a fifth of the time of np.unique(rows, axis=0)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

_ODD = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Multipliers of Fibonacci hashing and of xxHash64. They are odd, so no bit is lost."""


def distinct_rows(rows: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the distinct rows of an array.

    Args:
        rows: [V, 3], finite numbers of 4 or 8 bytes.

    Returns:
        Indices [D] of the first occurrence of each distinct row, in an order without meaning that
        depends on the rows only; and the number [V] of each row among the distinct ones.
    """
    unsigned = {4: np.uint32, 8: np.uint64}[rows.dtype.itemsize]
    bits = np.ascontiguousarray(rows + rows.dtype.type(0)).view(unsigned)  # -0 becomes 0
    mixed = bits.astype(np.uint64) * _ODD
    code = (mixed ^ mixed >> np.uint64(29)).sum(axis=1, dtype=np.uint64)
    _, first, which = np.unique(code, return_index=True, return_inverse=True)
    if not np.array_equal(rows[first][which], rows):  # two different rows share a code
        _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, which.ravel()
