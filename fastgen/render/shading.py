"""The passes over the image: the sky, then pixels sorted into classes, each shaded by itself."""

from collections.abc import Sequence
from typing import Any

import moderngl

from fastgen.render.pixel_lists import PixelLists
from fastgen.render.programs import LIST_GROUP, PIXEL_CLASSES, link, link_compute, listed_classes
from fastgen.render.regions import Region, outside, within
from fastgen.render.targets import Targets

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
    "decal_cells": 24,
}


_OCTAHEDRON = 24
"""Corners of its eight triangles."""


class Shading:
    """The programs that shade one layer: the sky's, classifiers, and one program a pixel class.

    They are linked when first needed, and scenes with and without damage share what they can.
    traced: whether light is what rays found, of drawing.light_points. coarse: see Renderer.
    compute_sky: whether a compute shader stores the sky, where else a fragment shader draws it: few
    multiprocessors of a data centre's GPU run fragment shaders, all run compute shaders. llvmpipe
    takes twice as long.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        samples_per_axis: int,
        lookups: int,
        layer: str,
        traced: bool = False,
        coarse: bool = False,
        compute_sky: bool = False,
    ) -> None:
        self._ctx = ctx
        self._traced = traced
        self._coarse = coarse
        self._compute_sky = compute_sky
        self._sky: moderngl.ComputeShader | None = None
        self._samples_per_axis = samples_per_axis
        self._lookups = lookups
        self._layer = layer
        self._skies: dict[tuple[str, str], tuple[moderngl.Program, moderngl.VertexArray]] = {}
        self._classifiers: dict[tuple[str, bool], moderngl.ComputeShader] = {}
        self._shaders: dict[tuple[str, int], moderngl.ComputeShader] = {}

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
        if self._compute_sky:
            self._ctx.memory_barrier()  # whatever still reads the last image is done with it
            targets.bind_images()
            self._store_sky(targets.size)
        else:
            self._draw_sky(targets, bent)
            targets.bind_images()
        width, height = targets.size
        for top in range(0, height, targets.lists.rows):
            band = (0, top, width, min(targets.lists.rows, height - top))
            seen, near, cabled = (within(each, band) for each in (regions, near_damage, cables))
            self._ctx.memory_barrier()  # what was cleared, stored or listed is done with
            self._shade(targets.lists, seen, damage, near, cabled, suns)
        self._ctx.memory_barrier()

    def _shade(
        self,
        lists: PixelLists,
        seen: Sequence[Region],
        damage: str,
        near: Sequence[Region],
        cabled: Sequence[Region],
        suns: int,
    ) -> None:
        """As `draw`, pixels that see more than sky, as many as lists have room for."""
        lists.begin()
        self._classify(outside(seen, [*near, *cabled]), "sound", cables=False)
        self._classify(outside(near, cabled), damage, cables=False)
        self._classify(cabled, damage, cables=True)
        self._ctx.memory_barrier()
        for name in listed_classes(self._samples_per_axis):
            if self._comes(name, damage, bool(cabled)):
                lists.dispatch(name, self._shader(name, suns))

    def _comes(self, name: str, damage: str, cables: bool) -> bool:
        """Whether a frame may hold pixels of a class."""
        if name == "cable":
            return cables
        if name in ("plain", "coarse"):
            return self._coarse == (name == "coarse")
        traits = PIXEL_CLASSES[name]
        if "HOLES" in traits:
            return damage == "holed"
        return damage != "sound" or "DAMAGE" not in traits

    def _classify(self, regions: Sequence[Region], damage: str, cables: bool) -> None:
        """List the pixels of `regions`, of which the first column and row are even."""
        if not regions:
            return
        key = (damage, cables)
        if key not in self._classifiers:
            self._classifiers[key] = link_compute(
                self._ctx, "classify.comp", UNITS, **self._variant("plain", damage), cables=cables
            )
        program = self._classifiers[key]
        side = 2 if self._coarse else 1
        for region in regions:
            program["region"] = region
            across, down = (-(-length // side) for length in region[2:])
            program.run(-(-across * down // LIST_GROUP))

    def _draw_sky(self, targets: Targets, bent: bool) -> None:
        """Shade at least the pixels that see sky alone."""
        own = bent or self._layer != "all"
        stages = ("fullscreen.vert", "bent_sky.frag") if own else ("sky.vert", "sky.frag")
        if stages not in self._skies:
            program = link(self._ctx, *stages, UNITS, **self._variant("plain", "sound"))
            self._skies[stages] = program, self._ctx.vertex_array(program, [])
        self._ctx.scissor = None
        self._ctx.enable_only(moderngl.DEPTH_TEST if targets.begin() else moderngl.NOTHING)
        self._skies[stages][1].render(moderngl.TRIANGLES, vertices=3 if own else _OCTAHEDRON)

    def _store_sky(self, size: tuple[int, int]) -> None:
        """Shade all pixels as if they saw sky alone, and store its labels and depth."""
        if self._sky is None:
            self._sky = link_compute(
                self._ctx, "sky.comp", UNITS, **self._variant("plain", "sound")
            )
        width, height = size
        self._sky.run(-(-width // LIST_GROUP), height)

    def _shader(self, pixel_class: str, suns: int) -> moderngl.ComputeShader:
        """What shades the listed pixels of a class."""
        key = (pixel_class, suns)
        if key not in self._shaders:
            damage = "holed" if "DAMAGE" in PIXEL_CLASSES[pixel_class] else "sound"
            variant = self._variant(pixel_class, damage, suns)
            self._shaders[key] = link_compute(self._ctx, "shade_listed.comp", UNITS, **variant)
        return self._shaders[key]

    def _variant(self, pixel_class: str, damage: str, suns: int = 0) -> dict[str, Any]:
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
        skies = [item for pair in self._skies.values() for item in reversed(pair)]
        if self._sky is not None:
            self._sky.release()
        for item in (*skies, *self._classifiers.values(), *self._shaders.values()):
            item.release()
