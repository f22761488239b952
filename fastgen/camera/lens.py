"""Lens distortion and its inverse; the numpy twin of shaders/lens.glsl.

Points are in focal lengths from the principal point. The undistorted ("ideal") point of a view
space point is (x / z, y / z). Brown-Conrady and fisheye models with OpenCV's coefficients. Far
outside the image the polynomials may fold back; there a straight line continues them, so that
points beside the image stay beside it.
"""

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.errors import ConfigError
from fastgen.scene.optics import Lens

Array = NDArray[np.float64]

_LEAST_SLOPE = 0.05
"""Derivative of image radius by ideal radius or angle below which the polynomial ends."""

_MARGIN = 1.3
"""The polynomial is used up to this multiple of the radius of the image corners if possible."""

_WIDEST_DEG = 78.0
"""Largest angle off the axis at the corners. Wider views reach the plane through the camera."""

_ROUNDS = 6
"""Newton steps for tangential distortion; each doubles the number of correct digits."""

_SETTLED = 1e-12
"""Error in focal lengths below which no further step is taken; an image is about one wide."""

_NUDGE = 1e-5
"""Offset to either side for numerical derivatives."""

_FIT_TERMS = 8

_MOST_STEPS = 6
"""Steps of the shader's inverse at most; each leaves a third of the error or less."""

_STEP_ERROR = 5e-6
"""Largest error of the inverse, as a share of half the image width. It is 0.01 pixels at 4096."""

PINHOLE: Mapping[str, ArrayLike] = MappingProxyType(
    {
        "lens_radial": np.zeros(4),
        "lens_inverse": np.zeros((2, 4)),
        "lens_tangential": (0.0, 0.0),
        "lens_steps": 1,
        "lens_model": 0.0,
        "lens_linear_from": (0.0, 0.0),
    }
)
"""Uniforms of shaders/lens.glsl without distortion, see Distortion.shader_values."""


