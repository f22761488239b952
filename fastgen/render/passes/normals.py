"""Normals pass: visibility buffer -> surface normals."""

from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.render.constants import LIST_GROUP
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.program import Programs
from fastgen.render.regions import outside, within


class NormalsPass:
    """Sums the normals of the samples in each pixel, weighted by the pixel filter.

    Reads: the visibility buffer. Writes: the normals of the image targets.
    """

    def __init__(self, ctx: moderngl.Context, programs: Programs) -> None:
        self._ctx = ctx
        self._programs = programs

    def run(self, inputs: DrawInputs) -> NDArray[np.float32]:
        """Return unit normals in view space, float32 [H, W, 3], 0 where no surface is seen."""
        targets, damage = inputs.targets, inputs.variant.damage
        whole = (0, 0, *targets.size)
        near = within(inputs.regions.near_damage, whole)
        undamaged = outside(within(inputs.regions.surfaces, whole), near)
        targets.bind_normals()
        self._ctx.memory_barrier()
        for regions, kind in ((undamaged, "undamaged"), (near, damage)):
            if not regions:
                continue
            traits = {"undamaged": "mixed", "damaged": "mixed_damaged", "holed": "holed"}
            variant = replace(
                inputs.variant, damage=kind, pixel_class=traits[kind], lights=0, lens=False
            )
            program = self._programs.get(("normals.comp",), variant)
            program.bind(inputs.textures)
            for x, y, width, height in regions:
                program["region"] = (x, y, width, height)
                program.dispatch(-(-width // LIST_GROUP), height)
        self._ctx.memory_barrier()
        world = targets.read_normals()
        normals = (world @ inputs.view.rotation.T.astype(np.float32)).astype(np.float32)
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-6)
        return normals
