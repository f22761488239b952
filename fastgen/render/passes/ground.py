"""Ground pass: the plane below the containers and the props on it, drawn over the background."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.directional_lights import DirectionalLight
from fastgen.light.environment import Ambient, to_map_frame
from fastgen.light.ground_light import GroundLight, ground_light
from fastgen.render.blocks import GROUND_BLOCK
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.drawn_tiles import DrawnTiles
from fastgen.render.ground_plan import GroundPlan, ground_plan
from fastgen.render.ground_values import ground_values
from fastgen.render.passes.bake import Atlas, bake_ground
from fastgen.render.program import Programs, Textures
from fastgen.render.recent_cache import ReleasingCache
from fastgen.render.scene_lights import LightChanges
from fastgen.render.textures import data_texture
from fastgen.render.tiles import Mask
from fastgen.render.variant import GroundVariant, ShaderVariant
from fastgen.scene import Scene

Array = NDArray[np.float64]


class GroundPass:
    """Draws the ground and the props over the background.

    Reads: noise and the maps of the environment. Writes: colour, labels (0) and depth of the image
    where a sample of the pixel meets a prop, or the plane within the ground's reach. Depth is that
    at the middle of the pixel, which is infinite if only other samples meet a prop. Alpha is the
    share that is not the panorama.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        programs: Programs,
        ambient: Callable[[Scene], Ambient],
        light_changes: Callable[[PreparedScene], LightChanges],
    ) -> None:
        """Prepare the pass.

        Args:
            ctx: Current context.
            programs: Programs of the renderer.
            ambient: Returns the light of a scene, such as `Renderer.ambient`.
            light_changes: Returns the change of the light on each container that a scene shows.
        """
        self._ctx = ctx
        self._programs = programs
        self._ambient = ambient
        self._light_changes = light_changes
        self._block = ctx.buffer(reserve=GROUND_BLOCK.size)
        self._scenes: ReleasingCache[_SceneLight] = ReleasingCache(2)
        self._coarse: ReleasingCache[_CoarseTarget] = ReleasingCache(2)

    def plan(self, prepared: PreparedScene, view: View) -> GroundPlan | None:
        """Return what of an image is background, plane and props; None without ground.

        Args:
            prepared: The scene.
            view: Projection of the image, in the world frame.
        """
        scene = prepared.scene
        if scene.ground is None:
            return None
        lights = _world_lights(scene, self._ambient(scene))
        return ground_plan(scene.ground, scene.props, prepared.present, view, lights)

    def run(self, inputs: DrawInputs, prepared: PreparedScene, plan: GroundPlan) -> None:
        """Draw the ground of a scene that has one.

        Args:
            inputs: The image, with the view in the world frame.
            prepared: The scene.
            plan: What to draw.
        """
        light = self._fill_block(prepared)
        self._ctx.memory_barrier()  # compute shaders may have written the background
        self._ctx.enable_only(moderngl.NOTHING)
        self._ctx.scissor = None
        width, height = inputs.targets.size
        half = (width + 1) // 2, (height + 1) // 2
        textures = {**inputs.textures, "ground_grid": light.texture}
        coarse = None
        if inputs.coarse_ground:
            coarse = self._coarse.get(half, lambda: _CoarseTarget(self._ctx, *half))
            textures["ground_coarse"] = coarse.texture
        masks = None if plan.masks is None else data_texture(self._ctx, plan.masks)
        if masks is not None:
            textures["prop_tiles"] = masks
        steps = _steps(plan, inputs)
        with DrawnTiles(self._ctx, plan.tiles, [step.tiles for step in steps]) as drawn:
            for number, step in enumerate(steps):
                target, size = inputs.targets.image, (width, height)
                if coarse is not None and step.variant.ground.coarse:
                    target, size = coarse.framebuffer, half
                target.use()
                program = self._programs.get(("rectangles.vert", step.fragment), step.variant)
                drawn.draw(number, program, textures, size)
        if masks is not None:
            masks.release()

    def _fill_block(self, prepared: PreparedScene) -> "_SceneLight":
        """Fill and bind the ground's uniform block, and return the light on the ground."""
        scene, kept = prepared.scene, self._light_of(prepared)
        assert scene.ground is not None
        if kept.block is None:
            lights = _world_lights(scene, self._ambient(scene))
            toward = np.array(lights[0].direction if lights else (0.0, 0.0, 1.0))
            values = ground_values(scene.ground, prepared.present, scene.props, kept.light, toward)
            kept.block = GROUND_BLOCK.pack(values)
        self._block.write(kept.block)
        self._block.bind_to_uniform_block(GROUND_BLOCK.binding)
        return kept

    def _light_of(self, prepared: PreparedScene) -> "_SceneLight":
        """Return the light on the ground of a scene that has one."""
        scene, present = prepared.scene, prepared.present
        ground = scene.ground
        assert ground is not None
        light_changes = self._light_changes(prepared)
        return self._scenes.get(
            prepared,
            lambda: _SceneLight(
                self._ctx,
                ground_light(
                    [member.box for member in present],
                    [light_changes[member.prepared].faces[:4] for member in present],
                    self._ambient(scene),
                    scene.environment.yaw_deg,
                    ground.height_mm,
                ),
            ),
        )

    def light(self, prepared: PreparedScene) -> GroundLight | None:
        """Return the light on the ground of a scene; None if it has none."""
        return None if prepared.scene.ground is None else self._light_of(prepared).light

    def bake(self, scene: Scene, textures: Textures, texel_mm: float) -> Atlas | None:
        """Bake the material of a scene's ground within its reach; None if it has none.

        Args:
            scene: The scene, whose SCENE_BLOCK is filled already.
            textures: Textures that the material reads.
            texel_mm: Least width of a texel.
        """
        ground = scene.ground
        if ground is None:
            return None
        ambient = self._ambient(scene)
        unlit = ground_light([], [], ambient, 0.0, ground.height_mm)
        values = ground_values(ground, [], [], unlit, np.array([0.0, 0.0, 1.0]))
        self._block.write(GROUND_BLOCK.pack(values))
        self._block.bind_to_uniform_block(GROUND_BLOCK.binding)
        variant = ShaderVariant(ground=GroundVariant(ground.kind, wet=ground.wetness > 0))
        program = self._programs.get(("fullscreen.vert", "ground_bake.frag"), variant)
        return bake_ground(self._ctx, program, textures, ground.reach_mm, texel_mm)

    def release(self) -> None:
        """Free all GL objects."""
        self._scenes.release()
        self._coarse.release()
        self._block.release()


