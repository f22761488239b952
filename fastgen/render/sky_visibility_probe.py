"""Sky visibility of the vertices of containers and spreaders, found with depth maps.

A depth map is drawn for each direction of the sky. A point is hidden from a direction if the map
has a face in front of it.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.geometry.mesh import MATERIALS, Mesh
from fastgen.geometry.solids import Solid, without_cables
from fastgen.light.indirect_light import Cells, FormFactors, form_factors
from fastgen.light.occluders import core_of, map_matrix
from fastgen.light.sky_visibility import (
    DIRECTIONS,
    VERTEX_BYTES,
    Array,
    Directions,
    Sky,
    SkyVisibility,
    encoded_cones,
    sky_directions,
)
from fastgen.render.depth_map import DepthMap, DrawnBody, MapView, occluder_program
from fastgen.render.recent_cache import RecentCache

VERSION = 2  # raise when the stored arrays change

_MAP_SIZE = (2048, 512)
"""Texels along and across a container, 6 mm wide for the longest container."""

_COARSE_SIZE = (512, 256)
"""Map size for occluders that are not close to the surface."""

_SPREADER_SIZE = (1024, 512)
"""Map size for the spreader itself; texels of 14 mm are a quarter of the smallest beam gaps."""

_INSET = 0.5
"""Position of a probe between the vertex (0) and the centres of its facets (1). The interpolation
between vertices is then correct on average; probes at the vertices would make creases too dark."""

_INSET_LIMIT_MM = 30.0
_LIFT_MM = 2.0
_BIAS_MM = 1.0

Paints = tuple[tuple[float, float, float], ...]
"""Diffuse reflectance of each of mesh.MATERIALS."""

_CAPACITY = 128
_LIT_CAPACITY = 18  # a scene needs one per container and one for the spreader, for each camera


def _layout(vertices: int) -> disk_cache.Layout:
    """Return the layout of a SkyVisibility in the disk cache."""
    return {
        "kind": f"unsigned {vertices}",
        "rows": f"uint8 K {VERTEX_BYTES}",
        "normals": "float32 N 3",
        "normal": "unsigned K",
        "cones": "uint8 C 3",
        "cone": "unsigned K",
    }


def probe_points(mesh: Mesh, inset_limit_mm: float = _INSET_LIMIT_MM) -> Array:
    """Return the point at which each vertex of a mesh is probed, [V, 3] in mm.

    Points are slightly above the surface and at most inset_limit_mm from their vertex along it.
    """
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
    # its faces are long and intersect, so the surroundings of their ends are not representative
    return probe_points(spreader, np.inf)


@dataclass(frozen=True, eq=False)
class LitMesh:
    """A mesh and the light at its vertices.

    Attributes:
        mesh: The mesh.
        values: uint8 [V, VERTEX_BYTES], see SkyVisibility.vertex_bytes.
        irradiance: Irradiance / pi [V, 3], including directional lights.
        without_lights: Irradiance / pi [V, 3], without directional lights.
    """

    mesh: Mesh
    values: NDArray[np.uint8]
    irradiance: NDArray[np.float32]
    without_lights: NDArray[np.float32]


def _lit(mesh: Mesh, visibility: SkyVisibility, sky: Sky) -> LitMesh:
    return LitMesh(mesh, *visibility.lit(sky))


class SkyVisibilityProbe:
    """Computes the sky visibility and the light of meshes on one OpenGL context.

    Owned by the renderer, which releases it.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        # depth maps, and so the results, depend on the driver
        self._driver = f"{ctx.info['GL_RENDERER']} {ctx.info['GL_VERSION']}"
        self._program = occluder_program(ctx)
        self._found: RecentCache[SkyVisibility] = RecentCache(_CAPACITY)
        self._factors: RecentCache[FormFactors] = RecentCache(_CAPACITY)
        self._cells: RecentCache[Cells] = RecentCache(_CAPACITY)
        self._lit: RecentCache[LitMesh] = RecentCache(_LIT_CAPACITY)

    def container_light(
        self, container: Mesh, outline: Mesh, spreader: Mesh | None, sky: Sky
    ) -> LitMesh:
        """Return a container in the light of the sky.

        Args:
            container: The mesh.
            outline: The same surface with few triangles.
            spreader: Spreader above the container, or None.
            sky: The environment.

        Returns:
            The lit mesh. A second call with the same arguments returns the same object.
        """
        visibility = self.container_visibility(container, outline, spreader)
        return self._lit.get((visibility, sky), lambda: _lit(container, visibility, sky))

    def container_visibility(
        self, container: Mesh, outline: Mesh, spreader: Mesh | None
    ) -> SkyVisibility:
        """Return the sky visibility of a container below a spreader or an open sky."""
        key = (container, spreader)
        return self._visibility(key, lambda: self._of_container(container, outline, spreader))

    def spreader_light(
        self, spreader: Mesh, outline: Mesh, held: Mesh, below: LitMesh, sky: Sky, paints: Paints
    ) -> LitMesh:
        """Return a spreader above a container in the light of the sky and indirect light.

        Args:
            spreader: The mesh.
            outline: The same surface with few triangles.
            held: Mesh of the container as an occluder of the sky.
            below: The container in its light.
            sky: The environment.
            paints: Reflectance of all materials.

        Returns:
            The lit mesh. A second call with the same arguments returns the same object.
        """
        visibility = self._spreader_visibility(spreader, held)

        def lit() -> LitMesh:
            factors = self._form_factors(spreader, outline, held)
            cells = self._cells_of(below.mesh, held)
            sheet = np.array(paints[MATERIALS.index("paint_sheet")])
            reflectance = np.array(paints)[[chart.material_index for chart in spreader.charts]]
            direct = visibility.directional_irradiance(sky)
            light = factors.light(
                visibility.irradiance(sky),
                direct,
                sheet * cells.mean(below.irradiance),
                reflectance[spreader.chart],
            )
            values = visibility.vertex_bytes(sky, light)
            return LitMesh(spreader, values, light + direct, light)

        return self._lit.get((visibility, sky, below, paints), lit)

    def preload_spreader(self, spreader: Mesh, outline: Mesh, held: Mesh, below: Mesh) -> None:
        """Prepare `spreader_light` for these meshes; `below` is the mesh of the container."""
        self._form_factors(spreader, outline, held)
        self._cells_of(below, held)

    def _spreader_visibility(self, spreader: Mesh, held: Mesh) -> SkyVisibility:
        return self._visibility((spreader, held), lambda: self._of_spreader(spreader, held))

    def _form_factors(self, spreader: Mesh, outline: Mesh, held: Mesh) -> FormFactors:
        visibility = self._spreader_visibility(spreader, held)
        return self._factors.get(
            (visibility, outline),
            lambda: form_factors(
                spreader,
                without_cables(outline),
                held,
                _spreader_points(spreader),
                sky_directions(),
                ~visibility.visible,
            ),
        )

    def _cells_of(self, container: Mesh, held: Mesh) -> Cells:
        return self._cells.get((container, held), lambda: Cells.of(container, held))

    def _visibility(
        self, key: tuple[Mesh, Mesh | None], measure: Callable[[], NDArray[np.uint8]]
    ) -> SkyVisibility:
        return self._found.get(key, lambda: self._stored(key, measure))

    def _stored(
        self, key: tuple[Mesh, Mesh | None], measure: Callable[[], NDArray[np.uint8]]
    ) -> SkyVisibility:
        normals = key[0].normals

        def make() -> dict[str, NDArray[Any]]:
            bits = measure()
            visible = np.unpackbits(bits, axis=1, count=DIRECTIONS).astype(bool)
            return vars(SkyVisibility.of(normals, bits, encoded_cones(normals, visible)))

        shapes = [mesh.shape_digest if mesh else "" for mesh in key]
        inputs = self._driver, shapes
        stored = disk_cache.cached(
            "sky-visibility", VERSION, inputs, make, layout=_layout(len(normals))
        )
        return SkyVisibility(**stored)

    def _of_spreader(self, spreader: Mesh, container: Mesh) -> NDArray[np.uint8]:
        points = _spreader_points(spreader)
        own = self._cached([without_cables(spreader)], points, _SPREADER_SIZE)
        below = self._cached([container], points, _COARSE_SIZE)
        return own & below

    def _of_container(
        self, container: Mesh, outline: Mesh, spreader: Mesh | None
    ) -> NDArray[np.uint8]:
        points = probe_points(container)
        whole: list[Solid] = [outline, core_of(container)]
        visible = self._cached(whole, points, _MAP_SIZE)
        if spreader is not None:
            visible = visible & self._cached([without_cables(spreader)], points, _COARSE_SIZE)
        return visible

    def _cached(
        self, bodies: Sequence[Solid], points_mm: Array, size: tuple[int, int]
    ) -> NDArray[np.uint8]:
        """Return _visible packed along the directions, from the disk cache if possible."""
        digest = hashlib.sha256()
        arrays = [array for body in bodies for array in (body.positions_mm, body.triangles)]
        for array in (*arrays, points_mm):
            digest.update(np.ascontiguousarray(array).tobytes())
        inputs = self._driver, DIRECTIONS, size, digest.hexdigest()
        found = disk_cache.cached(
            "sky-directions",
            VERSION,
            inputs,
            lambda: {"bits": np.packbits(self._visible(bodies, points_mm, size), axis=1)},
            layout={"bits": f"uint8 {len(points_mm)} {-(-DIRECTIONS // 8)}"},
        )
        return found["bits"]

    def _visible(
        self, bodies: Sequence[Solid], points_mm: Array, size: tuple[int, int]
    ) -> Directions:
        drawn = [DrawnBody(self._ctx, self._program, body) for body in bodies]
        depths = DepthMap(self._ctx, self._program, size)
        low = np.min([body.bounds_mm[0] for body in bodies], axis=0)
        high = np.max([body.bounds_mm[1] for body in bodies], axis=0)
        # points outside the bounding box of the occluders may be hidden as well
        low, high = np.minimum(low, points_mm.min(axis=0)), np.maximum(high, points_mm.max(axis=0))
        found = np.empty((DIRECTIONS, len(points_mm)), bool)
        width, height = size
        nearest = np.empty(width * height, np.float32)
        for i, toward in enumerate(sky_directions()):
            to_map = map_matrix(toward, low.astype(np.float64), high.astype(np.float64))
            depths.draw([MapView(drawn, to_map, (0, 0, *size))])
            depths.depth.read_into(nearest, alignment=1)
            # one coordinate after the other: along a short last axis NumPy is several times slower
            turned = np.ascontiguousarray((points_mm @ to_map[:3, :3].T).T)
            x, y, z = turned + to_map[:3, 3, None]
            column = np.clip((x + 1) / 2 * width, 0, width - 1).astype(np.int64)
            row = np.clip((y + 1) / 2 * height, 0, height - 1).astype(np.int64)
            bias = _BIAS_MM * np.linalg.norm(to_map[2, :3])
            before = nearest[row * width + column] * 2 - 1
            found[i] = z - bias <= before
        depths.release()
        for body in drawn:
            body.release()
        return np.ascontiguousarray(found.T)

    def release(self) -> None:
        """Free the program."""
        self._program.release()