def _cross(a: Array, b: Array) -> Array:
    """Return the cross product of plane vectors [..., 2], its component out of the plane."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], np.float64)


class Distortion:
    """Distortion of one lens over one image.

    Args:
        lens: Model and coefficients.
        half_size: (width, height) from the centre of the image, in focal lengths.

    Raises:
        ConfigError: The lens folds the image over, or its field of view is too wide to draw.
    """

    def __init__(self, lens: Lens, half_size: tuple[float, float]) -> None:
        self.lens = lens
        self._half_size = half_size
        radius = float(np.hypot(*half_size))
        self._fisheye = lens.model == "fisheye"
        c = lens.coefficients
        self._k = np.array(c if self._fisheye else (c[0], c[1], c[4], 0.0), np.float64)
        self._p = (0.0, 0.0) if self._fisheye else (c[2], c[3])
        # tangential terms move the corner as well
        need = radius * (1 + 3 * radius * max(map(abs, self._p)))
        table = np.linspace(0, np.pi / 2 if self._fisheye else 8.0, 8193)
        steep = self._slope(table) >= _LEAST_SLOPE
        end = len(table) if steep.all() else int(np.argmin(steep))
        table = table[: max(end, 2)]
        bent = self._curve(table)
        if bent[-1] < need and not steep.all():
            raise ConfigError(
                "lens: its distortion folds the image over before the corners; "
                "check the coefficients, or take a larger focal_mm"
            )
        last = min(int(np.searchsorted(bent, _MARGIN * need)), len(table) - 1)
        self._table, self._bent = table[: last + 1], bent[: last + 1]
        self._end, self._end_bent = float(table[last]), float(bent[last])
        self._end_slope = float(self._slope(table[last]))
        if self._folds():
            raise ConfigError(
                "lens: its tangential distortion folds the image over; give p1 and p2 nearer to 0"
            )
        corner = float(np.interp(need, bent, table))
        widest = np.degrees(corner if self._fisheye else np.arctan(corner))
        if widest > _WIDEST_DEG:
            raise ConfigError(
                f"lens: the image's corners look {widest:.0f} degrees off the axis, and up to "
                f"{_WIDEST_DEG:.0f} can be drawn; take a larger focal_mm"
            )

    def apply(self, ideal: ArrayLike) -> Array:
        """Return the distorted positions of ideal points [..., 2]."""
        points = np.asarray(ideal, np.float64)
        # NumPy is slow along short axes
        x, y = np.ascontiguousarray(points[..., 0]), np.ascontiguousarray(points[..., 1])
        radius = np.sqrt(x * x + y * y)
        t = np.arctan(radius) if self._fisheye else radius
        inner = np.minimum(t, self._end)
        bent = self._curve(inner) + self._end_slope * (t - inner)
        scale = np.where(radius > 1e-12, bent / np.maximum(radius, 1e-12), 1.0)
        seen = np.empty(points.shape)
        across, down = x * scale, y * scale
        if any(self._p):
            # tangential distortion, which is constant beyond the end of the polynomial
            inside = np.minimum(1.0, self._end / np.maximum(radius, 1e-12))
            right, below = self._tangential(x * inside, y * inside)
            across += right
            down += below
        seen[..., 0], seen[..., 1] = across, down
        return seen

    def remove(self, seen: ArrayLike) -> Array:
        """Return the ideal points of distorted positions [..., 2]: the inverse of `apply`."""
        points = np.asarray(seen, np.float64)
        ideal = self._straight(points)
        if any(self._p):
            for _ in range(_ROUNDS):
                off = self.apply(ideal) - points
                if np.abs(off).max(initial=0) < _SETTLED:
                    break
                along, across = self._slopes(ideal)
                area = _cross(along, across)
                area = np.where(np.abs(area) < _LEAST_SLOPE**2, 1.0, area)  # at a fold
                step = np.stack([_cross(off, across), _cross(along, off)], axis=-1)
                ideal = ideal - step / area[..., None]
        return ideal

    @cached_property
    def reach(self) -> Array:
        """Half of the size [2] of a rectangle around the ideal points of the whole image."""
        along = np.linspace(-1, 1, 33)
        edge = np.ones_like(along)
        # the image is not folded, so its border bounds it
        sides = [(along, edge), (along, -edge), (edge, along), (-edge, along)]
        ideal = self.remove(np.moveaxis(np.array(sides), 1, 2) * self._half_size)
        return np.asarray(1.05 * np.abs(ideal).max(axis=(0, 1)))

    @cached_property
    def half_width(self) -> float:
        """Distance of the ideal point of the middle of the left border from the principal point."""
        return float(np.linalg.norm(self.remove([-self._half_size[0], 0.0])))

    def _slopes(self, ideal: Array) -> tuple[Array, Array]:
        """Return the derivatives [..., 2] of `apply` by x and by y of the ideal point."""
        # one call for all four, because most calls have few points
        beside = np.stack([ideal + nudge for nudge in np.array([*np.eye(2), *-np.eye(2)]) * _NUDGE])
        right, down, left, up = self.apply(beside)
        return (right - left) / (2 * _NUDGE), (down - up) / (2 * _NUDGE)

    def _folds(self) -> bool:
        """Return whether two ideal points share a position in the image."""
        t = self._table[1:]
        # radial distortion stretches by its slope along the radius and by curve / t across it;
        # derivatives of tangential distortion are at most 8 |p| r, so below this bound no fold
        # can occur
        if 8 * np.hypot(*self._p) * self._end < min(
            self._slope(t).min(), (self._curve(t) / t).min()
        ):
            return False
        turn = np.linspace(0, 2 * np.pi, 128, endpoint=False)
        ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        ideal = np.linspace(0, self._end, 65)[1:, None, None] * ring
        seen = self.apply(ideal)
        inside = (np.abs(seen) <= self._half_size).all(axis=-1)
        ideal, seen = ideal[inside], seen[inside]
        if (_cross(*self._slopes(ideal)) < _LEAST_SLOPE**2).any():
            return True
        return bool(np.abs(self.remove(seen) - ideal).max() > 1e-6)

    @cached_property
    def shader_values(self) -> Mapping[str, ArrayLike]:
        """Uniforms of shaders/lens.glsl.

        The shader's inverse uses a fit over the whole image: the ratio of distorted to ideal radius
        as a polynomial in the squared distorted radius.
        """
        t = np.linspace(0, self._end, 65)[1:]
        seen, ideal = self._curve(t), np.tan(t) if self._fisheye else t
        basis = np.polynomial.polynomial.polyvander(seen**2, _FIT_TERMS - 1)
        fit, *_ = np.linalg.lstsq(basis, seen / ideal, rcond=None)
        return {
            "lens_radial": self._k,
            "lens_inverse": fit.reshape(2, 4),
            "lens_tangential": self._p,
            "lens_steps": self._tangential_steps,
            "lens_model": 2.0 if self._fisheye else 1.0,
            "lens_linear_from": (self._end, self._end_slope),
        }

    @property
    def _tangential_steps(self) -> int:
        """Fixed-point steps that the shader's inverse needs for tangential distortion."""
        if not any(self._p):
            return 1
        x, y = np.meshgrid(*(np.linspace(-1, 1, 9),) * 2)
        seen = np.stack([x, y], axis=-1) * self._half_size
        ideal, at = self.remove(seen), self._straight(seen)
        for steps in range(1, _MOST_STEPS):
            moved = np.stack(self._tangential(at[..., 0], at[..., 1]), axis=-1)
            at = self._straight(seen - moved)
            if np.abs(at - ideal).max() < _STEP_ERROR * self._half_size[0]:
                return steps
        return _MOST_STEPS

    def _tangential(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the tangential distortion of ideal points along x and y."""
        p1, p2 = self._p
        q = x * x + y * y
        twice = 2 * x * y
        return p1 * twice + p2 * (q + 2 * x * x), p1 * (q + 2 * y * y) + p2 * twice

    def _curve(self, t: Array) -> Array:
        """Return the image radius of an ideal radius, or of an angle for a fisheye."""
        k1, k2, k3, k4 = self._k
        q = t * t
        return np.asarray(t * (1 + q * (k1 + q * (k2 + q * (k3 + q * k4)))), np.float64)

    def _slope(self, t: Array) -> Array:
        k1, k2, k3, k4 = self._k * (3, 5, 7, 9)
        q = t * t
        return np.asarray(1 + q * (k1 + q * (k2 + q * (k3 + q * k4))), np.float64)

    def _straight(self, seen: Array) -> Array:
        """Invert the radial part by a table and Newton steps."""
        radius = np.hypot(seen[..., 0], seen[..., 1])
        inner = np.minimum(radius, self._end_bent)
        t = np.interp(inner, self._bent, self._table)
        for _ in range(3):
            t = t - (self._curve(t) - inner) / self._slope(t)
        t = t + (radius - inner) / self._end_slope
        ideal = np.tan(np.minimum(t, np.pi / 2 - 1e-6)) if self._fisheye else t
        scale = np.divide(ideal, radius, out=np.ones_like(ideal), where=radius > 1e-12)
        return np.asarray(seen * scale[..., None], np.float64)
