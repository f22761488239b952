"""Renderer: Scene -> Frame, the owner of all GL objects that this takes.

Indirect draws, of the spreader, of what of the container no damage touches and of the rest, write
for each sample which surface it sees and where on the unfolded sheet; one more a hole, what shows
through it. Then the sky is drawn, pixels that see more are listed by what is to be done there, and
each list is shaded: a pixel once for each different surface among its samples. Colour, ids, damage
and depth come of it, the last three at the pixel centre. Traced, points of what the samples see are
read back in between, and the light that rays find there goes to the shaders. Ids are never
filtered: a sample lies exactly on each pixel centre.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from fastgen.camera.projection import View, view_of
from fastgen.decals.artwork import art_images, glyph_coverage, glyph_tiles
from fastgen.frame import Frame
from fastgen.geometry.damage_law import corners_mm, seen_damages, variant
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.spreader import tier_bounds_mm
from fastgen.light.environment import Ambient, EnvironmentLight, to_map_frame
from fastgen.light.exposure import metered_exposure
from fastgen.light.ray_bodies import RayBodies
from fastgen.light.reflectance import dfg_table
from fastgen.light.sky_visibility import lobe_masks
from fastgen.light.traced_light import traced_light
from fastgen.render.bake import Atlas, bake_atlas
from fastgen.render.environment_textures import GpuLight
from fastgen.render.gl import GLContext
from fastgen.render.gpu_mesh import GpuMesh
from fastgen.render.light_points import LightPoints, point_step
from fastgen.render.programs import (
    DAMAGE_BLOCK,
    DAMAGE_VARIANTS,
    LAYERS,
    LOBE_CELLS,
    REACH_MARGIN_MM,
    SCENE_BLOCK,
    SPREADER_ZONE,
    VIEW_BLOCK,
    link,
)
from fastgen.render.recent_cache import Kept, Recent
from fastgen.render.regions import Region, bands, box_corners, merged, region_of
from fastgen.render.sample_lattice import fitting
from fastgen.render.sample_targets import SampleTargets
from fastgen.render.scene_decals import SceneDecals
from fastgen.render.shading import UNITS, Shading
from fastgen.render.shadow_map import ShadowMap, shader_suns, sun_values
from fastgen.render.shapes import Shapes, ray_bodies, shadow_casters
from fastgen.render.surface_values import cable_values, damage_values, scene_values
from fastgen.render.targets import Targets
from fastgen.render.textures import art_texture, mipmapped_array, noise_texture
from fastgen.render.uniforms import Block
from fastgen.scene import Camera, Container, Damage, Scene


class Renderer:
    """Draws scenes on one GL context. A context manager: leaving it frees all that it made.

    gl: a current context; it stays the caller's. samples_per_axis: 1 (no antialiasing), 2, 3 or 5;
    fewer for images whose samples the driver's textures have no room for. lookups: of the material
    layers in a pixel, 1, 2 or 25; 1 of one sample.
    mask_threshold_mm: what moved by more counts as damaged. traced: whether light is found by rays
    at points of the image, and not at vertices alone; ask ray_bodies.check_rays first.
    shadow_detail: as of sun_shadow.ShadowMap. coarse: whether those of two by two pixels that see
    one facet, without prints or damage near, are shaded at once, as Vaidyanathan et al. 2014,
    Coarse Pixel Shading, do; of one sample a pixel only.
    light: gives the prefiltered environment of a name, for example from `load_environment`.
    """

    def __init__(
        self,
        gl: GLContext,
        light: Callable[[str], EnvironmentLight],
        samples_per_axis: int = 3,
        lookups: int = 2,
        mask_threshold_mm: float = 5.0,
        traced: bool = False,
        shadow_detail: float = 1.0,
        coarse: bool = False,
    ) -> None:
        self._gl = gl
        self._ctx = gl.ctx
        self._light_of = light
        self._samples_per_axis = samples_per_axis
        self._lookups = lookups
        self._mask_threshold_mm = mask_threshold_mm
        self._traced = traced
        self._coarse = coarse
        self._geometry = {
            damage: link(self._ctx, "geometry.vert", "geometry.frag", UNITS, damage=damage)
            for damage in DAMAGE_VARIANTS
        }
        self._shading: Kept[Shading] = Kept(len(LAYERS))
        self._targets: Kept[Targets] = Kept(2)
        self._points: Kept[LightPoints] = Kept(2)
        self._bodies: Recent[RayBodies] = Recent(2)
        self._shapes = Shapes(self._ctx, self._geometry)
        self._lights: Kept[GpuLight] = Kept(24)
        self._scenes: Kept[SceneDecals] = Kept(2)
        self._occluder = link(self._ctx, "occluder.vert", "occluder.frag", {})
        self._sun_shadow = ShadowMap(self._ctx, self._occluder, shadow_detail)
        self._blocks = {
            block.name: self._ctx.buffer(reserve=block.size)
            for block in (SCENE_BLOCK, VIEW_BLOCK, DAMAGE_BLOCK)
        }
        art, self._art_layers = art_images()
        tiles, self._fonts = glyph_tiles()
        self._art = art_texture(gl, art)
        texels = np.stack([tiles, glyph_coverage(tiles)], axis=-1)
        self._tiles = mipmapped_array(self._ctx, texels)
        self._noise = noise_texture(gl)
        table = dfg_table()
        self._dfg = self._ctx.texture(table.shape[1::-1], 2, table.tobytes(), dtype="f4")
        self._dfg.repeat_x = self._dfg.repeat_y = False
        masks = lobe_masks(LOBE_CELLS)
        self._lobes = self._ctx.texture(masks.shape[1::-1], 4, masks.tobytes(), dtype="u4")
        self._lobes.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def render(
        self, scene: Scene, camera: Camera, size: tuple[int, int], layer: str = "all"
    ) -> Frame:
        """Draw `scene` as `camera` sees it, (width, height) = size pixels, and read it back.

        layer: 'all', or one of programs.LAYERS to see a single material layer unlit.
        """
        return self.draw(scene, camera, size, layer).read()

    def draw(
        self, scene: Scene, camera: Camera, size: tuple[int, int], layer: str = "all"
    ) -> Targets:
        """As `render`, without reading back: the targets keep the image until the next draw."""
        view = view_of(camera, size)
        damages = seen_damages(scene.damages, camera.position_mm)
        damage = variant(damages)
        limit = self._ctx.info["GL_MAX_TEXTURE_SIZE"]
        per_axis = fitting(self._samples_per_axis, size, limit)
        targets = self._targets.get(size, lambda: Targets(self._gl, size, per_axis))
        samples = targets.samples
        light = self._light(scene.environment.name)
        mesh, spreader, lit = self._shapes.of(scene, camera.lens is not None, light.ambient)
        rays = light.sky_rays if layer == "all" else None
        shading = self._shading.get(
            (layer, per_axis),
            lambda: Shading(
                self._ctx,
                per_axis,
                self._lookups,
                layer,
                traced=rays is not None,
                coarse=self._coarse and per_axis == 1,
                compute_sky=not self._gl.software,
            ),
        )
        shadow = self._shadow(scene)
        seen = _view_values(scene, view, samples, self._exposure(scene, camera, view))
        sunny = sun_values(light.ambient.suns, shadow, view.position_m)
        self._set(SCENE_BLOCK, scene_values(scene, light.background_size))
        hung = cable_values(scene, spreader.mesh if spreader else None, view)
        self._set(VIEW_BLOCK, {**seen, **sunny, **hung})
        if damage != "sound":
            shapes = damage_values(scene, damages, self._mask_threshold_mm, samples.inner_row)
            self._set(DAMAGE_BLOCK, shapes)
        touched = [region_of(view, corners_mm(item)) for item in damages]
        boxes = [box_corners(mesh.mesh.bounds_mm, damages)]
        cables: list[Region | None] = []
        if spreader is not None:
            frame, *above = map(box_corners, tier_bounds_mm(spreader.mesh))
            boxes = [np.concatenate([*boxes, frame]), *above]
            cables = [region_of(view, above[-1])]
        regions = bands([region_of(view, box) for box in boxes])
        near = merged(touched)
        holes = merged(
            [part for part, d in zip(touched, damages, strict=True) if d.kind == "perforation"]
        )
        drawn = bands([*regions, *near])
        # where shaders ask for rest positions, whatever was drawn there before
        asked = [*near, *cables] if rays is None else drawn
        samples.begin(damage, drawn, asked, holes)
        self._bind_surface(scene, mesh, spreader)
        self._sample(samples, holes, view, camera, damages, mesh, spreader)
        self._bind_light(samples, light, shadow)
        if rays is not None:
            bodies = self._bodies.get(
                (scene, camera.lens is not None),
                lambda: ray_bodies(
                    scene, mesh.mesh, spreader.mesh if spreader else None, lit, light.ambient
                ),
            )
            points = self._points.get(
                (size, per_axis), lambda: LightPoints(self._gl, size, per_axis)
            )
            found = points.read(damage, drawn, view.position_m)
            yaw_deg = scene.environment.yaw_deg
            points.light(found, traced_light(found, bodies, rays, yaw_deg))
        shading.draw(
            targets,
            regions,
            damage,
            near,
            cables,
            suns=shader_suns(light.ambient.suns),
            bent=camera.lens is not None,
        )
        return targets

    def _sample(
        self,
        samples: SampleTargets,
        holes: Sequence[Region | None],
        view: View,
        camera: Camera,
        damages: tuple[Damage, ...],
        mesh: GpuMesh,
        spreader: GpuMesh | None,
    ) -> None:
        """Draw the geometry into the empty sample targets; holes: pixels that they may touch."""
        self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._lobes.use(UNITS["lobe_masks"])
        self._ctx.front_face = "cw"  # clip y points down, see View.clip_matrix
        # a dent may tilt a face into view that the rest mesh turns away
        tilted = [d.face for d in damages if d.kind == "axis" or d.depth_mm < 0]
        bent = {face for place in tilted for face in place.split(".")}
        if spreader is not None:
            spreader.draw("sound", spreader.seen_from(camera.position_mm))
        seen = mesh.seen_from(camera.position_mm, bent)
        if damages:
            boxes = [corners_mm(item) for item in damages]
            seen, touched = mesh.clusters.parted(seen, boxes, REACH_MARGIN_MM)
            mesh.draw("sound", seen)
            samples.begin_damaged()
            mesh.draw("damaged", touched)
        else:
            mesh.draw("sound", seen)
        moved_mm = sum(abs(d.depth_mm) for d in damages)
        for region in holes:
            samples.limit_inside(region)
            mesh.draw("holed", mesh.clusters.seen_in(view, region, moved_mm))
        samples.end()

    def _bind_light(
        self, samples: SampleTargets, light: GpuLight, shadow: ShadowMap | None
    ) -> None:
        """Bind the samples and what lights them."""
        textures: dict[str, Any] = {
            "surface_keys": samples.keys,
            "sheet_points": samples.points,
            "sheet_depths": samples.depths,
            "openness_points": samples.openness,
            "light_points": samples.light,
            "specular_light": light.specular,
            "irradiance_light": light.irradiance,
            "background_light": light.background,
            "dfg_table": self._dfg,
        }
        textures |= zip(("rest_x", "rest_y", "rest_z"), samples.rest, strict=False)
        if shadow is not None:
            textures["sun_shadow"] = shadow.depth
        for name, texture in textures.items():
            texture.use(UNITS[name])

    def _shadow(self, scene: Scene) -> ShadowMap | None:
        """What the suns of a scene leave in the shade, None without any."""
        suns = self.ambient(scene.environment.name).suns
        if not suns:
            return None
        toward = to_map_frame([sun.direction for sun in suns], -scene.environment.yaw_deg)
        container, outline, spreader = shadow_casters(scene)
        self._sun_shadow.cast(container, spreader, toward, scene.damages, outline)
        return self._sun_shadow

    def preload(self, scene: Scene, lens: bool) -> None:
        """Make the light and the shapes of a scene, so that drawing it takes neither time nor
        memory for that; lens: whether one bends what is drawn."""
        light = self.ambient(scene.environment.name)
        self._shapes.zone_table(*self._shapes.of(scene, lens, light)[:2])

    def _light(self, environment: str) -> GpuLight:
        return self._lights.get(
            environment, lambda: GpuLight(self._gl, self._light_of(environment), self._traced)
        )

    def ambient(self, environment: str) -> Ambient:
        """The light of an environment as the CPU asks for it."""
        return self._light(environment).ambient

    def bake(self, scene: Scene, texel_mm: float) -> Atlas:
        """The material of the whole container of `scene` as textures, see bake.Atlas."""
        mesh = self._shapes.container(scene.container)
        damage = variant(scene.damages)
        self._set(SCENE_BLOCK, scene_values(scene, 0))
        if damage != "sound":
            values = damage_values(scene, scene.damages, self._mask_threshold_mm, 0)
            self._set(DAMAGE_BLOCK, values)
        self._bind_surface(scene, mesh, None)
        return bake_atlas(self._ctx, mesh.mesh, texel_mm, damage)

    def bake_spreader(self, scene: Scene, texel_mm: float) -> Atlas | None:
        """The spreader's material as textures, None where the scene has none."""
        spreader = self._shapes.spreader(scene, False)
        if spreader is None:
            return None
        self._set(SCENE_BLOCK, scene_values(scene, 0))
        self._bind_surface(scene, self._shapes.container(scene.container), spreader)
        return bake_atlas(self._ctx, spreader.mesh, texel_mm, "sound", SPREADER_ZONE)

    def exposure(self, scene: Scene, camera: Camera, size: tuple[int, int]) -> float:
        """Factor on radiance, ahead of the tone curve, with which `camera` takes `scene`."""
        return self._exposure(scene, camera, view_of(camera, size))

    def _exposure(self, scene: Scene, camera: Camera, view: View) -> float:
        light = self.ambient(scene.environment.name)
        paint = scene.surface.paint.albedo
        return metered_exposure(light, scene.environment.yaw_deg, view, camera, paint)

    def _bind_surface(self, scene: Scene, mesh: GpuMesh, spreader: GpuMesh | None) -> None:
        """Bind what the material layers read."""
        decals = self._scenes.get(
            scene,
            lambda: SceneDecals(self._ctx, scene, mesh.mesh, self._art_layers, self._fonts),
        )
        textures: dict[str, Any] = {
            "noise_tiles": self._noise,
            "art": self._art,
            "glyph_tiles": self._tiles,
            "zone_table": self._shapes.zone_table(mesh, spreader),
            **decals.textures,
        }
        for name, texture in textures.items():
            texture.use(UNITS[name])

    def _set(self, block: Block, values: Mapping[str, ArrayLike]) -> None:
        """Fill a uniform block for the draws to come."""
        buffer = self._blocks[block.name]
        buffer.write(block.pack(values))
        buffer.bind_to_uniform_block(block.binding)

    def mesh(self, container: Container) -> Mesh:
        """The rest mesh of a container, as it is drawn."""
        return self._shapes.container(container).mesh

    def release(self) -> None:
        """Free every GL object that this renderer made."""
        caches: list[Any] = [self._shading, self._targets, self._points, self._shapes]
        for kept in (*caches, self._lights, self._scenes, self._sun_shadow):
            kept.release()
        blocks: list[Any] = [*self._blocks.values()]
        for item in (*blocks, *self._geometry.values(), self._occluder):
            item.release()
        for texture in (self._art, self._tiles, self._noise, self._dfg, self._lobes):
            texture.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def _view_values(
    scene: Scene, view: View, samples: SampleTargets, exposure: float
) -> dict[str, ArrayLike]:
    """All members of VIEW_BLOCK."""
    to_samples = np.eye(4)
    to_samples[:2, :2] = samples.to_clip
    right, down, forward = view.rotation
    center_x, center_y = view.center_px
    yaw = np.deg2rad(scene.environment.yaw_deg)
    return {
        "world_to_clip": to_samples @ view.clip_matrix(),
        "ray_corner": forward - (center_x * right + center_y * down) / view.focal_px,
        "eye_m": view.position_m,
        "ray_right": right / view.focal_px,
        "ray_down": down / view.focal_px,
        "pixel_angle": 1 / view.focal_px,
        "exposure": exposure,
        "yaw": (np.cos(yaw), np.sin(yaw)),
        "point_step": point_step(view.size),
        **view.lens_values(samples.to_clip),
    }
