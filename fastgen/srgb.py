"""Transfer function of sRGB (IEC 61966-2-1), and its tables."""

import numpy as np
from numpy.typing import NDArray


def linear(encoded: float) -> float:
    """Return the linear light 0..1 of an encoded value 0..1.

    Scenes contain the result and must be the same on every machine. Python's power function is, but
    NumPy's may differ in the last bit between processors.
    """
    return encoded / 12.92 if encoded <= 0.04045 else float(((encoded + 0.055) / 1.055) ** 2.4)


def encoded(light: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the encoded values 0..1 of linear light 0..1, of any shape."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


DECODED = np.array([linear(code / 255) for code in range(256)], np.float32)
"""Linear light of each 8-bit code, float32 [256]."""

_STEPS = np.linspace(0, 1, 1 << 16)

ENCODED = np.rint(255 * encoded(_STEPS)).astype(np.uint8)
"""8-bit codes of linear light in steps of 1 / 65535, uint8 [65536]."""
