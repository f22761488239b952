"""The passes over the image: pixels are sorted into classes, each is shaded by itself."""

from typing import Any

import moderngl

from fastgen.programs import CLASS_DEPTH_STEP, PIXEL_CLASSES, link
from fastgen.targets import Targets

UNITS = {
    "surface_keys": 0,
    "sheet_points": 1,
    "specular_light": 2,
    "irradiance_light": 3,
    "background_light": 4,
    "dfg_table": 5,
    "noise_tiles": 6,
    "art": 7,
    "glyph_tiles": 8,
    "chart_table": 9,
    "decal_grid": 10,
    "decal_table": 11,
    "glyph_table": 12,
    "rest_points": 13,
}


class Shading:
    """The programs that shade one layer, a classifier and one program a pixel class."""

    def __init__(
        self, ctx: moderngl.Context, samples_per_axis: int, layer: str, damage: str
    ) -> None:
        self._ctx = ctx
        variant = {"samples_per_axis": samples_per_axis, "layer": layer, "damage": damage}
        self._programs = [link(ctx, "fullscreen.vert", "classify.frag", UNITS, **variant)]
        for number, (name, traits) in enumerate(PIXEL_CLASSES.items()):
            needless = {"sound": {"DAMAGE", "HOLES"}, "damaged": {"HOLES"}, "holed": set()}[damage]
            if needless & set(traits) or (samples_per_axis == 1 and name.startswith("mixed")):
                continue
            program = link(ctx, "fullscreen.vert", "shade.frag", UNITS, pixel_class=name, **variant)
            program["class_depth"] = number * CLASS_DEPTH_STEP
            self._programs.append(program)
        self._arrays = [ctx.vertex_array(program, []) for program in self._programs]

    def draw(self, targets: Targets, region: tuple[int, int, int, int] | None) -> None:
        """Shade into `targets.image`; all samplers and uniform blocks are bound already.

        region: x, y, width and height of the pixels outside which there is only sky; None where
        that is not known.
        """
        image = targets.image
        image.use()
        targets.clear_classes()
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        classify, sky, *surfaces = self._arrays
        self._ctx.scissor = region
        image.depth_mask = True
        self._ctx.depth_func = "1"  # always
        classify.render(moderngl.TRIANGLES, vertices=3)
        image.depth_mask = False
        self._ctx.depth_func = "=="
        for array in surfaces:
            array.render(moderngl.TRIANGLES, vertices=3)
        self._ctx.scissor = None
        sky.render(moderngl.TRIANGLES, vertices=3)
        image.depth_mask = True
        self._ctx.depth_func = "<"

    def release(self) -> None:
        """Free all GL objects."""
        items: list[Any] = [*self._arrays, *self._programs]
        for item in items:
            item.release()
