"""Light of scenes: environments on the GPU, exposure, shadows, and what surroundings change."""

from collections.abc import Callable, Mapping

import moderngl

from fastgen.camera.exposure import Exposure
from fastgen.camera.projection import View
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.environment import Ambient, EnvironmentLight
from fastgen.light.exposure import metered_exposure
from fastgen.light.fog import has_sun, in_fog
from fastgen.light.ground_light import mean_albedo
from fastgen.light.lamps import unit_luminance, with_lamps
from fastgen.light.surrounding_change import SurroundingLight
from fastgen.light.surrounding_light import Paving, surrounding_light
from fastgen.render.environment_textures import BackgroundTextures, GpuLight
from fastgen.render.gl import GLContext
from fastgen.render.recent_cache import RecentCache, ReleasingCache
from fastgen.render.scene_resources import SceneResources
from fastgen.render.settings import Quality
from fastgen.render.shadows import Shadows
from fastgen.scene import Camera, EnvironmentView, Scene

LightChanges = Mapping[PreparedScene, SurroundingLight]
"""Change of the light on each container that a scene shows."""


class SceneLights:
    """Light of the scenes that were drawn last. Owned by the renderer, which releases it.

    Args:
        gl: Current context.
        light: Returns the prefiltered environment of a name.
        quality: Detail of shadows, and whether rays find indirect light.

    Attributes:
        shadows: Shadow maps of the directional lights.
    """

    def __init__(
        self, gl: GLContext, light: Callable[[str], EnvironmentLight], quality: Quality
    ) -> None:
        self._gl = gl
        self._light_of = light
        self._traced = quality.traced
        self._lights: ReleasingCache[GpuLight] = ReleasingCache(24)
        self._clear_environments: RecentCache[EnvironmentLight] = RecentCache(2)
        self._foggy: ReleasingCache[GpuLight] = ReleasingCache(2)
        self._backgrounds = BackgroundTextures(gl)
        self._lit: RecentCache[Ambient] = RecentCache(4)
        self._light_changes: RecentCache[LightChanges] = RecentCache(2)
        self.shadows = Shadows(gl.ctx, quality.shadow_detail)

    def of(self, scene: Scene) -> GpuLight:
        """Return the light of a scene's environment in its fog, without its lamps."""
        name, visibility_mm = scene.environment.name, scene.weather.visibility_mm
        if not visibility_mm or not has_sun(self._clear(name).ambient):
            return self._clear(name)

        def foggy() -> GpuLight:
            clear = self._clear_environments.get(name, lambda: self._light_of(name))
            return GpuLight(self._gl, in_fog(clear, visibility_mm), self._traced)

        return self._foggy.get((name, visibility_mm), foggy)

    def _clear(self, name: str) -> GpuLight:
        """Return the light of an environment without fog."""
        return self._lights.get(
            name, lambda: GpuLight(self._gl, self._light_of(name), self._traced)
        )

    def ambient(self, scene: Scene) -> Ambient:
        """Return the light of a scene's environment and lamps, as the CPU uses it."""
        light, environment = self.of(scene).ambient, scene.environment
        if not environment.lamps:
            return light
        key = environment, scene.weather.visibility_mm
        return self._lit.get(key, lambda: with_lamps(light, environment, self._cd_m2(environment)))

    def _cd_m2(self, environment: EnvironmentView) -> float:
        """Return the luminance in cd/m2 of a unit of radiance."""
        return unit_luminance(self._clear(environment.name).ambient, environment.illuminance_lx)

    def background(self, environment: str) -> moderngl.Texture:
        """Return the background map of an environment."""
        return self._backgrounds.get(self._clear(environment))

    def exposure(self, scene: Scene, camera: Camera, view: View) -> Exposure:
        """Return the exposure of a camera; its factor applies to radiance before the tone curve."""
        environment, paint = scene.environment, scene.surface.paint.albedo
        light, cd_m2 = self.ambient(scene), self._cd_m2(environment)
        ground = mean_albedo(scene.ground) if scene.ground else None
        return metered_exposure(light, cd_m2, environment.yaw_deg, view, camera, paint, ground)

    def light_changes(
        self, prepared: PreparedScene, resources: Callable[[PreparedScene], SceneResources]
    ) -> LightChanges:
        """Return what other containers and the ground change in the light of each container.

        Args:
            prepared: The scene.
            resources: Returns what the renderer keeps for each container.
        """

        def found() -> LightChanges:
            scene, members, ground = prepared.scene, prepared.present, prepared.scene.ground
            changes = surrounding_light(
                [each.box for each in members],
                [resources(each.prepared).materials.sheet for each in members],
                [each.prepared.container.bounds_mm for each in members],
                self.ambient(scene),
                scene.environment.yaw_deg,
                Paving(ground.height_mm, mean_albedo(ground)) if ground else None,
            )
            return {each.prepared: one for each, one in zip(members, changes, strict=True)}

        return self._light_changes.get(prepared, found)

    def release(self) -> None:
        """Free all GL objects."""
        for item in (self._lights, self._foggy, self._backgrounds, self.shadows):
            item.release()
