"""What rays meet of a scene, and the light that comes back from there: Embree casts them.

Wald et al. 2014, Embree: A Kernel Framework for Efficient CPU Ray Tracing. No GL here.
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
"""Off a surface start the rays that leave it."""


def check_rays() -> None:
    """Raises ConfigError where this machine has no Embree."""
    _embree("rtcore_scene")


def _embree(module: str) -> Any:
    """A module of the package embreex, which takes 30 ms to import."""
    try:
        return importlib.import_module(f"embreex.{module}")
    except ImportError as error:
        raise ConfigError(
            "quality: high casts rays with Embree, and this machine has it not "
            f"({error}; {platform.machine()}): pip install embreex, of which there are builds for "
            "Linux on x86-64, or take fine"
        ) from None


@dataclass(frozen=True, eq=False)
class LitBody:
    """A surface in its light. positions_mm: [V, 3]. triangles: [T, 3], counter-clockwise from
    outside. reflectance: of diffuse light, [V, 3], equal at the corners of a triangle. irradiance:
    / pi [V, 3], without the suns'."""

    positions_mm: Floats
    triangles: NDArray[np.uint32]
    reflectance: Floats
    irradiance: Floats


@dataclass(frozen=True, eq=False)
class DistantLight:
    """A sun. toward: unit vector [3] to it in the world. light: irradiance / pi [3] on what faces
    it."""

    toward: Floats
    light: Floats


class RayBodies:
    """Bodies that rays are cast at, lit by what their vertices have and by suns."""

    def __init__(self, bodies: Sequence[LitBody], suns: Sequence[DistantLight]) -> None:
        self._suns = suns
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
        self._glow = self._paint * light

    def met(self, start_mm: Floats, toward: Floats) -> tuple[NDArray[np.intp], Floats]:
        """Which of K rays, float32 [K, 3] each, meet a surface, [H], and the radiance [H, 3] that
        its diffuse reflection sends back along them: none from a surface seen from behind."""
        if not len(start_mm):
            return np.zeros(0, np.intp), np.zeros((0, 3), np.float32)
        found = self._scene.run(start_mm, toward, query="INTERSECT", output=True)
        which = np.flatnonzero(found["primID"] >= 0)
        met = found["primID"][which]
        normals, rays = self._normals[met], toward[which]
        before = np.einsum("hc,hc->h", normals, rays) < 0
        radiance = self._glow[met]
        if self._suns:
            place = start_mm[which] + found["tfar"][which, None] * rays + LIFT_MM * normals
        for sun in self._suns:
            cosine = normals @ sun.toward
            lit = np.flatnonzero((cosine > 0) & before)
            lit = lit[self._open(place[lit], sun.toward)]
            radiance[lit] += self._paint[met[lit]] * (cosine[lit, None] * sun.light)
        radiance[~before] = 0
        return which, radiance

    def _open(self, start_mm: Floats, toward: Floats) -> NDArray[np.bool_]:
        """From which places [K, 3] nothing stands in the way toward one direction [3]."""
        if not len(start_mm):
            return np.zeros(0, bool)
        rays = np.repeat(toward[None], len(start_mm), axis=0)
        return np.asarray(self._scene.run(start_mm, rays, query="OCCLUDED")) < 0
