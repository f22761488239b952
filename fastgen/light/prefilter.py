"""Spherical image operations behind environment.py: projections, area filters, convolutions.

Everything is a deterministic sum, without random samples, so a light never carries noise.

Conventions. World z is up. An equirectangular map [H, W, 3] has u = 0.5 - atan2(y, x) / (2 pi)
(mod 1) along a row and v = acos(z) / pi from the top, so its middle column looks along +x and +y
is a quarter turn to the left of it. An octahedral map (Cigolle et al. 2014, A Survey of Efficient
Representations for Independent Unit Vectors, JCGT 3(2), section 3.2) has row 0 at v = 0 and a
border of one texel, so that uv maps to (1 + uv * (N - 2)) / N of the texture and bilinear lookup is
seamless over the whole sphere. A levelled one is of (y, z, x) in place of (x, y, z).
"""

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

BORDER = 1

_BAND_SAMPLES = 1 << 17  # samples gathered at a time, as a core's cache holds them
_CHUNK_ROWS = 8


def octahedral_encode(direction: ArrayLike) -> NDArray[np.float64]:
    """Directions [..., 3] (any length above 0) to octahedral uv [..., 2] in [0, 1]."""
    return np.stack(_octahedral_uv(direction), axis=-1)


def _octahedral_uv(direction: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """As octahedral_encode, u and v [...] apart: along the last axis, of two or three, NumPy takes
    six times as long."""
    x, y, z = np.moveaxis(np.asarray(direction, np.float64), -1, 0)
    total = np.abs(x) + np.abs(y) + np.abs(z)
    x, y = x / total, y / total
    folded_x = (1.0 - np.abs(y)) * np.where(x < 0, -1.0, 1.0)
    folded_y = (1.0 - np.abs(x)) * np.where(y < 0, -1.0, 1.0)
    below = z < 0
    u, v = np.where(below, folded_x, x), np.where(below, folded_y, y)
    return u * 0.5 + 0.5, v * 0.5 + 0.5


def octahedral_decode(uv: ArrayLike) -> NDArray[np.float64]:
    """Octahedral uv [..., 2] in [0, 1] to unit directions [..., 3]."""
    f = np.asarray(uv, np.float64) * 2.0 - 1.0
    z = 1.0 - np.abs(f).sum(-1, keepdims=True)
    xy = f - np.where(f < 0, -1.0, 1.0) * np.maximum(-z, 0.0)
    n = np.concatenate([xy, z], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


@cache
def octahedral_texels(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions [size^2, 3] and relative solid angles [size^2] of the texels of an octahedral map
    without a border."""
    step = (np.arange(size) + 0.5) / size
    texels = octahedral_decode(np.stack(np.meshgrid(step, step), axis=-1)).reshape(-1, 3)
    # the octahedron's faces are equally far from its middle: a piece of one, at a distance r, fills
    # an angle in proportion to r^-3; on it |x| + |y| + |z| = 1, so that r is 1 / (|x| + |y| + |z|)
    return texels, np.abs(texels).sum(axis=1) ** 3


def equirect_directions(height: int) -> NDArray[np.float64]:
    """Unit directions [H, 2H, 3] of the texel centres of an equirectangular map."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    phi = np.pi - np.pi * (np.arange(2 * height) + 0.5) / height
    z = np.broadcast_to(np.cos(theta), (height, 2 * height))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), z], axis=-1)


def row_solid_angle(height: int) -> NDArray[np.float64]:
    """Solid angle [H], in steradian, of one texel in each row of an [H, 2H] equirectangular map."""
    return _row_spans(height) * np.pi / height


def _row_spans(height: int) -> NDArray[np.float64]:
    """How far each row [H] of an equirectangular map reaches along z on the unit sphere."""
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    return edges[:-1] - edges[1:]


