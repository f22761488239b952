"""The passes over the image: pixels are sorted into classes, each is shaded by itself."""

from collections.abc import Sequence
from typing import Any

import moderngl

from fastgen.drawing.pixel_lists import PixelLists
from fastgen.drawing.programs import (
    CLASS_DEPTH_STEP,
    PIXEL_CLASSES,
    link,
    link_compute,
    listed_classes,
)
from fastgen.drawing.regions import Region
from fastgen.drawing.targets import Targets

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
    "zone_table": 9,
    "decal_grid": 10,
    "decal_table": 11,
    "glyph_table": 12,
    "rest_x": 13,
    "sheet_depths": 14,
    "openness_points": 15,
    "sun_shadow": 16,
    "lobe_masks": 17,
    "light_points": 18,
    "rest_y": 19,
    "rest_z": 20,
    "point_keys": 21,
    "point_places": 22,
    "point_light": 23,
}


_OCTAHEDRON = 24
"""Corners of its eight triangles."""


def _mask(color: bool, labels: bool) -> Any:
    """Of colour, and of labels and depth; moderngl's annotation knows the mask of a single one."""
    return [(color,) * 4, (labels,) * 4, (labels,) * 4]


class Shading:
    """The programs that shade one layer: a classifier, and one program a pixel class.

    They are linked when first needed, and scenes with and without damage share what they can.
    traced: whether light is what rays found, of drawing.light_points. coarse: see Renderer.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        samples_per_axis: int,
        lookups: int,
        layer: str,
        traced: bool = False,
        coarse: bool = False,
    ) -> None:
        self._ctx = ctx
        self._traced = traced
        self._coarse = coarse
        self._samples_per_axis = samples_per_axis
        self._lookups = lookups
        self._layer = layer
        self._programs: list[moderngl.Program] = []
        self._arrays: dict[tuple[str, str, str, int], moderngl.VertexArray] = {}
        self._listed: dict[tuple[str, int], moderngl.ComputeShader] = {}

    def draw(
        self,
        targets: Targets,
        regions: Sequence[Region | None],
        damage: str,
        near_damage: Sequence[Region | None],
        cables: Sequence[Region | None] = (),
        suns: int = 0,
        bent: bool = False,
    ) -> None:
        """Shade into `targets.image`; all samplers and uniform blocks are bound already.

        regions: disjoint, and outside them there is only sky; None stands for all pixels.
        damage: one of programs.DAMAGE_VARIANTS. near_damage: the pixels that damages may touch,
        disjoint, None where that is not known. cables: likewise, of bundles of them. suns: as many
        as sun_shadow.shader_suns tells, their shadow map bound. bent: if a lens bends the view.
        """
        image = targets.image
        image.use()
        self._ctx.scissor = None
        image.color_mask = _mask(color=False, labels=True)
        image.depth_mask = True
        targets.clear_to_sky()
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        self._ctx.depth_func = "1"  # always
        self._run("classify", "sky", "sound", regions)
        for part in near_damage:
            self._run("classify", "sky", damage, [part] if part else regions)
        image.color_mask = _mask(color=False, labels=False)
        if self._samples_per_axis > 1:
            self._ctx.depth_func = ">"
            self._run("cables", "cable", "sound", cables)
        image.depth_mask = False
        self._ctx.depth_func = "=="
        listed = listed_classes(self._samples_per_axis, damage, self._coarse)
        for name in listed:
            targets.lists.begin(name)
            self._run("list", name, "sound", regions)
        image.color_mask = _mask(color=True, labels=False)
        if self._samples_per_axis > 1:
            self._run("shade", "cable", "sound", cables, suns)
        self._draw_sky(bent)
        self._ctx.scissor = None
        self._ctx.memory_barrier()
        targets.bind_images()
        for name in listed:
            self._dispatch(name, targets.lists, suns)
        self._ctx.memory_barrier()
        self._ctx.depth_func = "<"

    def _run(
        self,
        stage: str,
        pixel_class: str,
        damage: str,
        regions: Sequence[Region | None],
        suns: int = 0,
    ) -> None:
        """Draw `stage`.frag over the pixels of a class in `regions`; the classifier gives all of
        them theirs."""
        key = (stage, pixel_class, damage, suns)
        if key not in self._arrays:
            depth = list(PIXEL_CLASSES).index(pixel_class) * CLASS_DEPTH_STEP
            self._link(key, "fullscreen.vert", f"{stage}.frag", depth)
        for region in regions:
            self._ctx.scissor = region
            self._arrays[key].render(moderngl.TRIANGLES, vertices=3)

    def _draw_sky(self, bent: bool) -> None:
        """Shade all pixels that are still of the first class."""
        if bent or self._layer != "all":
            self._run("shade", "sky", "sound", [None])
            return
        key = ("sky", "sky", "sound", 0)
        if key not in self._arrays:
            # clipping may round depths: they lie between the first two classes
            self._link(key, "sky.vert", "sky.frag", CLASS_DEPTH_STEP / 2)
        self._ctx.scissor = None
        self._ctx.depth_func = ">="
        self._arrays[key].render(moderngl.TRIANGLES, vertices=_OCTAHEDRON)

    def _link(
        self, key: tuple[str, str, str, int], vertex: str, fragment: str, class_depth: float
    ) -> None:
        program = link(self._ctx, vertex, fragment, UNITS, **self._variant(*key[1:]))
        program["class_depth"] = class_depth
        self._programs.append(program)
        self._arrays[key] = self._ctx.vertex_array(program, [])

    def _dispatch(self, pixel_class: str, lists: PixelLists, suns: int) -> None:
        """Shade the listed pixels of a class."""
        key = (pixel_class, suns)
        if key not in self._listed:
            damage = "holed" if "DAMAGE" in PIXEL_CLASSES[pixel_class] else "sound"
            self._listed[key] = link_compute(
                self._ctx, "shade_listed.comp", UNITS, **self._variant(pixel_class, damage, suns)
            )
        lists.dispatch(pixel_class, self._listed[key])

    def _variant(self, pixel_class: str, damage: str, suns: int) -> dict[str, Any]:
        return {
            "samples_per_axis": self._samples_per_axis,
            "lookups": self._lookups,
            "layer": self._layer,
            "pixel_class": pixel_class,
            "damage": damage,
            "suns": suns,
            "traced": self._traced,
            "coarse": self._coarse,
        }

    def release(self) -> None:
        """Free all GL objects."""
        items: list[Any] = [*self._arrays.values(), *self._programs, *self._listed.values()]
        for item in items:
            item.release()
