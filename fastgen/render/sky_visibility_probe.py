"""Finds how open each vertex of a container or spreader lies to the sky, by depth maps from all
around: a point is hidden from a direction where a face of an occluders.DepthMap stands before it.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.geometry.mesh import MATERIALS, Mesh
from fastgen.light.indirect_light import Cells, FormFactors, form_factors
from fastgen.light.occluders import Solid, core_of, map_matrix, without_cables
from fastgen.light.sky_visibility import (
    DIRECTIONS,
    Array,
    Directions,
    Openness,
    Sky,
    encoded,
    sky_directions,
)
from fastgen.render.depth_map import DepthMap, DrawnBody, MapView
from fastgen.render.programs import link
from fastgen.render.recent_cache import Recent

_VERSION = 4
"""Part of the disk cache's key: count up whenever the openness changes."""

_MAP_SIZE = (2048, 512)
"""Texels along and across a container: 6 mm for the longest."""

_COARSE_SIZE = (512, 256)
"""For what is not beside the surface that it hides."""

_SPREADER_SIZE = (1024, 512)
"""For the spreader itself: 14 mm, a quarter of its beams' least gaps."""

_INSET = 0.5
"""Share of the way from a vertex to the middle of its facets at which it is probed: what is
interpolated between the vertices is then right on average, where creases would be too dark."""

_INSET_LIMIT_MM = 30.0
_LIFT_MM = 2.0
_BIAS_MM = 1.0

Paints = tuple[tuple[float, float, float], ...]
"""What each of mesh.MATERIALS reflects of diffuse light."""

_CAPACITY = 128
_LIT_CAPACITY = 2  # a scene asks for two, once a camera


def probe_points(mesh: Mesh, inset_limit_mm: float = _INSET_LIMIT_MM) -> Array:
    """Where each vertex of `mesh` is probed, [V, 3] in mm: just off the surface, beside creases,
    no further than inset_limit_mm from the vertex."""
    positions = mesh.positions_mm.astype(np.float64)
    middle = positions[mesh.triangles].mean(axis=1)
    corners = mesh.triangles.ravel()
    count = np.maximum(np.bincount(corners, minlength=len(positions)), 1)[:, None]
    weights = np.repeat(middle, 3, axis=0)
    total = [np.bincount(corners, weights[:, k], minlength=len(positions)) for k in range(3)]
    inset = _INSET * (np.stack(total, axis=1) / count - positions)
    length = np.linalg.norm(inset, axis=1, keepdims=True)
    inset *= np.minimum(1.0, inset_limit_mm / np.maximum(length, 1e-6))
    return positions + inset + _LIFT_MM * mesh.normals


def _spreader_points(spreader: Mesh) -> Array:
    # its faces are long and run into one another: their ends stand for nothing
    return probe_points(spreader, np.inf)


@dataclass(frozen=True, eq=False)
class Lit:
    """A mesh in its light. values: `Openness.under` its sky, uint8 [V, VERTEX_BYTES]. irradiance:
    [V, 3], / pi, the suns' included. without_suns: the same without."""

    mesh: Mesh
    values: NDArray[np.uint8]
    irradiance: NDArray[np.float32]
    without_suns: NDArray[np.float32]


def _lit(mesh: Mesh, openness: Openness, sky: Sky) -> Lit:
    return Lit(mesh, *openness.lit(sky))


