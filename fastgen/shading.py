"""The passes over the image: pixels are sorted into classes, each is shaded by itself."""

from collections.abc import Sequence
from typing import Any

import moderngl

from fastgen.programs import CLASS_DEPTH_STEP, PIXEL_CLASSES, link
from fastgen.targets import Region, Targets

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
    """The programs that shade one layer: a classifier, and one program a pixel class.

    They are linked when first needed, and scenes with and without damage share what they can.
    """

    def __init__(self, ctx: moderngl.Context, samples_per_axis: int, layer: str) -> None:
        self._ctx = ctx
        self._samples_per_axis = samples_per_axis
        self._layer = layer
        self._programs: dict[tuple[str, str], moderngl.Program] = {}
        self._arrays: dict[tuple[str, str], moderngl.VertexArray] = {}

    def draw(
        self,
        targets: Targets,
        regions: Sequence[Region | None],
        damage: str,
        near_damage: Sequence[Region | None],
    ) -> None:
        """Shade into `targets.image`; all samplers and uniform blocks are bound already.

        regions: disjoint, and outside them there is only sky; None stands for all pixels.
        damage: one of programs.DAMAGE_VARIANTS. near_damage: the pixels that each damage may touch,
        None where that is not known.
        """
        image = targets.image
        image.use()
        targets.clear_classes()
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        image.depth_mask = True
        self._ctx.depth_func = "1"  # always
        self._run("classify", "sound", regions)
        for part in near_damage:
            self._run("classify", damage, [part] if part else regions)
        image.depth_mask = False
        self._ctx.depth_func = "=="
        for name, traits in PIXEL_CLASSES.items():
            if name != "sky" and self._comes(name, traits, damage):
                self._run(name, "holed" if "DAMAGE" in traits else "sound", regions)
        self._run("sky", "sound", [None])
        self._ctx.scissor = None
        image.depth_mask = True
        self._ctx.depth_func = "<"

    def _comes(self, name: str, traits: tuple[str, ...], damage: str) -> bool:
        """Whether the classifier of this variant may give any pixel this class."""
        if self._samples_per_axis == 1 and name.startswith("mixed"):
            return False
        if "HOLES" in traits:
            return damage == "holed"
        return damage != "sound" or "DAMAGE" not in traits

    def _run(self, name: str, damage: str, regions: Sequence[Region | None]) -> None:
        key = (name, damage)
        if key not in self._arrays:
            variant: dict[str, Any] = {
                "samples_per_axis": self._samples_per_axis,
                "layer": self._layer,
                "damage": damage,
            }
            fragment = "classify.frag"
            if name != "classify":
                fragment = "shade.frag"
                variant["pixel_class"] = name
            program = link(self._ctx, "fullscreen.vert", fragment, UNITS, **variant)
            if name != "classify":
                program["class_depth"] = list(PIXEL_CLASSES).index(name) * CLASS_DEPTH_STEP
            self._programs[key] = program
            self._arrays[key] = self._ctx.vertex_array(program, [])
        for region in regions:
            self._ctx.scissor = region
            self._arrays[key].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free all GL objects."""
        items: list[Any] = [*self._arrays.values(), *self._programs.values()]
        for item in items:
            item.release()