class _Step(NamedTuple):
    """Tiles that one program draws.

    Attributes:
        fragment: File of the fragment stage.
        variant: Choices that the program is compiled for.
        tiles: bool [R, C].
    """

    fragment: str
    variant: ShaderVariant
    tiles: Mask


def _steps(plan: GroundPlan, inputs: DrawInputs) -> list[_Step]:
    """Return what is drawn one after the other.

    Coarse images shade the plane at half the resolution, then spread it over the image.
    """
    variant = ShaderVariant(
        layer=inputs.variant.layer,
        lights=max(inputs.variant.lights, 1),  # with light_count 0, the program skips its light
        radiance=inputs.variant.radiance,
        lens=inputs.variant.lens,
    )
    steps = []
    props = plan.props.variant
    if inputs.coarse_ground and variant.layer == "all":
        for each in plan.plane:
            shrunk = replace(variant, ground=replace(each.variant, coarse=True))
            steps.append(_Step("ground.frag", shrunk, each.tiles))
        spread = replace(variant, lights=0)
        seen = np.logical_or.reduce([each.tiles for each in plan.plane])
        steps.append(_Step("ground_spread.frag", spread, seen))
        props = GroundVariant(boxes=props.boxes, props=True, plane=False)
    else:
        for each in plan.plane:
            own = replace(variant, ground=each.variant)
            steps.append(_Step("ground.frag", own, each.tiles & ~plan.props.tiles))
    own = replace(variant, lookups=inputs.variant.lookups, ground=props)
    steps.append(_Step("ground.frag", own, plan.props.tiles))
    return [step for step in steps if step.tiles.any()]


class _CoarseTarget:
    """Image of half the resolution: exposed radiance, and the share that is not the panorama."""

    def __init__(self, ctx: moderngl.Context, width: int, height: int) -> None:
        self.texture = ctx.texture((width, height), 4, dtype="f2")
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.texture.repeat_x = self.texture.repeat_y = False
        self.framebuffer = ctx.framebuffer([self.texture])

    def release(self) -> None:
        """Free the GL objects."""
        self.framebuffer.release()
        self.texture.release()


class _SceneLight:
    """Light on the ground of one scene, its texture, and the uniform block once it is packed."""

    block: bytes | None = None

    def __init__(self, ctx: moderngl.Context, light: GroundLight) -> None:
        rows, columns = light.texels.shape[:2]
        self.light = light
        self.texture = ctx.texture((columns, rows), 4, light.texels.tobytes(), dtype="f4")
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.texture.repeat_x = self.texture.repeat_y = False

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()


def _world_lights(scene: Scene, ambient: Ambient) -> list[DirectionalLight]:
    """Return the directional lights in the world frame, brightest first."""
    yaw_deg = -scene.environment.yaw_deg
    return [
        replace(light, direction=tuple(to_map_frame(light.direction, yaw_deg).tolist()))
        for light in ambient.lights
    ]
