"""Lens distortion: points of the ideal image plane to where a lens puts them, and back.

Points are in focal lengths from the principal point: an ideal one is (x / z, y / z) in view space.
Formulas are OpenCV's, in and around the image; farther out they may fold back on themselves, and go
on as straight lines instead, so that what lies far beside the image stays beside it.
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
"""Of image radius by ideal radius or angle; where it falls below, the formula ends."""

_MARGIN = 1.3
"""The formula holds up to this many times the radius of the image's corners, if it can."""

_WIDEST_DEG = 78.0
"""Off the axis at the corners; wider, what is drawn would meet the plane through the camera."""

_ROUNDS = 6
"""Of Newton's iteration for tangential distortion; each doubles the digits."""

_NUDGE = 1e-5
"""Of ideal points, to either side, for slopes."""

_FIT_TERMS = 8

PINHOLE: Mapping[str, ArrayLike] = MappingProxyType(
    {
        "lens_radial": np.zeros(4),
        "lens_back": np.zeros((2, 4)),
        "lens_tangential": (0.0, 0.0),
        "lens_model": 0.0,
        "lens_end": (0.0, 0.0),
    }
)
"""What shaders/lens.glsl needs where there is no lens, see Distortion.shader_values."""


def _cross(a: Array, b: Array) -> Array:
    """Third component of the cross products of vectors [..., 2]."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], np.float64)


class Distortion:
    """A lens on an image of half_size (width, height), in focal lengths from its middle.

    Raises ConfigError where the lens folds the image over, or sees farther to the side than can be
    drawn.
    """

    def __init__(self, lens: Lens, half_size: tuple[float, float]) -> None:
        self.lens = lens
        radius = float(np.hypot(*half_size))
        self._fisheye = lens.model == "fisheye"
        c = lens.coefficients
        self._k = np.array(c if self._fisheye else (c[0], c[1], c[4], 0.0), np.float64)
        self._p = (0.0, 0.0) if self._fisheye else (c[2], c[3])
        # tangential terms move a corner too
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
        if self._folds(half_size):
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
        """Where the lens puts ideal points [..., 2]."""
        points = np.asarray(ideal, np.float64)
        radius = np.hypot(points[..., 0], points[..., 1])
        t = np.arctan(radius) if self._fisheye else radius
        inner = np.minimum(t, self._end)
        bent = self._curve(inner) + self._end_slope * (t - inner)
        scale = np.divide(bent, radius, out=np.ones_like(bent), where=radius > 1e-12)
        return points * scale[..., None] + self._shift(points)

    def remove(self, seen: ArrayLike) -> Array:
        """The ideal points of what is seen at [..., 2]: the inverse of `apply`."""
        points = np.asarray(seen, np.float64)
        ideal = self._straight(points)
        if any(self._p):
            for _ in range(_ROUNDS):
                along, across = self._slopes(ideal)
                off = self.apply(ideal) - points
                area = _cross(along, across)
                area = np.where(np.abs(area) < _LEAST_SLOPE**2, 1.0, area)  # at a fold
                step = np.stack([_cross(off, across), _cross(along, off)], axis=-1)
                ideal = ideal - step / area[..., None]
        return ideal

    def _slopes(self, ideal: Array) -> tuple[Array, Array]:
        """Derivatives [..., 2] of `apply` by an ideal point's x and y."""
        x, y = (
            (self.apply(ideal + nudge) - self.apply(ideal - nudge)) / (2 * _NUDGE)
            for nudge in np.eye(2) * _NUDGE
        )
        return x, y

    def _folds(self, half_size: tuple[float, float]) -> bool:
        """Whether two ideal points are seen at one place of the image."""
        t = self._table[1:]
        # radial distortion stretches by its slope along a radius, by curve / t across it, and
        # tangential distortion's derivatives are no more than 8 |p| r: short of that, none fold
        if 8 * np.hypot(*self._p) * self._end < min(
            self._slope(t).min(), (self._curve(t) / t).min()
        ):
            return False
        turn = np.linspace(0, 2 * np.pi, 128, endpoint=False)
        ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        ideal = np.linspace(0, self._end, 65)[1:, None, None] * ring
        seen = self.apply(ideal)
        inside = (np.abs(seen) <= half_size).all(axis=-1)
        ideal, seen = ideal[inside], seen[inside]
        if (_cross(*self._slopes(ideal)) < _LEAST_SLOPE**2).any():
            return True
        return bool(np.abs(self.remove(seen) - ideal).max() > 1e-6)

    @cached_property
    def shader_values(self) -> Mapping[str, ArrayLike]:
        """What shaders/lens.glsl needs of it.

        The way back is fitted there: seen over ideal radius, as a polynomial of the seen radius
        squared, over all of the image.
        """
        t = np.linspace(0, self._end, 65)[1:]
        seen, ideal = self._curve(t), np.tan(t) if self._fisheye else t
        basis = np.polynomial.polynomial.polyvander(seen**2, _FIT_TERMS - 1)
        fit, *_ = np.linalg.lstsq(basis, seen / ideal, rcond=None)
        return {
            "lens_radial": self._k,
            "lens_back": fit.reshape(2, 4),
            "lens_tangential": self._p,
            "lens_model": 2.0 if self._fisheye else 1.0,
            "lens_end": (self._end, self._end_slope),
        }

    def _curve(self, t: Array) -> Array:
        """Image radius by ideal radius, or by angle where the lens is a fisheye."""
        k1, k2, k3, k4 = self._k
        q = t * t
        return np.asarray(t * (1 + q * (k1 + q * (k2 + q * (k3 + q * k4)))), np.float64)

    def _slope(self, t: Array) -> Array:
        k1, k2, k3, k4 = self._k * (3, 5, 7, 9)
        q = t * t
        return np.asarray(1 + q * (k1 + q * (k2 + q * (k3 + q * k4))), np.float64)

    def _shift(self, ideal: Array) -> Array | float:
        """Tangential distortion, constant from where the formula ends."""
        p1, p2 = self._p
        if not (p1 or p2):
            return 0.0
        radius = np.hypot(ideal[..., 0], ideal[..., 1])
        inside = np.minimum(1.0, self._end / np.maximum(radius, 1e-12))
        x, y = np.moveaxis(ideal * inside[..., None], -1, 0)
        q = x * x + y * y
        across = 2 * p1 * x * y + p2 * (q + 2 * x * x)
        down = p1 * (q + 2 * y * y) + 2 * p2 * x * y
        return np.stack([across, down], axis=-1)

    def _straight(self, seen: Array) -> Array:
        """Undo the radial part: a table, then Newton's steps."""
        radius = np.hypot(seen[..., 0], seen[..., 1])
        inner = np.minimum(radius, self._end_bent)
        t = np.interp(inner, self._bent, self._table)
        for _ in range(3):
            t = t - (self._curve(t) - inner) / self._slope(t)
        t = t + (radius - inner) / self._end_slope
        ideal = np.tan(np.minimum(t, np.pi / 2 - 1e-6)) if self._fisheye else t
        scale = np.divide(ideal, radius, out=np.ones_like(ideal), where=radius > 1e-12)
        return np.asarray(seen * scale[..., None], np.float64)
