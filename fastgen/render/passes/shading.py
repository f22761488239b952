"""Shading passes: pixels that see surfaces are sorted into classes, and each class is shaded."""

from collections.abc import Sequence
from dataclasses import replace

import moderngl

from fastgen.render.constants import LIST_GROUP
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.program import Programs
from fastgen.render.regions import Region, outside, within
from fastgen.render.variant import PIXEL_CLASSES, ShaderVariant, listed_classes


class ShadingPass:
    """Shades all pixels that see a surface.

    Reads: the visibility buffer, material and decal tables, environment maps, the shadow map of
    the directional lights, and with `traced` the light that rays found. Writes: colour, labels and
    depth of the image. In between, a list per pixel class (PIXEL_CLASSES) holds the pixels, so that
    a compute shader without branches shades each class.
    """

    def __init__(self, ctx: moderngl.Context, programs: Programs) -> None:
        self._ctx = ctx
        self._programs = programs

    def run(self, inputs: DrawInputs) -> None:
        """Classify and shade the pixels, in bands of as many rows as the lists have room for."""
        targets, regions = inputs.targets, inputs.regions
        width, height = targets.size
        rows = targets.lists.rows
        for top in range(0, height, rows):
            band = (0, top, width, min(rows, height - top))
            seen, near = within(regions.surfaces, band), within(regions.near_damage, band)
            self._ctx.memory_barrier()  # earlier clears, stores and lists are complete
            targets.lists.begin()
            self._classify(inputs, outside(seen, near), damaged=False)
            self._classify(inputs, near, damaged=True)
            self._ctx.memory_barrier()
            self._shade(inputs)
        self._ctx.memory_barrier()

    def _classify(self, inputs: DrawInputs, regions: Sequence[Region], damaged: bool) -> None:
        """List the pixels of regions whose first column and row are even."""
        if not regions:
            return
        variant = replace(
            inputs.variant,
            damage=inputs.variant.damage if damaged else "undamaged",
            lights=0,
            lens=False,
        )
        program = self._programs.get(("classify.comp",), variant)
        program.bind(inputs.textures)
        for region in regions:
            program["region"] = region
            across, down = (-(-length // 2) for length in region[2:])  # in blocks of 2x2
            program.dispatch(-(-across * down // LIST_GROUP))

    def _shade(self, inputs: DrawInputs) -> None:
        """Shade the listed pixels of each class, in any order, because no pixel is in two lists."""
        listed = listed_classes(inputs.variant.samples_per_axis)
        for name in PIXEL_CLASSES:
            if name in listed and _occurs(name, inputs.variant):
                # scenes with and without damage share the programs
                damage = "holed" if "DAMAGE" in PIXEL_CLASSES[name] else "undamaged"
                variant = replace(inputs.variant, pixel_class=name, damage=damage)
                program = self._programs.get(("shade.comp",), variant)
                program.bind(inputs.textures)
                inputs.targets.lists.dispatch(name, program)


def _occurs(name: str, variant: ShaderVariant) -> bool:
    """Return whether an image of a variant can have pixels of a class."""
    traits = PIXEL_CLASSES[name]
    if "HOLES" in traits:
        return variant.damage == "holed"
    return variant.damage != "undamaged" or "DAMAGE" not in traits
