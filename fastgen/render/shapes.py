"""Containers, seals and spreaders on the GPU, with the light at their vertices."""

from collections.abc import Mapping
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import Mesh
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.seals import nearest_gear, seal_charts
from fastgen.light.environment import Ambient
from fastgen.light.sky_visibility import Sky, SkyVisibility
from fastgen.light.surrounding_change import SurroundingLight
from fastgen.render.gpu_mesh import GpuMesh, zone_rows, zone_table
from fastgen.render.recent_cache import RecentCache, ReleasingCache
from fastgen.render.sky_visibility_probe import LitMesh, SkyVisibilityProbe
from fastgen.render.surface_values import SceneMaterials
from fastgen.render.zone_codes import SEAL_ZONE, SPREADER_ZONE

_SURROUNDED = 16
"""Containers between others whose light is cached."""

_SEAL_ROWS = zone_rows(*seal_charts())


class Shapes:
    """The most recently drawn meshes on the GPU. Owned by the renderer, which releases them.

    Args:
        ctx: The context that draws.
        programs: The geometry program of each of DAMAGE_VARIANTS.
    """

    def __init__(self, ctx: moderngl.Context, programs: Mapping[str, moderngl.Program]) -> None:
        self._ctx = ctx
        self._programs = programs
        self._containers: ReleasingCache[GpuMesh] = ReleasingCache(16)
        self._spreaders: ReleasingCache[GpuMesh] = ReleasingCache(64)
        self._seals: ReleasingCache[GpuMesh] = ReleasingCache(2)
        self._gear: RecentCache[NDArray[np.int64]] = RecentCache(2)
        self._surrounded: RecentCache[LitMesh] = RecentCache(_SURROUNDED)
        self._zones: ReleasingCache[moderngl.Texture] = ReleasingCache(128)
        self._probe = SkyVisibilityProbe(ctx)

    def of(
        self,
        prepared: PreparedScene,
        materials: SceneMaterials,
        lens: bool,
        light: Ambient,
        light_change: SurroundingLight | None = None,
    ) -> tuple[GpuMesh, GpuMesh | None, LitMesh]:
        """Return the container and spreader of a scene, ready to be drawn.

        Args:
            prepared: The scene.
            materials: Its materials.
            lens: Whether the image has lens distortion.
            light: Light of the scene's environment.
            light_change: Change of the light on the container by other containers and the ground.

        Returns:
            The container, the spreader or None, and the light at the vertices of the container,
            whose irradiance is that in the open.
        """
        mesh, shape = self.container(prepared), prepared.spreader
        below, *above = self.light(prepared, materials, lens, light)
        if light_change is not None:
            below = self._changed(prepared, below, _sky_of(prepared, light), light_change)
        mesh.set_sky_visibility(below.values)
        if shape is None:
            return mesh, None, below
        spreader = self._drawn_spreader(shape.drawn(lens))
        spreader.set_sky_visibility(above[0].values)
        return mesh, spreader, below

    def light(
        self, prepared: PreparedScene, materials: SceneMaterials, lens: bool, light: Ambient
    ) -> tuple[LitMesh, ...]:
        """Return the light in the open of the container and the spreader, if there is one.

        The arguments are those of `of`.
        """
        mesh, shape, usual = prepared.container, prepared.spreader, prepared.usual_spreader
        sky = _sky_of(prepared, light)
        below = self._probe.container_light(
            mesh, prepared.container_outline, _spreader_above(prepared), sky
        )
        if shape is None or usual is None:
            return (below,)
        # a mesh with lens distortion has other vertices, which are probed at their own gap
        probed = shape.drawn(True) if lens else usual.mesh
        outline = shape.outline if lens else usual.outline
        above = self._probe.spreader_light(
            probed, outline, prepared.nominal_outline, below, sky, materials.reflectances
        )
        return below, above

    def _changed(
        self, prepared: PreparedScene, below: LitMesh, sky: Sky, light_change: SurroundingLight
    ) -> LitMesh:
        """Return a container, lit in the open, with vertex bytes for the changed light."""

        def make() -> LitMesh:
            visibility = self._visibility(below.mesh, prepared)
            open_, light = below.values, below.without_lights
            values = light_change.applied(visibility, sky, open_, light, below.mesh)
            return replace(below, values=values)

        return self._surrounded.get((below, light_change), make)

    def _visibility(self, mesh: Mesh, prepared: PreparedScene) -> SkyVisibility:
        return self._probe.container_visibility(
            mesh, prepared.container_outline, _spreader_above(prepared)
        )

    def preload(self, prepared: PreparedScene, lens: bool, damages: bool) -> None:
        """Load the meshes of a scene and all that their light needs; see Renderer.preload."""
        container, shape = self.container(prepared), prepared.spreader
        usual = prepared.usual_spreader
        if damages:
            _ = container.clusters
        self._visibility(container.mesh, prepared)
        if shape is None or usual is None:
            self.zone_table(container, None)
            return
        spreader = self._drawn_spreader(shape.drawn(lens))
        self.zone_table(container, spreader)
        probed, outline = (spreader.mesh, shape.outline) if lens else (usual.mesh, usual.outline)
        self._probe.preload_spreader(probed, outline, prepared.nominal_outline, container.mesh)

    def container(self, prepared: PreparedScene) -> GpuMesh:
        """Return the container of a scene at rest."""
        mesh = prepared.container
        return self._containers.get(mesh, lambda: GpuMesh(self._ctx, mesh, self._programs))

    def spreader(self, prepared: PreparedScene) -> GpuMesh | None:
        """Return the spreader of a scene without lens distortion, None if it has none."""
        shape = prepared.spreader
        return None if shape is None else self._drawn_spreader(shape.mesh)

    def _drawn_spreader(self, mesh: Mesh) -> GpuMesh:
        return self._spreaders.get(
            mesh, lambda: GpuMesh(self._ctx, mesh, self._programs, SPREADER_ZONE)
        )

    def seals(self, prepared: PreparedScene, container: LitMesh) -> GpuMesh | None:
        """Return the seals of a scene in the light on its container, None if it has none.

        A seal has the sky visibility of the nearest vertices of its handle and catch.
        """
        found = prepared.seals
        if found is None:
            return None
        programs = {"undamaged": self._programs["undamaged"]}
        drawn = self._seals.get(found, lambda: GpuMesh(self._ctx, found.mesh, programs, SEAL_ZONE))
        gear = self._gear.get(found, lambda: nearest_gear(found.mesh, container.mesh))
        drawn.set_sky_visibility(container.values[gear])
        return drawn

    def zone_table(self, container: GpuMesh, spreader: GpuMesh | None) -> moderngl.Texture:
        """Return the zones of both, and of seals, as the material layers read them."""
        rows = {0: container.zone_rows, SEAL_ZONE: _SEAL_ROWS}
        if spreader is not None:
            rows[SPREADER_ZONE] = spreader.zone_rows
        return self._zones.get((container, spreader), lambda: zone_table(self._ctx, rows))

    def release(self) -> None:
        """Free all GL objects."""
        for kept in (self._containers, self._seals, self._spreaders, self._zones, self._probe):
            kept.release()


def _spreader_above(prepared: PreparedScene) -> Mesh | None:
    """Return the spreader at its usual gap, as it hides sky from a container, if there is one."""
    usual = prepared.usual_spreader
    return None if usual is None else usual.mesh


def _sky_of(prepared: PreparedScene, light: Ambient) -> Sky:
    return Sky(light, prepared.scene.environment.yaw_deg)
