"""Light of visible surfaces by rays, with caches for recent image sizes and scenes."""

from collections.abc import Callable

import numpy as np

from fastgen.geometry.prepared_scene import Member, PreparedScene
from fastgen.light.environment import Ambient
from fastgen.light.ground_light import GroundLight
from fastgen.light.ray_bodies import RayBodies
from fastgen.light.sky_rays import SkyRays
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.gl import GLContext
from fastgen.render.passes.ray_points import RayPass
from fastgen.render.program import Programs
from fastgen.render.recent_cache import RecentCache, ReleasingCache
from fastgen.render.scene_bodies import LitMember, scene_bodies
from fastgen.render.scene_lights import LightChanges
from fastgen.render.scene_resources import SceneResources
from fastgen.render.shapes import Shapes
from fastgen.scene import Scene

_SCENES = 2
"""Number of scenes whose bodies are kept, for their other cameras."""


class RayLight:
    """Light of visible surfaces by rays, with caches of passes and of bodies that rays can hit.

    Args:
        gl: Current context.
        programs: Programs of this context.
        resources: Returns what the renderer keeps for a scene.
        ambient: Returns the light of an environment.
    """

    def __init__(
        self,
        gl: GLContext,
        programs: Programs,
        resources: Callable[[PreparedScene], SceneResources],
        ambient: Callable[[Scene], Ambient],
    ) -> None:
        self._gl = gl
        self._programs = programs
        self._resources = resources
        self._ambient = ambient
        self._passes: ReleasingCache[RayPass] = ReleasingCache(2)
        self._bodies: RecentCache[RayBodies] = RecentCache(_SCENES)

    def run(
        self,
        inputs: DrawInputs,
        member: Member,
        whole: PreparedScene,
        shapes: Shapes,
        light_changes: LightChanges | None,
        ground: GroundLight | None,
        sky: SkyRays,
    ) -> None:
        """Light the surfaces in the visibility buffer, and add that light to `inputs.textures`.

        Args:
            inputs: The image, with the view in the frame of the container.
            member: The container that is drawn.
            whole: Its scene.
            shapes: Returns the light at vertices.
            light_changes: Change of the light on each container; None without surroundings.
            ground: Light on the ground, if there is one.
            sky: The environment as directions of its light.
        """
        size, lens = inputs.view.size, inputs.view.distortion is not None
        scene = whole.scene

        def lit(each: Member) -> LitMember:
            prepared, materials = each.prepared, self._resources(each.prepared).materials
            light = shapes.light(prepared, materials, lens, self._ambient(prepared.scene))
            paints = np.array(materials.reflectances, np.float32)
            light_change = None if light_changes is None else light_changes[prepared]
            return LitMember(each, paints, light, light_change)

        def found() -> RayBodies:
            ambient = self._ambient(scene)
            return scene_bodies(map(lit, whole.present), scene, lens, ambient, ground)

        rays = self._passes.get(size, lambda: RayPass(self._gl, self._programs, size))
        bodies = self._bodies.get((whole, lens), found)
        rays.run(inputs, member.pose, bodies, sky, scene.environment.yaw_deg)

    def release(self) -> None:
        """Free all GL objects."""
        self._passes.release()
