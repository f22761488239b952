"""Octahedral maps of the sphere; the numpy twin of shaders/octahedral.glsl.

Cigolle et al. 2014, A Survey of Efficient Representations for Independent Unit Vectors, JCGT 3(2),
section 3.2. Row 0 of a map [N, N, C] is at v = 0. Maps with a border of one texel have uv at
(1 + uv * (N - 2)) / N of the texture, which makes bilinear lookups seamless over the whole sphere.
A levelled map uses (y, z, x) in place of (x, y, z).
"""

from functools import cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

BORDER = 1

_BAND_SAMPLES = 1 << 17  # samples at a time; they fit the cache of a core


def octahedral_encode(direction: ArrayLike) -> NDArray[np.float64]:
    """Return the octahedral uv [..., 2], 0..1, of directions [..., 3] of any length above 0."""
    return np.stack(_octahedral_uv(direction), axis=-1)


def _octahedral_uv(direction: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return u and v [...] separately; along a short last axis NumPy is six times slower."""
    x, y, z = np.moveaxis(np.asarray(direction, np.float64), -1, 0)
    total = np.abs(x) + np.abs(y) + np.abs(z)
    x, y = x / total, y / total
    folded_x = (1.0 - np.abs(y)) * np.where(x < 0, -1.0, 1.0)
    folded_y = (1.0 - np.abs(x)) * np.where(y < 0, -1.0, 1.0)
    below = z < 0
    u, v = np.where(below, folded_x, x), np.where(below, folded_y, y)
    return u * 0.5 + 0.5, v * 0.5 + 0.5


def octahedral_decode(uv: ArrayLike) -> NDArray[np.float64]:
    """Return the unit directions [..., 3] of octahedral uv [..., 2], 0..1."""
    f = np.asarray(uv, np.float64) * 2.0 - 1.0
    z = 1.0 - np.abs(f).sum(-1, keepdims=True)
    xy = f - np.where(f < 0, -1.0, 1.0) * np.maximum(-z, 0.0)
    n = np.concatenate([xy, z], axis=-1)
    unit: NDArray[np.float64] = n / np.linalg.norm(n, axis=-1, keepdims=True)
    return unit


@cache
def octahedral_texels(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the texels of a map without a border.

    Returns:
        Directions float64 [size^2, 3] and relative solid angles float64 [size^2].
    """
    step = (np.arange(size) + 0.5) / size
    texels = octahedral_decode(np.stack(np.meshgrid(step, step), axis=-1)).reshape(-1, 3)
    # all faces of the octahedron are equally far from its centre, so a piece of a face at distance
    # r subtends a solid angle proportional to r^-3; on a face |x| + |y| + |z| = 1, so r is
    # 1 / (|x| + |y| + |z|) of the unit direction
    return texels, np.abs(texels).sum(axis=1) ** 3


def levelled(direction: ArrayLike) -> NDArray[np.float64]:
    """Return the lookup directions [..., 3] for a map that was resampled with level=True."""
    return np.roll(np.asarray(direction, np.float64), -1, axis=-1)


def resample_octahedral(
    radiance: NDArray[np.float32], size: int, samples: int, level: bool = False
) -> NDArray[np.float32]:
    """Resample an equirectangular map as an octahedral map with a border.

    Args:
        radiance: float32 [H, 2H, 3], equirectangular as in prefilter.py.
        size: Texels along a side, even.
        samples: Each texel is the mean of samples x samples bilinear lookups. Choose it so that
            they are no further apart than a texel of the source.
        level: Turn the map so that the horizon runs along its rows and columns, with the axes y and
            z and x in the middle. An enlarged edge along a diagonal of the map looks jagged.

    Returns:
        float32 [size, size, 3].
    """
    assert size % 2 == 0, "the four quarters of a map must be equal"
    height, width = radiance.shape[:2]
    padded = np.empty((height + 2, width + 2, 3), np.float32)
    padded[1:-1, 1:-1] = radiance
    # beyond a pole the sphere continues on the opposite meridian
    padded[0, 1:-1] = np.roll(radiance[0], width // 2, axis=0)
    padded[-1, 1:-1] = np.roll(radiance[-1], width // 2, axis=0)
    padded[:, 0], padded[:, -1] = padded[:, -2], padded[:, 1]

    # one quarter of the map has all angles, and the others mirror it
    half = size // 2 - BORDER
    result = np.empty((size, size, 3), np.float32)
    inside = result[BORDER:-BORDER, BORDER:-BORDER]
    along = np.linspace(0.0, 1.0, 2 * half * samples + 1, dtype=np.float32)[1::2]
    band = max(_BAND_SAMPLES // (2 * half * samples * samples), 1)
    # texel centres lie at half integers, and the padding shifts by one
    ahead, behind = np.float32(width / 2 + 0.5), np.float32(width + 0.5)
    for first in range(0, half, band):
        last = min(first + band, half)
        across = along[first * samples : last * samples, None]
        # octahedral_decode without normalization, which angles do not need
        middle = 1.0 - along - across
        folded = np.maximum(-middle, 0.0)
        dx, dy, dz = along - folded, across - folded, middle
        if level:
            dx, dy, dz = dz, dx, dy
        turn = np.arctan2(dy, dx) * np.float32(width / (2 * np.pi))
        # arctan2 gives acos(z) and is exact at the poles
        top = np.arctan2(np.hypot(dx, dy), dz) * np.float32(height / np.pi) + np.float32(0.5)
        over, under = inside[half + first : half + last], inside[half - last : half - first][::-1]
        if level:
            sides = (ahead + turn, ahead - turn)
            places = ((over, sides, top), (under, sides, np.float32(height + 1) - top))
        else:
            places = (
                (over, (np.float32(0.5) + turn, ahead - turn), top),
                (under, (behind - turn, ahead + turn), top),
            )
        for rows, (left, right), y in places:
            x = np.concatenate([left[:, ::-1], right], axis=1)
            y = np.concatenate([y[:, ::-1], y], axis=1)
            taken = cv2.remap(padded, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            rows[:] = cv2.resize(taken, (2 * half, last - first), interpolation=cv2.INTER_AREA)
    fill_border(result)
    return result


def fill_border(octahedral: NDArray[np.float32]) -> None:
    """Fill the border of a map [N, N, C], in place, with the adjacent texels on the sphere.

    Beyond an edge of the square the map continues at the mirrored position of the same edge.
    """
    m = octahedral
    m[0, 1:-1], m[-1, 1:-1] = m[1, -2:0:-1], m[-2, -2:0:-1]
    m[1:-1, 0], m[1:-1, -1] = m[-2:0:-1, 1], m[-2:0:-1, -2]
    m[0, 0], m[0, -1], m[-1, 0], m[-1, -1] = m[-2, -2], m[-2, 1], m[1, -2], m[1, 1]


def sample_octahedral(
    octahedral: NDArray[np.float32], direction: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Look up a map with a border bilinearly, as OpenGL does.

    Args:
        octahedral: float32 [N, N, C].
        direction: [K, 3], any length above 0.

    Returns:
        float32 [K, C], one channel after the other in memory.
    """
    size, channels = octahedral.shape[0], octahedral.shape[2]
    x, y = (BORDER + uv * (size - 2 * BORDER) - 0.5 for uv in _octahedral_uv(direction))
    column, row = (np.clip(np.floor(at).astype(np.intp), 0, size - 2) for at in (x, y))
    fx, fy = (x - column).astype(np.float32), (y - row).astype(np.float32)
    texels, first = octahedral.reshape(size * size, channels).T, row * size + column
    corners = np.array([0, 1, size, size + 1])[:, None]
    a, b, c, d = np.take(texels, first + corners, axis=1).swapaxes(0, 1)
    found: NDArray[np.float32] = (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy
    return found.T
