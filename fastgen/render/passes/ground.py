"""Ground pass: the plane below the containers and the props on it, drawn over the background."""

from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np

from fastgen.camera.projection import View
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.environment import Ambient, to_map_frame
from fastgen.light.ground_light import GroundLight, ground_light
from fastgen.render.blocks import GROUND_BLOCK
from fastgen.render.constants import GROUND_FADE_START
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.ground_values import ground_values, prop_box
from fastgen.render.program import Programs
from fastgen.render.recent_cache import ReleasingCache
from fastgen.render.regions import Region, outside, region_of
from fastgen.scene import Ground, Scene

_BLOCK_PX = 16
"""Height of the blocks of rows in which it is decided what to draw."""

_COLUMNS = 17
"""Columns of an image whose rays are followed to find what its rows see."""

_SHADED_MM = 600.0
"""Distance from a prop within which it shades the ground, see ground_props.glsl."""

_LONGEST_SHADOW_MM = 10000.0


class GroundPass:
    """Draws the ground and the props over the background.

    Reads: noise and the maps of the environment. Writes: colour, labels (0) and depth of the image,
    only where the ray meets a prop, or the plane within the ground's reach. Alpha is the share that
    is not the panorama.
    """

    def __init__(
        self, ctx: moderngl.Context, programs: Programs, ambient: Callable[[str], Ambient]
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
        ambient = self._ambient(scene.environment.name)
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
        self._block.write(
            GROUND_BLOCK.pack(ground_values(ground, present, scene.props, kept.light))
        )
        self._block.bind_to_uniform_block(GROUND_BLOCK.binding)
        self._ctx.memory_barrier()  # compute shaders may have written the background
        inputs.targets.image.use()
        self._ctx.enable_only(moderngl.NOTHING)
        textures = {**inputs.textures, "ground_grid": kept.texture}
        for traits, regions in _regions(scene, ground, inputs.view, ambient).items():
            program = self._programs.get(
                ("fullscreen.vert", "ground.frag"),
                replace(
                    inputs.variant,
                    samples_per_axis=inputs.variant.samples_per_axis if "props" in traits else 1,
                    lookups=1,
                    damage="undamaged",
                    traced=False,
                    coarse=False,
                    without=(),
                    over=False,
                    ground=(ground.kind, *(("wet",) if ground.wetness else ()), *traits),
                ),
            )
            program.bind(textures)
            for region in regions:
                self._ctx.scissor = region
                program.draw_vertices(3)
        self._ctx.scissor = None

    def release(self) -> None:
        """Free all GL objects."""
        self._scenes.release()
        self._block.release()


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


def _regions(
    scene: Scene, ground: Ground, view: View, ambient: Ambient
) -> dict[tuple[str, ...], list[Region]]:
    """Return disjoint regions of the image by the traits of the program that draws each."""
    near, far = _bands(ground, view)
    if not scene.props:
        return {(): near, ("fades",): far}
    width, height = view.size
    around = region_of(view, _props_reach(scene, ground, ambient)) or (0, 0, width, height)
    return {
        (): outside(near, [around]),
        ("fades",): outside(far, [around]),
        ("fades", "props"): [around],
    }


def _bands(ground: Ground, view: View) -> tuple[list[Region], list[Region]]:
    """Return the rows that see only the near ground, and the others that may see ground.

    Near ground is not faded at all. It is the inside of a circle, and so is what an image sees of
    it convex without lens distortion; the border columns decide.
    """
    width, height = view.size
    rows = np.append(np.arange(0, height, _BLOCK_PX), height)
    x, y = np.meshgrid(np.linspace(0, width, _COLUMNS), rows)
    eye_mm, rays = view.rays(np.stack([x, y], axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (ground.height_mm - eye_mm[2]) / rays[..., 2]
        at = eye_mm[:2] + distance[..., None] * rays[..., :2]
    away = np.where(distance > 0, np.hypot(at[..., 0], at[..., 1]), np.inf)
    all_near = away.max(axis=1) < 0.97 * GROUND_FADE_START * ground.reach_mm
    some = away.min(axis=1) < ground.reach_mm
    blocks_near = all_near[1:] & all_near[:-1]
    # a block beside one that sees ground may see some between the columns
    seen = some[1:] | some[:-1]
    blocks_seen = seen | np.append(seen[1:], False) | np.append(False, seen[:-1])
    found: tuple[list[Region], list[Region]] = ([], [])
    for regions, blocks in zip(found, (blocks_near, blocks_seen & ~blocks_near), strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], blocks.astype(int), [0]])))
        for first, end in edges.reshape(-1, 2):
            top, bottom = int(rows[first]), int(rows[end])
            regions.append((0, top, width, bottom - top))
    return found


def _props_reach(scene: Scene, ground: Ground, ambient: Ambient) -> np.ndarray:
    """Return points [N, 3] in mm whose hull contains the props and what they shade."""
    corners = np.concatenate([prop_box(prop).corners_mm for prop in scene.props])
    low, high = corners.min(axis=0) - _SHADED_MM, corners.max(axis=0)
    low[2], high[:2] = ground.height_mm, high[:2] + _SHADED_MM
    hull = [
        np.array([x, y, z])
        for x in (low[0], high[0])
        for y in (low[1], high[1])
        for z in (low[2], high[2])
    ]
    if ambient.lights:
        light = to_map_frame(ambient.lights[0].direction, -scene.environment.yaw_deg)
        above = corners[:, 2:] - ground.height_mm
        thrown = -light[:2] * above / max(light[2], 1e-3)
        thrown *= np.minimum(1, _LONGEST_SHADOW_MM / np.maximum(np.hypot(*thrown.T), 1))[:, None]
        shadows = np.column_stack([corners[:, :2] + thrown, np.full(len(corners), low[2])])
        hull.extend(shadows)
    return np.array(hull)
