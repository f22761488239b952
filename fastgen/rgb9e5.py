"""RGB9_E5: three nine-bit mantissas with one exponent, four bytes for a texel of radiance.

OpenGL 4.6 core specification, section 8.5.2 (Encoding of Special Internal Formats), and table 8.8
for the places of the bits (UNSIGNED_INT_5_9_9_9_REV).
"""

import numpy as np
from numpy.typing import NDArray

LARGEST = 65408.0
"""(2^9 - 1) / 2^9 * 2^(31 - 15)."""

_BITS, _BIAS = 9, 15


def packed(rgb: NDArray[np.floating]) -> NDArray[np.uint32]:
    """Colours [..., 3] of 0 to LARGEST as uint32 [...]; what is beyond is clamped."""
    colour = np.clip(rgb, 0, LARGEST).astype(np.float32)
    largest = np.maximum.reduce(np.moveaxis(colour, -1, 0))
    _, exponent = np.frexp(largest)  # largest = m 2^exponent with m in 0.5 to 1
    shared = np.where(largest > 0, np.maximum(exponent + _BIAS, 0), 0)
    step = _step(shared)
    # a largest mantissa that rounds up to 2^9 asks for the next exponent
    over = np.floor(largest / step + 0.5) >= 2**_BITS
    shared = shared + over
    step = np.where(over, 2 * step, step)
    red, green, blue = np.floor(np.moveaxis(colour, -1, 0) / step + 0.5).astype(np.uint32)
    return np.asarray(red | green << 9 | blue << 18 | shared.astype(np.uint32) << 27, np.uint32)


def unpacked(values: NDArray[np.uint32]) -> NDArray[np.float32]:
    """The colours float32 [..., 3] of packed values [...]."""
    mantissas = np.stack([values >> shift & 511 for shift in (0, 9, 18)], axis=-1)
    return np.asarray(mantissas.astype(np.float32) * _step(values >> 27)[..., None])


def _step(shared: NDArray[np.integer]) -> NDArray[np.float32]:
    """What the last bit of a mantissa is worth, by its exponent as it is stored."""
    return np.ldexp(np.float32(1), shared.astype(np.int32) - _BIAS - _BITS).astype(np.float32)
