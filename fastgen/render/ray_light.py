"""Light of visible surfaces by rays, with caches for recent image sizes and scenes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastgen.geometry.damage_law import deform
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.environment import Ambient, to_map_frame
from fastgen.light.ray_bodies import DistantLight, LitBody, RayBodies
from fastgen.light.sky_rays import SkyRays
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.gl import GLContext
from fastgen.render.passes.ray_points import RayPass
from fastgen.render.program import Programs
from fastgen.render.recent_cache import CACHED_CONTAINERS, RecentCache, ReleasingCache
from fastgen.render.sky_visibility_probe import LitMesh
from fastgen.render.surface_values import SceneMaterials


class RayLight:
    """Light of visible surfaces by rays, with caches of passes and of bodies that rays can hit.

    Args:
        gl: Current context.
        programs: Programs of this context.
    """

    def __init__(self, gl: GLContext, programs: Programs) -> None:
        self._gl = gl
        self._programs = programs
        self._passes: ReleasingCache[RayPass] = ReleasingCache(2)
        self._bodies: RecentCache[RayBodies] = RecentCache(CACHED_CONTAINERS)

    def run(
        self,
        inputs: DrawInputs,
        prepared: PreparedScene,
        materials: SceneMaterials,
        sky: SkyRays,
        ambient: Ambient,
    ) -> None:
        """Light the surfaces in the visibility buffer, and add that light to `inputs.textures`.

        Args:
            inputs: The image.
            prepared: The container that it shows, with its spreader.
            materials: Materials of its surfaces.
            sky: The environment as directions of its light.
            ambient: The light of the environment and its lamps.
        """
        size, lens = inputs.view.size, inputs.view.distortion is not None
        rays = self._passes.get(size, lambda: RayPass(self._gl, self._programs, size))
        bodies = self._bodies.get(
            (prepared, lens), lambda: _bodies_of(prepared, materials, lens, inputs.lit, ambient)
        )
        rays.run(inputs, bodies, sky, prepared.scene.environment.yaw_deg)

    def release(self) -> None:
        """Free all GL objects."""
        self._passes.release()


def _bodies_of(
    prepared: PreparedScene,
    materials: SceneMaterials,
    lens: bool,
    lit: Sequence[LitMesh],
    light: Ambient,
) -> RayBodies:
    """Return the bodies of a scene that rays can hit.

    The container is damaged but has no holes, and carries the light of the undamaged one.

    Args:
        prepared: The scene.
        materials: Its materials.
        lens: Whether the image has lens distortion.
        lit: Light at the vertices of container and spreader.
        light: Light of the scene's environment.
    """
    scene, shape = prepared.scene, prepared.spreader
    meshes = [prepared.container] if shape is None else [prepared.container, shape.drawn(lens)]
    paints = np.array(materials.reflectances, np.float32)
    bodies = [
        LitBody(
            mesh.positions_mm,
            mesh.triangles,
            paints[[chart.material_index for chart in mesh.charts]][mesh.chart],
            one.without_lights,
        )
        for mesh, one in zip(meshes, lit, strict=True)
    ]
    if scene.damages:
        moved = deform(scene.damages, bodies[0].positions_mm).astype(np.float32)
        bodies[0] = replace(bodies[0], positions_mm=moved)
    suns = [
        DistantLight(
            to_map_frame(sun.direction, -scene.environment.yaw_deg).astype(np.float32),
            np.array(sun.light, np.float32),
        )
        for sun in light.lights
    ]
    return RayBodies(bodies, suns)
