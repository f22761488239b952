"""Decals of a scene as the small tables that the shader reads; nothing is painted per sample.

A coarse grid over the atlas names the decals that may cover a spot; a table row holds each decal's
placement and ink; a glyph table holds the letters. A few hundred bytes a decal.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import CONTAINER_ID, DAMAGE_VALUES, SPREADER_ID
from fastgen.drawing.programs import DECAL_CELL_MM, DECAL_KINDS
from fastgen.errors import FastgenError
from fastgen.geometry.mesh import Mesh
from fastgen.prints.artwork import Font
from fastgen.prints.lettering import layout
from fastgen.scene import Decal, Scene

DECAL_TEXELS = 5
CELL_SLOTS = 8
GLYPH_COLUMNS = 256

_MARGIN_MM = 26.0
"""Antialiasing reaches this far beyond a decal's edge: half a lookup, of programs.LOOKUP_PX, in the
coarsest usual view, which has 39 mm a pixel at 640 pixels across."""


class SceneError(FastgenError):
    """A scene that cannot be drawn as described."""


@dataclass(frozen=True, eq=False)
class DecalTables:
    """grid: uint32 [rows, columns, 4], two 1-based decal numbers a word, bottom decal first.
    table: float32 [N, DECAL_TEXELS, 4]: (cos, sin, -sin, cos); (centre x, y in atlas mm, half
    width, half height); (albedo rgb, wear); (kind, object id, art layer, 0); (cap height mm,
    first glyph, glyph count, 0). glyphs: float32 [rows, GLYPH_COLUMNS, 4]: centre x, y in mm from
    the decal's centre, tile, 0."""

    grid: NDArray[np.uint32]
    table: NDArray[np.float32]
    glyphs: NDArray[np.float32]


def object_ids(scene: Scene) -> list[int]:
    """Id of each decal in the id target, 0 for those without a label: 2, 3, ... in scene order,
    those of damages left out."""
    numbers = range(CONTAINER_ID + 1, SPREADER_ID)
    free = (number for number in numbers if number not in DAMAGE_VALUES)
    return [next(free) if decal.class_name else 0 for decal in scene.decals]


def pack_decals(
    scene: Scene, mesh: Mesh, art_layers: Mapping[str, int], fonts: Mapping[str, Font]
) -> DecalTables:
    """Tables for `scene` on `mesh`. Raises SceneError where one lies off its sheet or
    more than CELL_SLOTS meet."""
    columns, rows = (int(np.ceil(side / DECAL_CELL_MM)) for side in mesh.atlas_size_mm)
    slots = np.zeros((rows, columns, CELL_SLOTS), np.uint32)
    table = np.zeros((max(len(scene.decals), 1), DECAL_TEXELS, 4), np.float32)
    glyphs: list[tuple[float, float, float, float]] = []
    for i, (decal, object_id) in enumerate(zip(scene.decals, object_ids(scene), strict=True)):
        x0, y0, width, height = mesh.charts[mesh.chart_index(decal.face)].rect_mm
        center = np.array([x0 + decal.center_mm[0], y0 + decal.center_mm[1]])
        half = np.array(decal.size_mm) / 2
        cos, sin = decal.turn[:, 0]
        kind = decal.art if decal.art == "stripes" else decal.kind
        table[i, 0] = cos, sin, -sin, cos
        table[i, 1] = *center, *half
        table[i, 2] = *decal.albedo, decal.wear
        table[i, 3] = DECAL_KINDS[kind], object_id, art_layers.get(decal.art, 0), 0
        if decal.kind == "text":
            run = _glyph_run(decal, fonts[decal.font])
            table[i, 4] = decal.cap_mm, len(glyphs), len(run), 0
            glyphs.extend(run)
        reach = np.abs([[cos, -sin], [sin, cos]]) @ half + _MARGIN_MM
        low = np.maximum(center - reach, (x0, y0)) / DECAL_CELL_MM
        high = np.minimum(center + reach, (x0 + width, y0 + height)) / DECAL_CELL_MM
        if (low > high).any():
            raise SceneError(
                f"decals[{i}] ({decal.kind} on {decal.face}): center_mm {decal.center_mm} lies off "
                f"its sheet, which is {width:.0f} by {height:.0f} mm"
            )
        cells = slots[int(low[1]) : int(high[1]) + 1, int(low[0]) : int(high[0]) + 1]
        used = np.count_nonzero(cells, axis=-1)
        if used.size and used.max() >= CELL_SLOTS:
            raise SceneError(
                f"decals[{i}] ({decal.kind} on {decal.face} at {decal.center_mm}): more than "
                f"{CELL_SLOTS} decals meet within {DECAL_CELL_MM:g} mm; spread them"
            )
        cells[np.arange(len(used))[:, None], np.arange(used.shape[1]), used] = i + 1
    grid = slots[..., 0::2] | (slots[..., 1::2] << np.uint32(16))
    glyph_rows = max(-(-len(glyphs) // GLYPH_COLUMNS), 1)
    glyph_table = np.zeros((glyph_rows * GLYPH_COLUMNS, 4), np.float32)
    if glyphs:
        glyph_table[: len(glyphs)] = glyphs
    return DecalTables(
        np.ascontiguousarray(grid), table, glyph_table.reshape(glyph_rows, GLYPH_COLUMNS, 4)
    )


def _glyph_run(decal: Decal, font: Font) -> list[tuple[float, float, float, float]]:
    lettering = layout(decal.lines, font, decal.cap_mm, decal.vertical)
    width, height = lettering.size_mm
    return [
        ((g.x0 + g.x1) / 2 - width / 2, (g.y0 + g.y1) / 2 - height / 2, float(g.tile), 0.0)
        for g in lettering.glyphs
    ]
