"""Background pass: the sky, ahead of all surfaces."""

from dataclasses import replace

import moderngl

from fastgen.render.constants import LIST_GROUP
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.drawn_tiles import DrawnTiles
from fastgen.render.ground_plan import GroundPlan
from fastgen.render.program import Programs

_OCTAHEDRON = 24
"""Corners of the eight triangles of an octahedron."""


class BackgroundPass:
    """Shades at least the pixels that see only sky, and clears labels and depth.

    Reads: the background map, and with single samples the depth of the visibility buffer, unless
    surfaces are drawn over the sky later. Writes: colour, labels and depth of the image.
    """

    def __init__(self, ctx: moderngl.Context, programs: Programs, by_compute: bool) -> None:
        """Choose how the sky is drawn.

        Args:
            ctx: Current context.
            programs: Programs of the renderer.
            by_compute: Use a compute shader. Data-centre GPUs have few multiprocessors that run
                fragment shaders; llvmpipe takes twice as long this way.
        """
        self._ctx = ctx
        self._programs = programs
        self._by_compute = by_compute

    def run(self, inputs: DrawInputs, plan: GroundPlan | None = None) -> None:
        """Draw the sky and leave the image's targets bound for compute shaders.

        Args:
            inputs: The image.
            plan: Says which tiles need it, if there is ground; by default all do.
        """
        if self._by_compute:
            self._ctx.memory_barrier()  # the last image has been read
            inputs.targets.bind_images()
            self._store(inputs)
        else:
            self._draw(inputs, plan)
            inputs.targets.bind_images()

    def _draw(self, inputs: DrawInputs, plan: GroundPlan | None) -> None:
        single_layer = inputs.variant.layer != "all"
        per_pixel = single_layer or inputs.view.distortion is not None or plan is not None
        if per_pixel:
            vertex = "fullscreen.vert" if plan is None else "rectangles.vert"
            stages = (vertex, "background_by_ray.frag")
        else:
            stages = ("background.vert", "background.frag")
        program = self._programs.get(
            stages, replace(inputs.variant, damage="undamaged", lights=0, over=False)
        )
        self._ctx.scissor = None
        only_sky = inputs.targets.begin(inputs.samples, inputs.variant.over)
        self._ctx.enable_only(moderngl.DEPTH_TEST if only_sky else moderngl.NOTHING)
        if plan is not None:
            with DrawnTiles(self._ctx, plan.tiles, [plan.sky]) as drawn:
                drawn.draw(0, program, inputs.textures, inputs.targets.size)
            return
        program.bind(inputs.textures)
        program.draw_vertices(3 if per_pixel else _OCTAHEDRON)

    def _store(self, inputs: DrawInputs) -> None:
        """Shade all pixels as sky, and store their labels and depth."""
        variant = replace(inputs.variant, damage="undamaged", lights=0, over=False)
        program = self._programs.get(("background.comp",), variant)
        program.bind(inputs.textures)
        width, height = inputs.targets.size
        program.dispatch(-(-width // LIST_GROUP), height)
