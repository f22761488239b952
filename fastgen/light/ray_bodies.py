"""Ray casting against the lit surfaces of a scene, with Embree.

Wald et al. 2014, Embree: A Kernel Framework for Efficient CPU Ray Tracing.
"""

import importlib
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError

Floats = NDArray[np.float32]

LIFT_MM = 1.0
"""Distance from a surface at which rays from it start."""

_APART_MM = 8.0
"""Largest distance over which `settled` moves a point. A lens distorts only the corners of
triangles, so points on far walls are up to 5 mm off."""


def check_rays() -> None:
    """Raise ConfigError if Embree is not available on this machine."""
    _embree("rtcore_scene")


def _embree(module: str) -> Any:
    """Import a module of the package embreex, which takes 30 ms."""
    try:
        return importlib.import_module(f"embreex.{module}")
    except ImportError as error:
        raise ConfigError(
            "quality: high casts rays with Embree, which is not available on this machine "
            f"({error}; {platform.machine()}): pip install embreex, which has builds for Linux on "
            "x86-64, or use fine"
        ) from None


@dataclass(frozen=True, eq=False)
class LitBody:
    """A surface and the light on it.

    Attributes:
        positions_mm: [V, 3].
        triangles: [T, 3], counter-clockwise from outside.
        reflectance: Diffuse, [V, 3], equal at the corners of a triangle.
        irradiance: Irradiance / pi [V, 3] without directional lights.
    """

    positions_mm: Floats
    triangles: NDArray[np.uint32]
    reflectance: Floats
    irradiance: Floats


@dataclass(frozen=True, eq=False)
class DistantLight:
    """A directional light in world space.

    Attributes:
        toward: Unit vector [3] toward the light.
        light: Irradiance / pi [3] on a surface that faces the light.
    """

    toward: Floats
    light: Floats


class RayBodies:
    """Scene for ray casting: bodies with light at their vertices, and directional lights."""

    def __init__(self, bodies: Sequence[LitBody], lights: Sequence[DistantLight]) -> None:
        self._lights = lights
        starts = np.cumsum([0, *(len(body.positions_mm) for body in bodies)])
        corners = [body.triangles + start for body, start in zip(bodies, starts[:-1], strict=True)]
        positions = np.concatenate([body.positions_mm for body in bodies]).astype(np.float32)
        triangles = np.concatenate(corners).astype(np.int32)
        self._scene = _embree("rtcore_scene").EmbreeScene()
        _embree("mesh_construction").TriangleMesh(self._scene, positions, triangles)
        first, second, third = positions[triangles].transpose(1, 0, 2)
        normals = np.cross(second - first, third - first)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        self._normals = normals / np.maximum(length, np.float32(1e-9))
        self._paint = np.concatenate([b.reflectance[b.triangles[:, 0]] for b in bodies])
        light = np.concatenate([b.irradiance[b.triangles].mean(axis=1) for b in bodies])
        self._radiance = self._paint * light

    def hits(self, start_mm: Floats, toward: Floats) -> tuple[NDArray[np.intp], Floats]:
        """Cast rays and return the diffuse radiance of the surfaces that they hit.

        Args:
            start_mm: Origins, float32 [K, 3].
            toward: Unit directions, float32 [K, 3].

        Returns:
            Indices [H] of the rays with a hit, and the radiance [H, 3] reflected along each, 0 from
            the back of a surface.
        """
        if not len(start_mm):
            return np.zeros(0, np.intp), np.zeros((0, 3), np.float32)
        found = self._scene.run(start_mm, toward, query="INTERSECT", output=True)
        which = np.flatnonzero(found["primID"] >= 0)
        triangle = found["primID"][which]
        normals, rays = self._normals[triangle], toward[which]
        front = np.einsum("hc,hc->h", normals, rays) < 0
        radiance = self._radiance[triangle]
        if self._lights:
            place = start_mm[which] + found["tfar"][which, None] * rays + LIFT_MM * normals
        for each in self._lights:
            cosine = normals @ each.toward
            lit = np.flatnonzero((cosine > 0) & front)
            lit = lit[self._unoccluded(place[lit], each.toward)]
            radiance[lit] += self._paint[triangle[lit]] * (cosine[lit, None] * each.light)
        radiance[~front] = 0
        return which, radiance

    def settled(self, place_mm: Floats, normal: Floats) -> Floats:
        """Return points [K, 3] moved along their unit normals [K, 3] onto the nearest surface.

        Points farther than _APART_MM from any surface stay.
        """
        if not len(place_mm):
            return place_mm
        start = (place_mm + _APART_MM * normal).astype(np.float32)
        found = self._scene.run(start, (-normal).astype(np.float32), query="INTERSECT", output=True)
        away = _APART_MM - found["tfar"]
        away[(found["primID"] < 0) | (away < -_APART_MM)] = 0.0
        return np.asarray(place_mm + away[:, None] * normal, np.float32)

    def _unoccluded(self, start_mm: Floats, toward: Floats) -> NDArray[np.bool_]:
        """Return for each point [K, 3] whether no surface is in one direction [3]."""
        if not len(start_mm):
            return np.zeros(0, bool)
        rays = np.repeat(toward[None], len(start_mm), axis=0)
        return np.asarray(self._scene.run(start_mm, rays, query="OCCLUDED")) < 0
