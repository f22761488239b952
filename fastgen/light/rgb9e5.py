"""RGB9_E5 encoding of radiance: three 9-bit mantissas and a shared exponent in four bytes.

OpenGL 4.6 core specification, section 8.5.2 (Encoding of Special Internal Formats), and table 8.8
for the bit positions (UNSIGNED_INT_5_9_9_9_REV).
"""

import numpy as np
from numpy.typing import NDArray

LARGEST = 65408.0
"""Largest representable value, (2^9 - 1) / 2^9 * 2^(31 - 15)."""

_BITS, _BIAS = 9, 15
_BLOCK = 1 << 15  # colours at a time; they fit the cache of a core


def packed(rgb: NDArray[np.floating]) -> NDArray[np.uint32]:
    """Return colours [..., 3], clamped to 0..LARGEST, as uint32 [...]."""
    colours = np.ascontiguousarray(rgb, np.float32).reshape(-1, 3)
    found = np.empty(len(colours), np.uint32)
    for first in range(0, len(colours), _BLOCK):
        part = slice(first, first + _BLOCK)
        found[part] = _packed_part(colours[part])
    return found.reshape(np.shape(rgb)[:-1])


def _packed_part(rgb: NDArray[np.float32]) -> NDArray[np.uint32]:
    colour = np.clip(np.ascontiguousarray(rgb.T), 0, np.float32(LARGEST))
    largest = colour.max(axis=0)
    # the mantissa of a float is in 1..2, here it is in 1/2..1
    shared = np.maximum((largest.view(np.int32) >> 23) - 126 + _BIAS, 0)
    # a mantissa that rounds up to 2^9 needs the next exponent
    shared += largest / _step(shared) + np.float32(0.5) >= 2**_BITS
    red, green, blue = (colour / _step(shared) + np.float32(0.5)).astype(np.uint32)  # rounds
    return np.asarray(red | green << 9 | blue << 18 | shared.astype(np.uint32) << 27, np.uint32)


def unpacked(values: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Return the colours float32 [..., 3] of packed values uint32 [...]."""
    mantissas = np.stack([values >> shift & 511 for shift in (0, 9, 18)], axis=-1)
    return np.asarray(mantissas.astype(np.float32) * _step(values >> 27)[..., None])


def _step(shared: NDArray[np.integer]) -> NDArray[np.float32]:
    """Return the value of the last bit of a mantissa, by its stored exponent."""
    power = shared.astype(np.int32) - _BIAS - _BITS  # 2^power is built from its bits
    return np.asarray((power + 127) << 23, np.int32).view(np.float32)
