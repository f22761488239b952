"""RGB9_E5: three nine-bit mantissas with one exponent, four bytes for a texel of radiance.

OpenGL 4.6 core specification, section 8.5.2 (Encoding of Special Internal Formats), and table 8.8
for the places of the bits (UNSIGNED_INT_5_9_9_9_REV).
"""

import numpy as np
from numpy.typing import NDArray

LARGEST = 65408.0
"""(2^9 - 1) / 2^9 * 2^(31 - 15)."""

_BITS, _BIAS = 9, 15
_BLOCK = 1 << 15  # colours at once, as a core's cache holds them


def packed(rgb: NDArray[np.floating]) -> NDArray[np.uint32]:
    """Colours [..., 3] of 0 to LARGEST as uint32 [...]; what is beyond is clamped."""
    colours = np.ascontiguousarray(rgb, np.float32).reshape(-1, 3)
    found = np.empty(len(colours), np.uint32)
    for first in range(0, len(colours), _BLOCK):
        part = slice(first, first + _BLOCK)
        found[part] = _packed_part(colours[part])
    return found.reshape(np.shape(rgb)[:-1])


def _packed_part(rgb: NDArray[np.float32]) -> NDArray[np.uint32]:
    colour = np.clip(np.ascontiguousarray(rgb.T), 0, np.float32(LARGEST))
    largest = colour.max(axis=0)
    # a float's own exponent counts from 1 to 2, ours from 1/2 to 1
    shared = np.maximum((largest.view(np.int32) >> 23) - 126 + _BIAS, 0)
    # a largest mantissa that rounds up to 2^9 asks for the next exponent
    shared += largest / _step(shared) + np.float32(0.5) >= 2**_BITS
    red, green, blue = (colour / _step(shared) + np.float32(0.5)).astype(np.uint32)  # rounds
    return np.asarray(red | green << 9 | blue << 18 | shared.astype(np.uint32) << 27, np.uint32)


def unpacked(values: NDArray[np.uint32]) -> NDArray[np.float32]:
    """The colours float32 [..., 3] of packed values [...]."""
    mantissas = np.stack([values >> shift & 511 for shift in (0, 9, 18)], axis=-1)
    return np.asarray(mantissas.astype(np.float32) * _step(values >> 27)[..., None])


def _step(shared: NDArray[np.integer]) -> NDArray[np.float32]:
    """What the last bit of a mantissa is worth, by its exponent as it is stored."""
    power = shared.astype(np.int32) - _BIAS - _BITS  # 2^power, by its bits
    return np.asarray((power + 127) << 23, np.int32).view(np.float32)
