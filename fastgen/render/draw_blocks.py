"""Uniform blocks that all draws share: those of the scene, the view and the damages."""

from collections.abc import Mapping

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.blocks import DAMAGE_BLOCK, SCENE_BLOCK, VIEW_BLOCK
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.scene_resources import DecalTextures
from fastgen.render.surface_values import damage_values, scene_values
from fastgen.render.uniforms import Block
from fastgen.render.view_values import view_values
from fastgen.scene import Damage, Scene


class DrawBlocks:
    """Buffers of the three blocks; each method fills one for the draws that follow.

    All are bound from the start, because some shaders declare blocks that they do not read.

    Args:
        ctx: Current context.
        mask_threshold_mm: Displacement in mm above which a surface counts as damaged.
    """

    def __init__(self, ctx: moderngl.Context, mask_threshold_mm: float) -> None:
        self._mask_threshold_mm = mask_threshold_mm
        self._buffers: dict[str, moderngl.Buffer] = {}
        for block in (SCENE_BLOCK, VIEW_BLOCK, DAMAGE_BLOCK):
            self._buffers[block.name] = buffer = ctx.buffer(reserve=block.size)
            buffer.bind_to_uniform_block(block.binding)

    def scene(
        self,
        prepared: PreparedScene,
        decals: DecalTextures,
        background_size: int = 0,
        ground: NDArray[np.float32] | None = None,
    ) -> None:
        """Fill the block of the scene; the arguments are those of `scene_values`."""
        values = {**scene_values(prepared, background_size, ground), **decals.values}
        self._fill(SCENE_BLOCK, values)

    def damages(
        self,
        prepared: PreparedScene,
        shown: tuple[Damage, ...],
        kinds: tuple[str, ...],
        inner_row: int = 0,
    ) -> None:
        """Fill the block of damages; the arguments are those of `damage_values`."""
        threshold_mm = self._mask_threshold_mm
        self._fill(DAMAGE_BLOCK, damage_values(prepared, shown, kinds, threshold_mm, inner_row))

    def view(self, inputs: DrawInputs, scene: Scene, exposure: float) -> None:
        """Fill the block of the view for the samples of `inputs`.

        Args:
            inputs: The image.
            scene: The scene that it shows.
            exposure: Factor on radiance.
        """
        values = view_values(scene, inputs.view, inputs.samples, exposure)
        self._fill(VIEW_BLOCK, {**values, **inputs.lights})

    def _fill(self, block: Block, values: Mapping[str, ArrayLike]) -> None:
        buffer = self._buffers[block.name]
        buffer.write(block.pack(values))
        buffer.bind_to_uniform_block(block.binding)

    def release(self) -> None:
        """Free all GL objects."""
        for buffer in self._buffers.values():
            buffer.release()
