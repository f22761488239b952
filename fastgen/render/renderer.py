"""Renderer: Scene -> Frame, the owner of all GL objects.

A draw is a list of passes (fastgen/render/passes). The geometry pass writes the visibility buffer:
which surface each sample sees, and where on its sheet. The shading pass sorts the pixels that see
surfaces into classes, and shades each class. A scene with one container and no ground has the
passes geometry, background, shading. Any other scene has background, ground, then geometry and
shading for each visible container from back to front; their shading blends over the image (OVER in
shaders).

Colour, ids, damage and depth come out of one draw. Labels are taken at the pixel centre and never
filtered: a sample lies exactly on each centre.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.exposure import Exposure
from fastgen.camera.projection import View, view_of
from fastgen.config.damage import DamageConfig
from fastgen.decals.own_fonts import OwnPrints
from fastgen.frame import Frame
from fastgen.geometry.damage_law import seen_damages, variant
from fastgen.geometry.prepared_scene import Member, PreparedScene
from fastgen.light.environment import Ambient, EnvironmentLight
from fastgen.render.batch_readback import BatchReadback
from fastgen.render.decal_tables import scale_for
from fastgen.render.draw_blocks import DrawBlocks
from fastgen.render.draw_inputs import DrawInputs, DrawOptions, ImageRequest, regions_of
from fastgen.render.gl import GLContext
from fastgen.render.image_targets import ImageTargets
from fastgen.render.material_textures import MaterialTextures
from fastgen.render.passes.background import BackgroundPass
from fastgen.render.passes.bake import Atlas, bake_atlas, bake_program
from fastgen.render.passes.geometry import GeometryPass
from fastgen.render.passes.ground import GroundPass
from fastgen.render.passes.normals import NormalsPass
from fastgen.render.passes.ray_points import points_reach_px
from fastgen.render.passes.shading import ShadingPass
from fastgen.render.program import Programs, Read, shader_text
from fastgen.render.ray_light import RayLight
from fastgen.render.recent_targets import RecentTargets
from fastgen.render.regions import grown
from fastgen.render.scene_lights import LightChanges, SceneLights
from fastgen.render.settings import Quality
from fastgen.render.shadow_map import ShadowMap, light_values, shader_lights
from fastgen.render.shapes import Shapes
from fastgen.render.surface_values import SceneMaterials
from fastgen.render.tiles import Tiles
from fastgen.render.variant import ShaderVariant
from fastgen.render.visible_members import visible_members
from fastgen.render.zone_codes import SPREADER_ZONE
from fastgen.scene import Camera, Scene
from fastgen.scene.damage_kinds import program_kinds
from fastgen.scene.limits import MM

_NO_PRINTS = OwnPrints()


class Renderer:
    """Draws scenes on one GL context. A context manager: leaving it frees everything it made.

    Attributes:
        ctx: The moderngl context.
    """

    def __init__(
        self,
        gl: GLContext,
        light: Callable[[str], EnvironmentLight],
        quality: Quality,
        damage: DamageConfig | None = None,
        read: Read = shader_text,
        without: tuple[str, ...] = (),
        own: OwnPrints = _NO_PRINTS,
    ) -> None:
        """Prepare a renderer.

        Args:
            gl: Current context, which stays the caller's.
            light: Returns the prefiltered environment of a name, such as `load_environment`.
            quality: Samples, lookups and light. Images whose samples do not fit the driver's
                textures get fewer samples. A traced quality needs `ray_bodies.check_rays`.
            damage: Threshold of masks, and kinds to compile programs for; None for the defaults.
                The first scene with another kind takes longer, because its programs are compiled.
            read: Returns the text of a shader file by its name.
            without: Material layers of LAYERS to leave out of images.
            own: Artwork and fonts of a configuration.
        """
        self._gl = gl
        self.ctx = gl.ctx
        self._quality = quality
        damage = damage or DamageConfig()
        self._without = without
        self._programs = programs = Programs(self.ctx, read)
        self._kinds = program_kinds(damage.kinds)
        self._geometry = GeometryPass(self.ctx, programs, self._kinds)
        self._background = BackgroundPass(self.ctx, programs, by_compute=not gl.software)
        self._ground = GroundPass(self.ctx, programs, self.ambient, self._light_changes)
        self._shading = ShadingPass(self.ctx, programs)
        self._normals = NormalsPass(self.ctx, programs)
        self._materials = MaterialTextures(gl, own)
        self._rays = RayLight(gl, programs, self._materials.resources, self.ambient)
        self._targets = RecentTargets(gl, quality)
        self._batch = BatchReadback(self.ctx, collects=not gl.software)
        self._shapes = Shapes(self.ctx, self._geometry.programs)
        self._lights = SceneLights(gl, light, quality)
        self._blocks = DrawBlocks(self.ctx, damage.mask_threshold_mm)

    def render(
        self,
        prepared: PreparedScene,
        camera: Camera,
        size: tuple[int, int],
        layer: str = "all",
        radiance: bool = False,
        normals: bool = False,
    ) -> Frame:
        """Draw a scene as a camera sees it, and copy the image to the CPU.

        Args:
            prepared: A scene that `check_scene` accepts.
            camera: Any camera outside the containers and above the ground.
            size: (width, height) in pixels.
            layer: "all", or one of LAYERS to see a single material layer unlit.
            radiance: Return exposed linear radiance in `Frame.radiance`, and a black image.
            normals: Return surface normals in `Frame.normals`.
        """
        image = ImageRequest(prepared, camera, view_of(camera, size), layer, radiance, normals)
        return self.render_batch([image])[0]

    def render_batch(self, images: Sequence[ImageRequest]) -> list[Frame]:
        """Draw images of one size one after the other, and copy them to the CPU.

        Args:
            images: The images, at most one group of `batch_readback.chunks`.

        Returns:
            The frames in the same order.
        """
        found = [
            np.zeros((*each.view.size[::-1], 3), np.float32) if each.normals else None
            for each in images
        ]
        frames = self._batch.read(images, lambda k: self._draw(images[k], found[k]))
        return [replace(frame, normals=found[k]) for k, frame in enumerate(frames)]

    def draw(self, prepared: PreparedScene, camera: Camera, size: tuple[int, int]) -> ImageTargets:
        """Draw a scene and leave the image on the GPU until the next draw.

        Sensor effects, fog and rain are not applied.

        Args:
            prepared: A scene that `check_scene` accepts.
            camera: Any camera outside the container.
            size: (width, height) in pixels.
        """
        return self._draw(ImageRequest(prepared, camera, view_of(camera, size)))

    def _draw(
        self, image: ImageRequest, normals: NDArray[np.float32] | None = None
    ) -> ImageTargets:
        """Draw an image, and fill `normals` [H, W, 3] if given.

        Containers do not overlap. Those that may be visible are drawn from back to front.
        """
        prepared, view, scene = image.prepared, image.view, image.prepared.scene
        self._compile_for(prepared)
        self._materials.release_old(len(prepared.members))
        for each in prepared.members:  # their artwork may replace a texture, which inputs hold
            self._materials.resources(each.prepared)
        exposure = self._lights.exposure(scene, image.camera, view).factor
        several = bool(scene.neighbours or scene.ground)
        options = DrawOptions(image.layer, image.radiance, over=several)
        light_changes = self._light_changes(prepared) if several else None
        inputs = self._inputs(prepared, view, options, light_changes)
        first = prepared.members[0]
        self._light(inputs, first, prepared, exposure)
        if not several:
            self._geometry.run(inputs)
            self._trace(inputs, first, prepared, light_changes)
            self._background.run(inputs)
            self._shade(inputs, first, exposure, normals)
            return inputs.targets
        plan = self._ground.plan(prepared, view)
        self._background.run(inputs, plan)
        if plan is not None:
            self._ground.run(inputs, prepared, plan)
        tiles = Tiles(view) if plan is None else plan.tiles
        for member, part in visible_members(prepared.present, view, tiles):
            own = view.in_frame(member.pose)
            inputs = self._inputs(member.prepared, own, options, light_changes)
            if inputs.variant.traced:  # ray points beside a region light pixels in it
                part = grown(part, points_reach_px(view.size), view.size)
            inputs = replace(inputs, regions=inputs.regions.within(part))
            if inputs.regions.surfaces:
                self._light(inputs, member, prepared, exposure)
                self._geometry.run(inputs)
                self._trace(inputs, member, prepared, light_changes)
                self._shade(inputs, member, exposure, normals)
        return inputs.targets

    def _light_changes(self, prepared: PreparedScene) -> LightChanges:
        """Return what surroundings change in the light on each container that a scene shows."""
        return self._lights.light_changes(prepared, self._materials.resources)

    def _compile_for(self, prepared: PreparedScene) -> None:
        """Compile programs for kinds of damage that the current programs cannot draw."""
        members = (member.prepared.scene.damages for member in prepared.members)
        kinds = {damage.kind for damages in members for damage in damages}
        if not kinds <= set(self._kinds):
            more = program_kinds(kinds.union(self._kinds))
            geometry = GeometryPass(self.ctx, self._programs, more)  # may fail
            self._geometry.release()
            self._shapes.release()
            self._kinds, self._geometry = more, geometry
            self._shapes = Shapes(self.ctx, geometry.programs)

    def _shade(
        self,
        inputs: DrawInputs,
        member: Member,
        exposure: float,
        normals: NDArray[np.float32] | None,
    ) -> None:
        """Shade the surfaces in the visibility buffer, and write their normals if asked.

        The cables above the container, which may need more samples, are drawn here.
        """
        if inputs.regions.surfaces:
            inputs.targets.bind_images(inputs.variant.over)
            self._shading.run(inputs)
        if normals is not None:
            found = self._normals.run(inputs)
            np.copyto(normals, found, where=found.any(axis=-1, keepdims=True))
        if inputs.regions.cables:
            _, per_axis = self._targets.samples_per_axis(member.prepared, inputs.view)
            finer = inputs.of_cables(self._targets.samples(inputs.view.size, per_axis))
            self._blocks.view(finer, member.prepared.scene, exposure)
            self._geometry.run_cables(finer)
            self._shade(finer, member, exposure, normals)

    def _inputs(
        self,
        prepared: PreparedScene,
        view: View,
        options: DrawOptions,
        light_changes: LightChanges | None = None,
    ) -> DrawInputs:
        """Collect what the passes share, and fill the uniform blocks of scene and damages."""
        scene, size, lens = prepared.scene, view.size, view.distortion is not None
        damages = seen_damages(scene.damages, tuple((view.position_m / MM).tolist()))
        damage = variant(damages)
        per_axis, of_cables = self._targets.samples_per_axis(prepared, view)
        samples = self._targets.samples(size, per_axis)
        light, ambient = self._lights.of(scene), self.ambient(scene)
        resources = self._materials.resources(prepared)
        light_change = None if light_changes is None else light_changes.get(prepared)
        container, spreader, below = self._shapes.of(
            prepared, resources.materials, lens, ambient, light_change
        )
        seals = self._shapes.seals(prepared, below)
        decals = resources.decals(scale_for(prepared.container, view))
        ground = None if light_change is None else light_change.ground
        self._blocks.scene(prepared, decals, len(light.background), ground)
        if damage != "undamaged":
            self._blocks.damages(prepared, damages, self._kinds, samples.inner_row)
        return DrawInputs(
            view=view,
            damages=damages,
            container=container,
            seals=seals,
            spreader=spreader,
            regions=regions_of(view, prepared, damages, apart=per_axis < of_cables),
            targets=self._targets.image(size, options.radiance),
            samples=samples,
            coarse_ground=self._quality.coarse_ground,
            variant=ShaderVariant(
                samples_per_axis=per_axis,
                lookups=self._quality.lookups,
                layer=options.layer,
                damage=damage,
                kinds=self._kinds,
                lights=shader_lights(ambient.lights),
                traced=light.sky_rays is not None and options.layer == "all",
                radiance=options.radiance,
                without=self._without,
                over=options.over,
                lens=lens,
            ),
            textures={
                **self._materials.of(decals, self._shapes.zone_table(container, spreader)),
                "specular_map": light.specular,
                "irradiance_map": light.irradiance,
                "obstacle_map": light.obstacles,
                "environment_map": self._lights.background(scene.environment.name),
            },
        )

    def _light(
        self, inputs: DrawInputs, member: Member, whole: PreparedScene, exposure: float
    ) -> None:
        """Cast the shadows of the directional lights, and fill the uniform block of the view.

        Args:
            inputs: The image.
            member: The container that is drawn.
            whole: The scene, whose other containers cast shadows on it.
            exposure: Factor on radiance.
        """
        scene, view = member.prepared.scene, inputs.view
        lights = self.ambient(scene).lights
        shadow = self._lights.shadows.cast(member, whole, lights)
        if shadow is not None:
            inputs.textures["shadow_map"] = shadow.depth
        inputs.lights.update(light_values(lights, shadow, view.position_m))
        self._blocks.view(inputs, scene, exposure)

    def _trace(
        self,
        inputs: DrawInputs,
        member: Member,
        whole: PreparedScene,
        light_changes: LightChanges | None,
    ) -> None:
        """Light the visible surfaces by rays, if the quality asks for it."""
        sky = self._lights.of(whole.scene).sky_rays
        if not inputs.variant.traced or sky is None or not inputs.regions.surfaces:
            return
        self._rays.run(
            inputs, member, whole, self._shapes, light_changes, self._ground.light(whole), sky
        )

    def preload(self, prepared: PreparedScene, lens: bool, damages: bool) -> None:
        """Prepare the shapes of a scene, so that drawing them takes no more time or memory.

        Args:
            prepared: The scene.
            lens: Prepare for images with lens distortion.
            damages: Prepare for damaged scenes too.
        """
        prepared.prepare_shapes(lens, damages)
        _ = SceneMaterials(prepared).reflectances
        self._shapes.preload(prepared, lens, damages)

    def preload_environment(self, name: str) -> None:
        """Prepare the light and the background of an environment."""
        self._lights.background(name)

    def programs_key(
        self, prepared: PreparedScene, camera: Camera, size: tuple[int, int]
    ) -> Hashable:
        """Return a key that is equal for all draws that use the same programs.

        Args:
            prepared: The scene.
            camera: The camera.
            size: (width, height) in pixels.
        """
        view = view_of(camera, size)
        members = [(each.prepared, view.in_frame(each.pose)) for each in prepared.present]
        per_axis = frozenset(self._targets.samples_per_axis(*each) for each in members)
        damages = seen_damages(prepared.scene.damages, camera.position_mm)
        lights = shader_lights(self.ambient(prepared.scene).lights)
        spreader = prepared.scene.spreader.present
        return variant(damages), lights, camera.lens is not None, spreader, per_axis

    @property
    def shadow_map(self) -> ShadowMap:
        """Shadows of the directional lights on the first container of the last scene."""
        return self._lights.shadows.of(0)

    def ambient(self, scene: Scene) -> Ambient:
        """Return the light of a scene's environment in its fog, and of its lamps."""
        return self._lights.ambient(scene)

    def bake(self, prepared: PreparedScene, texel_mm: float) -> Atlas:
        """Bake the material of a scene's container, damage included, see bake.Atlas."""
        self._compile_for(prepared)
        scene, mesh = prepared.scene, self._shapes.container(prepared)
        damage = variant(scene.damages)
        if damage != "undamaged":
            self._blocks.damages(prepared, scene.damages, self._kinds)
        decals = self._materials.resources(prepared).decals()
        self._blocks.scene(prepared, decals)
        textures = self._materials.of(decals, self._shapes.zone_table(mesh, None))
        program = bake_program(self._programs, damage, self._kinds)
        return bake_atlas(self.ctx, program, textures, mesh.mesh, texel_mm)

    def bake_spreader(self, prepared: PreparedScene, texel_mm: float) -> Atlas | None:
        """Bake the material of a scene's spreader; None where the scene has none."""
        spreader = self._shapes.spreader(prepared)
        if spreader is None:
            return None
        decals = self._materials.resources(prepared).decals()
        self._blocks.scene(prepared, decals)
        container = self._shapes.container(prepared)
        textures = self._materials.of(decals, self._shapes.zone_table(container, spreader))
        program = bake_program(self._programs)
        return bake_atlas(
            self.ctx, program, textures, spreader.mesh, texel_mm, first_zone=SPREADER_ZONE
        )

    def bake_ground(self, prepared: PreparedScene, texel_mm: float) -> Atlas | None:
        """Bake the material of a scene's ground within its reach; None where it has none."""
        decals = self._materials.resources(prepared).decals()
        self._blocks.scene(prepared, decals)
        return self._ground.bake(prepared.scene, self._materials.shared, texel_mm)

    def exposure(self, scene: Scene, camera: Camera, size: tuple[int, int]) -> Exposure:
        """Return the exposure of a camera; its factor applies to radiance before the tone curve."""
        return self._lights.exposure(scene, camera, view_of(camera, size))

    def release(self) -> None:
        """Free every GL object of this renderer."""
        owners: list[Any] = [self._targets, self._batch, self._rays, self._shapes, self._lights]
        owners += [self._materials, self._geometry, self._ground, self._programs, self._blocks]
        for item in owners:
            item.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()