def shrink(radiance: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """Equirectangular radiance [H, W, C] averaged over solid angle to at most [width/2, width, C].

    A map that is narrower already keeps its width, but becomes exactly 2:1 and even.
    """
    height, wide = radiance.shape[:2]
    width = min(width, wide - wide % 2)
    if (height, wide) == (width // 2, width):
        return radiance
    # area resampling is separable: columns first, then rows weighted by the solid angle they span
    narrow = _resize(radiance, height, width)
    span = _row_spans(height).astype(np.float32).reshape(-1, 1, 1)
    narrow *= span
    result = _resize(narrow, width // 2, width)
    result /= _resize(span, width // 2, 1)
    return result


def _resize(image: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    resized = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(resized, np.float32).reshape(height, width, image.shape[2])


def smooth_poles(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Equirectangular radiance [H, W, 3] averaged along each row over 1 / sin(theta) texels.

    Texels crowd near the poles; after this a point sample stands for as much solid angle there as
    at the horizon, so a bright texel near the zenith is not missed. (One in the polar row itself
    comes out about a tenth too strong: bilinear lookups spread it over the neighbouring row.)
    """
    height, width = radiance.shape[:2]
    smooth = radiance.copy()
    spread = 1.0 / np.sin(np.pi * (np.arange(height) + 0.5) / height)
    for row, texels in enumerate(2 * np.rint((spread - 1) / 2).astype(int) + 1):
        if texels >= 3:
            half = texels // 2
            wrapped = np.take(radiance[row], np.arange(-half, width + half), axis=0, mode="wrap")
            smooth[row] = cv2.blur(wrapped[None], (int(texels), 1))[0, half : half + width]
    return smooth


def levelled(direction: ArrayLike) -> NDArray[np.float64]:
    """Directions [..., 3] as those to look up in a map that was resampled with level=True."""
    return np.roll(np.asarray(direction, np.float64), -1, axis=-1)


def resample_octahedral(
    radiance: NDArray[np.float32], size: int, samples: int, level: bool = False
) -> NDArray[np.float32]:
    """Equirectangular radiance [H, 2H, 3] as a bordered octahedral map [size, size, 3].

    size: even. samples: each texel is the mean of samples x samples bilinear lookups spread over
    it; choose it so that they lie no further apart than a texel of the source. level: the map is
    turned so that the horizon lies along its rows and columns, y and z being its axes and x its
    middle: along its diagonals, an edge as of a bright sky gets teeth where it is enlarged.
    """
    assert size % 2 == 0, "the quarters of a map are alike"
    height, width = radiance.shape[:2]
    padded = np.empty((height + 2, width + 2, 3), np.float32)
    padded[1:-1, 1:-1] = radiance
    # beyond a pole the sphere continues on the opposite meridian
    padded[0, 1:-1] = np.roll(radiance[0], width // 2, axis=0)
    padded[-1, 1:-1] = np.roll(radiance[-1], width // 2, axis=0)
    padded[:, 0], padded[:, -1] = padded[:, -2], padded[:, 1]

    # a quarter of the map holds the angles of all: the others mirror it
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
        # octahedral_decode, without the unit length that no angle needs
        middle = 1.0 - along - across
        folded = np.maximum(-middle, 0.0)
        dx, dy, dz = along - folded, across - folded, middle
        if level:
            dx, dy, dz = dz, dx, dy
        turn = np.arctan2(dy, dx) * np.float32(width / (2 * np.pi))
        # arctan2 gives acos(z), exact at the poles
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
            rows[:] = _resize(np.asarray(taken, np.float32), last - first, 2 * half)
    fill_border(result)
    return result


def fill_border(octahedral: NDArray[np.float32]) -> None:
    """Give the border of a map [N, N, C], in place, the texels that adjoin it on the sphere.

    Over an edge of the square the map continues at the mirror point of the same edge.
    """
    m = octahedral
    m[0, 1:-1], m[-1, 1:-1] = m[1, -2:0:-1], m[-2, -2:0:-1]
    m[1:-1, 0], m[1:-1, -1] = m[-2:0:-1, 1], m[-2:0:-1, -2]
    m[0, 0], m[0, -1], m[-1, 0], m[-1, -1] = m[-2, -2], m[-2, 1], m[1, -2], m[1, 1]


def sample_octahedral(
    octahedral: NDArray[np.float32], direction: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Bilinear lookup, as GL does it, of a bordered map [N, N, C] by directions [K, 3]: [K, C], a
    channel after the other in memory."""
    size, channels = octahedral.shape[0], octahedral.shape[2]
    x, y = (BORDER + uv * (size - 2 * BORDER) - 0.5 for uv in _octahedral_uv(direction))
    column, row = (np.clip(np.floor(at).astype(np.intp), 0, size - 2) for at in (x, y))
    fx, fy = (x - column).astype(np.float32), (y - row).astype(np.float32)
    texels, first = octahedral.reshape(size * size, channels).T, row * size + column
    corners = np.array([0, 1, size, size + 1])[:, None]
    a, b, c, d = np.take(texels, first + corners, axis=1).swapaxes(0, 1)
    found: NDArray[np.float32] = (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy
    return found.T


def ggx_lobe(roughness: float) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Weight of radiance at angle t from the mirror direction, for view and normal along it.

    What a surface of GGX microfacets reflects is the integral of D G2 / (4 n.v) over incoming
    directions, with alpha = roughness^2 (Walter et al. 2007, eq. 20). With v = n the half vector
    lies at t/2 and G2 is the masking of the light alone, G1(t) = 2 / (1 + sqrt(1 + alpha^2 tan^2
    t)) (Heitz 2014, eq. 72 and 99). cos^2(t/2) = (1 + cos t) / 2 turns D into 1 / ((1 - cos t) +
    alpha^2 (1 + cos t))^2 up to a factor that normalisation removes. Karis 2013 has cos t for G1,
    which is narrower.
    """
    alpha_squared = roughness**4

    def lobe(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
        spread = (1.0 + alpha_squared) - (1.0 - alpha_squared) * cosine
        np.square(spread, out=spread)
        lit = np.maximum(cosine, 0.0)
        # 2 / (1 + sqrt(1 + alpha^2 tan^2 t)), multiplied by cos t above and below
        masked = np.sqrt(alpha_squared + (1.0 - alpha_squared) * lit * lit)
        masked += lit
        np.divide(lit, np.maximum(masked, 1e-12), out=lit)
        return np.divide(lit, spread, out=spread)

    return lobe


def cosine_lobe(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lambert's law."""
    return np.maximum(cosine, 0.0)


def convolve(
    radiance: NDArray[np.float32], lobe: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.float32]:
    """Mean of equirectangular radiance [H, 2H, C] around every texel centre, weighted by a lobe.

    lobe: weight at the cosine of the angle to the centre, 0 or more; it may be spread over the
    whole sphere. Between two rows such a lobe depends on the difference of longitude alone, so the
    sum over the sphere is a product of small matrices for each Fourier coefficient along the rows
    (Driscoll and Healy 1994, Computing Fourier Transforms and Convolutions on the 2-Sphere, use
    the same separation). Being a sum of weights of 0 or more it has no ringing.
    """
    import scipy.fft  # takes 0.1 s, and lights are kept on disk

    height, width, channels = radiance.shape
    theta = np.pi * (np.arange(height) + 0.5) / height
    cosine_phi = np.cos(np.pi * np.arange(height + 1) / height)[:, None, None]
    # double precision: a float32 transform would leave noise of 1e-7 of the sun all over the sky
    weighted = radiance.astype(np.float64) * row_solid_angle(height)[:, None, None]
    wave = np.fft.rfft(weighted, axis=1)  # [H, F, C]
    wave = wave.transpose(1, 0, 2)
    # a lobe between rows i and j equals that between their mirror images, so half the rows do
    both = np.concatenate([wave.real, wave.imag, wave.real[:, ::-1], wave.imag[:, ::-1]], axis=2)
    both = np.ascontiguousarray(both)
    solid_angle = row_solid_angle(height)
    result = np.empty((height, width, channels))
    for first in range(0, (height + 1) // 2, _CHUNK_ROWS):
        rows = np.arange(first, min(first + _CHUNK_ROWS, (height + 1) // 2))
        sines = np.sin(theta[rows])[:, None] * np.sin(theta)
        cosine = sines * cosine_phi + np.cos(theta[rows])[:, None] * np.cos(theta)
        # the transform of an even sequence of 2H values is a DCT-I of its first H + 1
        kernel = scipy.fft.dct(lobe(cosine), type=1, axis=0, overwrite_x=True)  # [F, rows, H]
        total = (kernel[0] @ solid_angle)[:, None, None]
        product = (kernel @ both).transpose(1, 0, 2)  # [rows, F, 4C]
        c = channels
        upper = product[..., :c] + 1j * product[..., c : 2 * c]
        lower = product[..., 2 * c : 3 * c] + 1j * product[..., 3 * c :]
        result[rows] = np.fft.irfft(upper, width, axis=1) / total
        result[height - 1 - rows] = np.fft.irfft(lower, width, axis=1) / total
    return np.maximum(result, 0.0).astype(np.float32)
