"""Decals of a scene as the small tables that the shader reads; nothing is painted per sample.

A coarse grid over the atlas names the decals that may cover a spot; a table row holds each decal's
placement and ink; a glyph table holds the letters. A few hundred bytes a decal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.decals.artwork import Font
from fastgen.decals.lettering import layout
from fastgen.errors import FastgenError
from fastgen.geometry.mesh import Mesh
from fastgen.render.glyph_runs import GlyphRun, glyph_run
from fastgen.render.programs import DECAL_CELL_MM
from fastgen.scene import Decal, Scene
from fastgen.scene.limits import DECAL_KINDS
from fastgen.scene.object_ids import object_ids

DECAL_TEXELS = 5
CELL_SLOTS = 8
GLYPH_COLUMNS = 256

MARGIN_MM = 26.0
"""Antialiasing reaches this far beyond a decal's edge: half a lookup, of programs.LOOKUP_PX, in the
coarsest usual view, which has 39 mm a pixel at 640 pixels across; beyond it edges are cut."""


class SceneError(FastgenError):
    """A scene that cannot be drawn as described."""


@dataclass(frozen=True, eq=False)
class DecalTables:
    """grid: uint32 [rows, columns, 4], two 1-based decal numbers a word, bottom decal first.
    table: float32 [N, DECAL_TEXELS, 4]: (cos, sin, -sin, cos); (centre x, y in atlas mm, half
    width, half height); (albedo rgb, wear); (kind, object id, art layer, 0); (cap height mm,
    first glyph, glyph count, parts a mm). glyphs: float32 [rows, GLYPH_COLUMNS, 4], one run after
    the other; see GlyphRun."""

    grid: NDArray[np.uint32]
    table: NDArray[np.float32]
    glyphs: NDArray[np.float32]


def pack_decals(
    scene: Scene, mesh: Mesh, art_layers: Mapping[str, int], fonts: Mapping[str, Font]
) -> DecalTables:
    """Tables for `scene` on `mesh`. Raises SceneError where one lies off its sheet or
    more than CELL_SLOTS meet."""
    decals, count = scene.decals, len(scene.decals)
    rects = [mesh.charts[mesh.chart_index(decal.face)].rect_mm for decal in decals]
    corner, sheet = np.split(np.array(rects).reshape(count, 4), 2, axis=1)
    center = corner + np.array([decal.center_mm for decal in decals]).reshape(count, 2)
    half = np.array([decal.size_mm for decal in decals]).reshape(count, 2) / 2
    angle = np.deg2rad([decal.rotation_deg for decal in decals])
    cos, sin = np.cos(angle), np.sin(angle)
    table = np.zeros((max(count, 1), DECAL_TEXELS, 4), np.float32)
    table[:count, 0] = np.stack([cos, sin, -sin, cos], axis=1)
    table[:count, 1] = np.concatenate([center, half], axis=1)
    runs: list[GlyphRun] = []
    letters = 0
    for row, decal, object_id in zip(table, decals, object_ids(scene), strict=False):
        kind = decal.art if decal.art == "stripes" else decal.kind
        row[2] = *decal.albedo, decal.wear
        row[3] = DECAL_KINDS[kind], object_id, art_layers.get(decal.art, 0), 0
        if decal.kind == "text":
            run = glyph_run(layout(decal.lines, fonts[decal.font], decal.cap_mm, decal.vertical))
            row[4] = decal.cap_mm, letters, len(run.glyphs), run.parts_per_mm
            letters += len(run.glyphs)
            runs.append(run)
    width, height = half.T
    along, across = abs(cos) * width + abs(sin) * height, abs(sin) * width + abs(cos) * height
    reach = np.stack([along, across], axis=1) + MARGIN_MM
    low = np.maximum(center - reach, corner) / DECAL_CELL_MM
    high = np.minimum(center + reach, corner + sheet) / DECAL_CELL_MM
    glyph_rows = max(-(-letters // GLYPH_COLUMNS), 1)
    glyph_table = np.zeros((glyph_rows * GLYPH_COLUMNS, 4), np.float32)
    if runs:
        glyph_table[:letters] = np.concatenate([run.glyphs for run in runs])
    return DecalTables(
        _grid(decals, mesh, low, high),
        table,
        glyph_table.reshape(glyph_rows, GLYPH_COLUMNS, 4),
    )


def _grid(
    decals: Sequence[Decal], mesh: Mesh, low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.uint32]:
    """As of DecalTables. low, high: where each decal begins and ends, [N, 2] (x, y) in cells of the
    atlas. Raises SceneError as pack_decals does."""
    size = np.ceil(np.array(mesh.atlas_size_mm) / DECAL_CELL_MM).astype(int)
    off = (low[:, 0] > high[:, 0]) | (low[:, 1] > high[:, 1])
    first = low.astype(int)
    wide, tall = np.maximum(np.minimum(high.astype(int), size - 1) - first + 1, 0).T
    touched = np.where(off, 0, wide * tall)
    # each decal's cells, a row after the other
    number = np.repeat(np.arange(len(decals)), touched)
    step = np.arange(len(number)) - np.repeat(np.cumsum(touched) - touched, touched)
    row, column = np.divmod(step, wide[number])
    cell = (first[number, 1] + row) * size[0] + first[number, 0] + column
    # how many decals lie in the cell already
    order = np.argsort(cell, kind="stable")
    begins = np.diff(cell[order], prepend=-1) != 0
    place = np.arange(len(cell))
    slot = np.empty(len(cell), int)
    slot[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    crowded = slot >= CELL_SLOTS
    _check(decals, mesh, off, number[crowded])
    slots = np.zeros((size[1], size[0], CELL_SLOTS), np.uint32)
    slots.reshape(-1, CELL_SLOTS)[cell, slot] = number + 1
    return slots[..., 0::2] | (slots[..., 1::2] << np.uint32(16))


def _check(
    decals: Sequence[Decal], mesh: Mesh, off: NDArray[np.bool_], crowded: NDArray[np.intp]
) -> None:
    """Raise SceneError for the first decal that is `off` its sheet [N], or of the numbers [K] of
    those that find no slot."""
    wrong = np.union1d(np.flatnonzero(off), crowded).tolist()
    if not wrong:
        return
    i = wrong[0]
    decal = decals[i]
    if off[i]:
        *_, width, height = mesh.charts[mesh.chart_index(decal.face)].rect_mm
        raise SceneError(
            f"decals[{i}] ({decal.kind} on {decal.face}): center_mm {decal.center_mm} lies off "
            f"its sheet, which is {width:.0f} by {height:.0f} mm"
        )
    raise SceneError(
        f"decals[{i}] ({decal.kind} on {decal.face} at {decal.center_mm}): more than "
        f"{CELL_SLOTS} decals meet within {DECAL_CELL_MM:g} mm; spread them"
    )
