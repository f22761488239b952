"""sRGB's transfer function as tables, IEC 61966-2-1."""

import numpy as np

_CODES = np.arange(256) / 255
_STEPS = np.linspace(0, 1, 1 << 16)

DECODED = np.where(_CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4).astype(
    np.float32
)
"""Linear light, float32 [256], of each 8-bit code."""

ENCODED = np.rint(
    255 * np.where(_STEPS <= 0.0031308, 12.92 * _STEPS, 1.055 * _STEPS ** (1 / 2.4) - 0.055)
).astype(np.uint8)
"""8-bit codes, uint8 [65536], of linear light in steps of 1 / 65535."""