class SkyProbe:
    """Finds the openness of meshes on one GL context. Owned by the renderer, which releases it."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        # depth maps are the driver's, and so is what is found with them
        self._driver = f"{ctx.info['GL_RENDERER']} {ctx.info['GL_VERSION']}"
        self._program = link(ctx, "occluder.vert", "occluder.frag", {})
        self._own: Recent[NDArray[np.uint8]] = Recent(_CAPACITY)
        self._found: Recent[Openness] = Recent(_CAPACITY)
        self._factors: Recent[FormFactors] = Recent(_CAPACITY)
        self._cells: Recent[Cells] = Recent(_CAPACITY)
        self._lit: Recent[Lit] = Recent(_LIT_CAPACITY)

    def openness(self, container: Mesh, spreader: Mesh | None, sky: Sky) -> Lit:
        """Of a container below the spreader that holds it. Asked again at once, it gives the same
        object."""
        key = (container, spreader)
        openness = self._opened(key, lambda: self._of_container(container, spreader))
        return self._lit.get((openness, sky), lambda: _lit(container, openness, sky))

    def openness_of_spreader(
        self, spreader: Mesh, outline: Mesh, held: Mesh, below: Lit, sky: Sky, paints: Paints
    ) -> Lit:
        """As `openness`, of a spreader above a container, with the light that surfaces throw on it.

        outline: the same surface of as few triangles as can be. held: what of the container hides
        the sky. below: the container in its light. paints: what all materials reflect.
        """
        openness = self._opened((spreader, held), lambda: self._of_spreader(spreader, held))

        def lit() -> Lit:
            factors = self._factors.get(
                (openness, outline),
                lambda: form_factors(
                    spreader,
                    without_cables(outline),
                    held,
                    _spreader_points(spreader),
                    sky_directions(),
                    ~openness.open_to,
                ),
            )
            cells = self._cells.get((below.mesh, held), lambda: Cells.of(below.mesh, held))
            sheet = np.array(paints[MATERIALS.index("paint_sheet")])
            reflectance = np.array(paints)[[chart.material_index for chart in spreader.charts]]
            sun = openness.sunlight(sky)
            light = factors.light(
                openness.irradiance(sky),
                sun,
                sheet * cells.mean(below.irradiance),
                reflectance[spreader.chart],
            )
            return Lit(spreader, openness.under(sky, light), light + sun, light)

        return self._lit.get((openness, sky, below, paints), lit)

    def _opened(
        self, key: tuple[Mesh, Mesh | None], measure: Callable[[], NDArray[np.uint8]]
    ) -> Openness:
        return self._found.get(key, lambda: self._stored(key, measure))

    def _stored(
        self, key: tuple[Mesh, Mesh | None], measure: Callable[[], NDArray[np.uint8]]
    ) -> Openness:
        shapes = [mesh.shape_digest if mesh else "" for mesh in key]
        digest = hashlib.sha256(f"{_VERSION} {self._driver} {shapes}".encode())
        normals = key[0].normals

        def make() -> NDArray[np.uint8]:
            bits = measure()
            directions = np.unpackbits(bits, axis=1, count=DIRECTIONS).astype(bool)
            return np.concatenate([encoded(normals, directions), bits], axis=1)

        shape = (len(normals), 3 + DIRECTIONS // 8)
        stored = _from_disk(digest.hexdigest(), shape, make)
        return Openness(normals, stored[:, 3:], stored[:, :3])

    def _of_spreader(self, spreader: Mesh, container: Mesh) -> NDArray[np.uint8]:
        points = _spreader_points(spreader)
        own = self._kept([without_cables(spreader)], points, _SPREADER_SIZE)
        below = self._kept([container], points, _COARSE_SIZE)
        return own & below

    def _of_container(self, container: Mesh, spreader: Mesh | None) -> NDArray[np.uint8]:
        points = probe_points(container)
        whole: list[Solid] = [container, core_of(container)]
        open_to = self._own.get(container, lambda: self._kept(whole, points, _MAP_SIZE))
        if spreader is not None:
            open_to = open_to & self._kept([without_cables(spreader)], points, _COARSE_SIZE)
        return open_to

    def _kept(
        self, bodies: Sequence[Solid], points_mm: Array, size: tuple[int, int]
    ) -> NDArray[np.uint8]:
        """As _open_to, packed along the directions; from the disk cache where it is there."""
        about = f"{_VERSION} {DIRECTIONS} {size} {self._driver}".encode()
        digest = hashlib.sha256(about)
        arrays = [array for body in bodies for array in (body.positions_mm, body.triangles)]
        for array in (*arrays, points_mm):
            digest.update(np.ascontiguousarray(array).tobytes())
        return _from_disk(
            digest.hexdigest(),
            (len(points_mm), DIRECTIONS // 8),
            lambda: np.packbits(self._open_to(bodies, points_mm, size), axis=1),
        )

    def _open_to(
        self, bodies: Sequence[Solid], points_mm: Array, size: tuple[int, int]
    ) -> Directions:
        drawn = [DrawnBody(self._ctx, self._program, body) for body in bodies]
        depths = DepthMap(self._ctx, self._program, size)
        low = np.min([body.bounds_mm[0] for body in bodies], axis=0)
        high = np.max([body.bounds_mm[1] for body in bodies], axis=0)
        # what is probed outside of the box of occluders may be hidden too
        low, high = np.minimum(low, points_mm.min(axis=0)), np.maximum(high, points_mm.max(axis=0))
        found = np.empty((len(points_mm), DIRECTIONS), bool)
        corner = np.array(size) - 1
        for i, toward in enumerate(sky_directions()):
            to_map = map_matrix(toward, low.astype(np.float64), high.astype(np.float64))
            depths.draw([MapView(drawn, to_map, (0, 0, *size))])
            nearest = np.frombuffer(depths.depth.read(alignment=1), np.float32)
            at = points_mm @ to_map[:3, :3].T + to_map[:3, 3]
            texel = np.clip((at[:, :2] + 1) / 2 * size, 0, corner).astype(np.int64)
            bias = _BIAS_MM * np.linalg.norm(to_map[2, :3])
            before = nearest[texel[:, 1] * size[0] + texel[:, 0]] * 2 - 1
            found[:, i] = at[:, 2] - bias <= before
        depths.release()
        for body in drawn:
            body.release()
        return found

    def release(self) -> None:
        """Free the program."""
        self._program.release()


def _from_disk(
    key: str, shape: tuple[int, int], make: Callable[[], NDArray[np.uint8]]
) -> NDArray[np.uint8]:
    """The disk cache's array of `key`; where there is none of `shape`, what `make` gives."""
    entry = disk_cache.default_folder() / f"openness-{key[:32]}.npz"

    def kept() -> NDArray[np.uint8] | None:
        stored = disk_cache.read(entry).get("values")
        fits = stored is not None and stored.shape == shape and stored.dtype == np.uint8
        return stored.astype(np.uint8) if stored is not None and fits else None

    def made() -> NDArray[np.uint8]:
        values = make()
        disk_cache.write(entry, {"values": values}, compress=True)
        return values

    return disk_cache.once(entry, kept, made)
