"""The passes over the image: pixels are sorted into classes, each is shaded by itself."""

from collections.abc import Sequence
from typing import Any

import moderngl

from fastgen.pixel_lists import PixelLists
from fastgen.programs import CLASS_DEPTH_STEP, LISTED_CLASSES, PIXEL_CLASSES, link, link_compute
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
    "sheet_depths": 14,
}


class Shading:
    """The programs that shade one layer: a classifier, and one program a pixel class.

    They are linked when first needed, and scenes with and without damage share what they can.
    """

    def __init__(self, ctx: moderngl.Context, samples_per_axis: int, layer: str) -> None:
        self._ctx = ctx
        self._samples_per_axis = samples_per_axis
        self._layer = layer
        self._programs: list[moderngl.Program] = []
        self._arrays: dict[tuple[str, str, str], moderngl.VertexArray] = {}
        self._listed: dict[tuple[str, str], moderngl.ComputeShader] = {}

    def draw(
        self,
        targets: Targets,
        region: Region | None,
        damage: str,
        near_damage: Sequence[Region | None],
    ) -> None:
        """Shade into `targets.image`; all samplers and uniform blocks are bound already.

        region: the pixels outside which there is only sky; None where that is not known.
        damage: one of programs.DAMAGE_VARIANTS. near_damage: the pixels that each damage may touch.
        """
        image = targets.image
        image.use()
        targets.clear_classes()
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        self._ctx.scissor = region
        image.depth_mask = True
        self._ctx.depth_func = "1"  # always
        self._run("classify", "sky", "sound")
        for part in near_damage:
            self._ctx.scissor = part or region
            self._run("classify", "sky", damage)
        self._ctx.scissor = region
        image.depth_mask = False
        self._ctx.depth_func = "=="
        coming = [
            (name, "holed" if "DAMAGE" in traits else "sound")
            for name, traits in PIXEL_CLASSES.items()
            if name != "sky" and self._comes(name, traits, damage)
        ]
        listed = [(name, d) for name, d in coming if name in LISTED_CLASSES]
        image.color_mask = [(False,) * 4] * 3
        for name, _ in listed:
            targets.lists.begin(name)
            self._run("list", name, "sound")
        image.color_mask = [(True,) * 4] * 3
        for name, variant in coming:
            if (name, variant) not in listed:
                self._run("shade", name, variant)
        self._ctx.scissor = None
        self._run("shade", "sky", "sound")
        self._ctx.memory_barrier()
        targets.bind_images()
        for name, variant in listed:
            self._dispatch(name, variant, targets.lists)
        self._ctx.memory_barrier()
        image.depth_mask = True
        self._ctx.depth_func = "<"

    def _comes(self, name: str, traits: tuple[str, ...], damage: str) -> bool:
        """Whether the classifier of this variant may give any pixel this class."""
        if self._samples_per_axis == 1 and name.startswith("mixed"):
            return False
        if "HOLES" in traits:
            return damage == "holed"
        return damage != "sound" or "DAMAGE" not in traits

    def _run(self, stage: str, pixel_class: str, damage: str) -> None:
        """Draw `stage`.frag over the pixels of a class; the classifier gives all of them theirs."""
        key = (stage, pixel_class, damage)
        if key not in self._arrays:
            program = link(
                self._ctx, "fullscreen.vert", f"{stage}.frag", UNITS, **self._variant(*key[1:])
            )
            program["class_depth"] = list(PIXEL_CLASSES).index(pixel_class) * CLASS_DEPTH_STEP
            self._programs.append(program)
            self._arrays[key] = self._ctx.vertex_array(program, [])
        self._arrays[key].render(moderngl.TRIANGLES, vertices=3)

    def _dispatch(self, pixel_class: str, damage: str, lists: PixelLists) -> None:
        """Shade the listed pixels of a class."""
        key = (pixel_class, damage)
        if key not in self._listed:
            self._listed[key] = link_compute(
                self._ctx, "shade_listed.comp", UNITS, **self._variant(*key)
            )
        lists.dispatch(pixel_class, self._listed[key])

    def _variant(self, pixel_class: str, damage: str) -> dict[str, Any]:
        return {
            "samples_per_axis": self._samples_per_axis,
            "layer": self._layer,
            "pixel_class": pixel_class,
            "damage": damage,
        }

    def release(self) -> None:
        """Free all GL objects."""
        items: list[Any] = [*self._arrays.values(), *self._programs, *self._listed.values()]
        for item in items:
            item.release()
