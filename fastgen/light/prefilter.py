"""Area filters and convolutions of equirectangular maps.

All results are deterministic sums without random samples, so they contain no noise.

World z is up. An equirectangular map [H, W, 3] has u = 0.5 - atan2(y, x) / (2 pi) (mod 1) along a
row and v = acos(z) / pi from the top. Its middle column looks along +x; +y is a quarter turn to the
left.
"""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

_CHUNK_ROWS = 8


def equirect_directions(height: int) -> NDArray[np.float64]:
    """Return the unit directions [H, 2H, 3] of the texel centres of an equirectangular map."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    phi = np.pi - np.pi * (np.arange(2 * height) + 0.5) / height
    z = np.broadcast_to(np.cos(theta), (height, 2 * height))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), z], axis=-1)


def row_solid_angle(height: int) -> NDArray[np.float64]:
    """Return the solid angle in steradians of a texel in each row [H] of a map [H, 2H]."""
    return _row_spans(height) * np.pi / height


def _row_spans(height: int) -> NDArray[np.float64]:
    """Return the extent of each row [H] along z on the unit sphere."""
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    return edges[:-1] - edges[1:]


def shrink(radiance: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """Return equirectangular radiance [H, W, C] averaged over solid angle to [width/2, width, C].

    A narrower map keeps its width, but becomes exactly 2:1 with an even width.
    """
    height, wide = radiance.shape[:2]
    width = min(width, wide - wide % 2)
    if (height, wide) == (width // 2, width):
        return radiance
    # area resampling is separable: first the columns, then the rows weighted by solid angle
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
    """Return equirectangular radiance [H, W, 3] averaged along each row over 1 / sin(theta) texels.

    Texels are denser near the poles. The averages make a point sample there represent the same
    solid angle as at the horizon, so that samples do not miss a bright texel near the zenith. A
    texel in the polar row becomes about 10 % too bright, because bilinear lookups spread it over
    the next row.
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


def ggx_lobe(roughness: float) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the GGX lobe for a view along the normal, as a function of the cosine.

    The function gives the weight of radiance at an angle t from the mirror direction, up to a
    constant factor. A surface of GGX microfacets reflects the integral of D G2 / (4 n.v) over
    incoming directions, with alpha = roughness^2 (Walter et al. 2007, eq. 20). The view v is along
    the normal n, so the mirror direction is n and the half vector is at t/2. G2 is the masking of
    the light alone, G1(t) = 2 / (1 + sqrt(1 + alpha^2 tan^2 t)) (Heitz 2014, eq. 72 and 99).
    Without constant factors, D = 1 / ((1 - cos t) + alpha^2 (1 + cos t))^2, because
    cos^2(t/2) = (1 + cos t) / 2. The weight is 0 from t = 90 degrees on. Karis 2013 uses cos t for
    G1, which is narrower.
    """
    alpha_squared = roughness**4

    def lobe(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
        spread = (1.0 + alpha_squared) - (1.0 - alpha_squared) * cosine
        np.square(spread, out=spread)
        lit = np.maximum(cosine, 0.0)
        # 2 / (1 + sqrt(1 + alpha^2 tan^2 t)), numerator and denominator multiplied by cos t
        masked = np.sqrt(alpha_squared + (1.0 - alpha_squared) * lit * lit)
        masked += lit
        np.divide(lit, np.maximum(masked, 1e-12), out=lit)
        return np.divide(lit, spread, out=spread)

    return lobe


def cosine_lobe(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weight of Lambert's cosine law."""
    return np.maximum(cosine, 0.0)


def convolve(
    radiance: NDArray[np.float32], lobe: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.float32]:
    """Return the mean of radiance around every texel centre, weighted by a lobe.

    Between two rows the lobe depends only on the difference in longitude. The sum over the sphere
    is therefore a product of small matrices for each Fourier coefficient along the rows (the
    separation of Driscoll and Healy 1994, Computing Fourier Transforms and Convolutions on the
    2-Sphere). All weights are 0 or more, so there is no ringing.

    Args:
        radiance: float32 [H, 2H, C], equirectangular.
        lobe: Weight, 0 or more, of the cosine of the angle to the centre. It may cover the sphere.

    Returns:
        float32 [H, 2H, C].
    """
    import scipy.fft  # imported late: takes 0.1 s, and lights are usually cached

    height, width, channels = radiance.shape
    theta = np.pi * (np.arange(height) + 0.5) / height
    cosine_phi = np.cos(np.pi * np.arange(height + 1) / height)[:, None, None]
    # a float32 transform would add noise of 1e-7 of the sun to the whole sky
    weighted = radiance.astype(np.float64) * row_solid_angle(height)[:, None, None]
    wave = np.fft.rfft(weighted, axis=1)  # [H, F, C]
    wave = wave.transpose(1, 0, 2)
    # the lobe between two rows equals the lobe between their mirror images: half the rows suffice
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
