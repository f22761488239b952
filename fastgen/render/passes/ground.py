"""Ground pass: the plane below the containers and the props on it, drawn over the background."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.environment import Ambient, to_map_frame
from fastgen.light.ground_light import GroundLight, ground_light
from fastgen.render.blocks import GROUND_BLOCK
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.ground_regions import GroundDraw, ground_plan
from fastgen.render.ground_values import ground_values
from fastgen.render.passes.bake import Atlas, bake_ground
from fastgen.render.program import Programs, Textures
from fastgen.render.recent_cache import ReleasingCache
from fastgen.render.textures import data_texture
from fastgen.render.variant import GroundVariant, ShaderVariant
from fastgen.scene import EnvironmentView, Scene

Array = NDArray[np.float64]


class GroundPass:
    """Draws the ground and the props over the background.

    Reads: noise and the maps of the environment. Writes: colour, labels (0) and depth of the image,
    only where the ray meets a prop, or the plane within the ground's reach. Alpha is the share that
    is not the panorama.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        programs: Programs,
        ambient: Callable[[EnvironmentView], Ambient],
    ) -> None:
        """Prepare the pass.

        Args:
            ctx: Current context.
            programs: Programs of the renderer.
            ambient: Returns the light of an environment, such as `Renderer.ambient`.
        """
        self._ctx = ctx
        self._programs = programs
        self._ambient = ambient
        self._block = ctx.buffer(reserve=GROUND_BLOCK.size)
        self._scenes: ReleasingCache[_SceneLight] = ReleasingCache(2)
        self._coarse: ReleasingCache[_CoarseTarget] = ReleasingCache(2)

    def run(self, inputs: DrawInputs, prepared: PreparedScene) -> None:
        """Draw the ground of a scene, if it has one.

        Args:
            inputs: The image, with the view in the world frame.
            prepared: The scene.
        """
        scene = prepared.scene
        ground = scene.ground
        if ground is None:
            return
        present = [m for m in prepared.members if m.prepared.scene.container.present]
        ambient = self._ambient(scene.environment)
        kept = self._scenes.get(
            prepared,
            lambda: _SceneLight(
                self._ctx,
                ground_light(
                    [member.box for member in present],
                    [member.prepared.scene.surface.paint.albedo for member in present],
                    ambient,
                    scene.environment.yaw_deg,
                    ground.height_mm,
                ),
            ),
        )
        toward = _first_light(scene, ambient)
        values = ground_values(ground, present, scene.props, kept.light, toward)
        self._block.write(GROUND_BLOCK.pack(values))
        self._block.bind_to_uniform_block(GROUND_BLOCK.binding)
        self._ctx.memory_barrier()  # compute shaders may have written the background
        self._ctx.enable_only(moderngl.NOTHING)
        boxes = [member.box for member in present]
        draws, tiles = ground_plan(scene, ground, inputs.view, boxes, toward)
        variant = ShaderVariant(
            layer=inputs.variant.layer,
            lights=inputs.variant.lights,
            radiance=inputs.variant.radiance,
        )
        textures = {**inputs.textures, "ground_grid": kept.texture}
        made = None if tiles is None else data_texture(self._ctx, tiles)
        if made is not None:
            textures["prop_tiles"] = made
        if inputs.variant.coarse and variant.layer == "all":
            self._draw_coarse(inputs, variant, textures, draws)
            draws = [
                each._replace(
                    variant=replace(each.variant, plane=False, shadows=False, fades=False)
                )
                for each in draws
                if each.variant.props
            ]
        inputs.targets.image.use()
        for each in draws:
            per_axis = inputs.variant.samples_per_axis if each.variant.props else 1
            self._draw(replace(variant, samples_per_axis=per_axis), textures, each)
        self._ctx.scissor = None
        if made is not None:
            made.release()

    def _draw(self, variant: ShaderVariant, textures: Textures, draw: GroundDraw) -> None:
        """Draw one region of the bound framebuffer."""
        own = replace(variant, ground=draw.variant)
        program = self._programs.get(("fullscreen.vert", "ground.frag"), own)
        program.bind(textures)
        self._ctx.scissor = draw.region
        program.draw_vertices(3)

    def _draw_coarse(
        self,
        inputs: DrawInputs,
        variant: ShaderVariant,
        textures: Textures,
        draws: Sequence[GroundDraw],
    ) -> None:
        """Shade the plane at half the resolution, and spread it over the image."""
        width, height = ((side + 1) // 2 for side in inputs.targets.size)
        target = self._coarse.get((width, height), lambda: _CoarseTarget(self._ctx, width, height))
        target.framebuffer.use()
        for each in draws:
            x, y, across, down = each.region
            # one texel more, because spreading interpolates
            left, top = max(x // 2 - 1, 0), max(y // 2 - 1, 0)
            right, bottom = (x + across + 3) // 2, (y + down + 3) // 2
            own = replace(each.variant, props=False, coarse=True)
            part = GroundDraw(own, (left, top, right - left, bottom - top))
            self._draw(variant, textures, part)
        inputs.targets.image.use()
        lens = inputs.view.distortion is not None
        program = self._programs.get(
            ("fullscreen.vert", "ground_spread.frag"),
            replace(variant, lights=0, ground=GroundVariant(lens=lens)),
        )
        program.bind({"ground_coarse": target.texture})
        for each in draws:
            self._ctx.scissor = each.region
            program.draw_vertices(3)

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
        ambient = self._ambient(scene.environment)
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
    """Light on the ground of one scene, and its texture."""

    def __init__(self, ctx: moderngl.Context, light: GroundLight) -> None:
        rows, columns = light.texels.shape[:2]
        self.light = light
        self.texture = ctx.texture((columns, rows), 4, light.texels.tobytes(), dtype="f4")
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.texture.repeat_x = self.texture.repeat_y = False

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()


def _first_light(scene: Scene, ambient: Ambient) -> Array:
    """Return the unit vector [3] to the brightest directional light; up if there is none."""
    if not ambient.lights:
        return np.array([0.0, 0.0, 1.0])
    return to_map_frame(ambient.lights[0].direction, -scene.environment.yaw_deg)
