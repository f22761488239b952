"""Tables from which the shader evaluates the decals of a scene at any point of the atlas.

A coarse grid over the atlas lists the decals that may cover each cell. Each decal has a table row
with its placement and ink. A glyph table holds the letters of all texts.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.errors import FastgenError
from fastgen.geometry.mesh import UNIT_CUBE, Mesh
from fastgen.render.constants import DECAL_CELL_MM
from fastgen.render.glyph_runs import GlyphRun, GlyphTable, all_glyphs, glyph_run
from fastgen.render.zone_codes import DECAL_SHEET, SHEET_NUMBERS
from fastgen.scene import Decal
from fastgen.scene.limits import COMPUTED_ART, DECAL_KINDS, MM, MOST_NEARBY

DECAL_TEXELS = 5
"""Texels of one row of the decal table."""

CELL_SLOTS = MOST_NEARBY
"""Most decals that one cell of the grid can list."""

GLYPH_COLUMNS = 256
"""Width of the glyph table."""

_POINTED = ("marker", "triangle")
"""Kinds of decals that are widest in their middle."""

_PAPER = ("marker", "sticker", "triangle")
"""Kinds of decals that are tinted; all others have a colour."""

MARGIN_MM = 26.0
"""Margin around a decal within which pixels may show it, in views of `scale` 1."""

_MARGIN_PX = 0.75
"""Least margin in pixels at the container's farthest corner: half a pixel, and the blur of small
letters."""


class SceneError(FastgenError):
    """The renderer cannot draw a scene; the message names the part to change."""


@dataclass(frozen=True, eq=False)
class DecalTables:
    """Decals of one scene in the form that the shader reads.

    Attributes:
        grid: uint32 [rows * layers, columns, CELL_SLOTS / 2]. Each number packs two 1-based decal
            numbers of a cell, the first in the lower 16 bits. Lower decals come first; 0 is an
            empty slot. The `layers` rows of a cell are below one another.
        layers: Rows of each cell. One is enough for `scale` 1.
        scale: Size of cells and margins relative to DECAL_CELL_MM and MARGIN_MM.
        table: float32 [N, DECAL_TEXELS, 4], one row per decal with the texels below. A scene
            without decals has one row of zeros.
            0. Rotation: cos, sin. Mean normal of the sheet there: its components out of the face
               and along the corrugation.
            1. Placement in the atlas: centre x, centre y, half width, half height, mm.
            2. Albedo r, g, b, or the tint of markers and stickers; wear.
            3. Kind plus DECAL_SHEET times the sheet's number, see zone_codes.py;
               object id, art layer, fade.
            4. Texts: cap height in mm, first glyph, number of glyphs, parts per mm. Others:
               `Decal.torn`.
        glyphs: float32 [rows, GLYPH_COLUMNS, 4], the glyphs of all texts in order, see GlyphRun.
    """

    grid: NDArray[np.uint32]
    layers: int
    scale: float
    table: NDArray[np.float32]
    glyphs: NDArray[np.float32]


def pack_decals(
    decals: Sequence[Decal],
    ids: Sequence[int],
    mesh: Mesh,
    art_layers: Mapping[str, int],
    scale: float = 1.0,
    glyphs: GlyphTable | None = None,
) -> DecalTables:
    """Compute the decal tables of a container.

    Args:
        decals: The decals.
        ids: Object id of each decal, 0 without a label.
        mesh: Mesh of the container.
        art_layers: Texture layer of each artwork by name.
        scale: See DecalTables; from `scale_for`.
        glyphs: Glyphs of all fonts; None for fastgen's fonts alone.

    Returns:
        Tables for the shader.

    Raises:
        SceneError: `scale` is 1, and a decal lies outside its sheet or a cell has more than
            CELL_SLOTS decals.
    """
    count = len(decals)
    rects = [mesh.charts[mesh.chart_index(decal.face)].rect_mm for decal in decals]
    corner, sheet = np.split(np.array(rects).reshape(count, 4), 2, axis=1)
    center = corner + np.array([decal.center_mm for decal in decals]).reshape(count, 2)
    half = np.array([decal.size_mm for decal in decals]).reshape(count, 2) / 2
    angle = np.deg2rad([decal.rotation_deg for decal in decals])
    cos, sin = np.cos(angle), np.sin(angle)
    table = np.zeros((max(count, 1), DECAL_TEXELS, 4), np.float32)
    table[:count, 0, :2] = np.stack([cos, sin], axis=1)
    table[:count, 1] = np.concatenate([center, half], axis=1)
    known = all_glyphs() if glyphs is None else glyphs
    runs: list[GlyphRun] = []
    letters = 0
    for row, decal, object_id in zip(table, decals, ids, strict=False):
        kind = decal.art if decal.art in COMPUTED_ART else decal.kind
        row[2] = *(decal.tint if kind in _PAPER else decal.albedo), decal.wear
        code = DECAL_KINDS[kind] + DECAL_SHEET * SHEET_NUMBERS[decal.face]
        row[3] = code, object_id, art_layers.get(decal.art, 0), decal.fade
        row[4] = decal.torn
        if decal.kind == "text":
            run = glyph_run(decal.lettering, known.extents, known.first.get(decal.font, 0))
            row[4] = decal.cap_mm, letters, len(run.glyphs), run.parts_per_mm
            letters += len(run.glyphs)
            runs.append(run)
    width, height = half.T
    along, across = abs(cos) * width + abs(sin) * height, abs(sin) * width + abs(cos) * height
    extent = np.stack([along, across], axis=1)
    table[:count, 0, 2:] = _mean_normals(decals, mesh, center - corner, extent)
    reach = extent + scale * MARGIN_MM
    cell_mm = scale * DECAL_CELL_MM
    low = np.maximum(center - reach, corner) / cell_mm
    high = np.minimum(center + reach, corner + sheet) / cell_mm
    glyph_rows = max(-(-letters // GLYPH_COLUMNS), 1)
    glyph_table = np.zeros((glyph_rows * GLYPH_COLUMNS, 4), np.float32)
    if runs:
        glyph_table[:letters] = np.concatenate([run.glyphs for run in runs])
    grid = _grid(decals, mesh, low, high, scale)
    return DecalTables(
        grid.reshape(-1, *grid.shape[2:]),
        grid.shape[1],
        scale,
        table,
        glyph_table.reshape(glyph_rows, GLYPH_COLUMNS, 4),
    )


def _mean_normals(
    decals: Sequence[Decal],
    mesh: Mesh,
    center: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the mean normal [N, 2] of the sheet under each decal, see SheetFolds.mean."""
    normals = np.zeros((len(decals), 2))
    for face in {decal.face for decal in decals}:
        folds = mesh.folds[face]
        here = np.array([decal.face == face for decal in decals])
        middle, half = center[here, folds.axis], reach[here, folds.axis]
        # most of a marker or triangle is near its middle
        pointed = np.array([d.kind in _POINTED for d in decals if d.face == face])
        half = np.where(pointed, 0.7 * half, half)
        normals[here] = folds.mean(middle - half, middle + half)
    return normals


def scale_for(mesh: Mesh, view: View) -> float:
    """Return the scale of tables that list every decal that a pixel of a view may show.

    It is 1 in usual views. Others share few scales, because each needs tables of its own.
    """
    low, high = mesh.bounds_mm
    farthest_m = view.to_view(low + UNIT_CUBE * (high - low))[:, 2].max()
    pixel_mm = max(farthest_m / MM, 0.0) / view.focal_px
    return 2.0 ** max(math.ceil(math.log2(max(_MARGIN_PX * pixel_mm / MARGIN_MM, 1.0))), 0)


def _grid(
    decals: Sequence[Decal],
    mesh: Mesh,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    scale: float,
) -> NDArray[np.uint32]:
    """Return the grid of DecalTables as [rows, layers, columns, CELL_SLOTS / 2].

    `low` and `high` bound each decal, [N, 2] (x, y) in cells.
    """
    size = np.ceil(np.array(mesh.atlas_size_mm) / (scale * DECAL_CELL_MM)).astype(int)
    off = (low[:, 0] > high[:, 0]) | (low[:, 1] > high[:, 1])
    first = low.astype(int)
    wide, tall = np.maximum(np.minimum(high.astype(int), size - 1) - first + 1, 0).T
    touched = np.where(off, 0, wide * tall)
    # Decal number and cell of every pair of a decal and a cell that it touches.
    number = np.repeat(np.arange(len(decals)), touched)
    step = np.arange(len(number)) - np.repeat(np.cumsum(touched) - touched, touched)
    row, column = np.divmod(step, wide[number])
    cell = (first[number, 1] + row) * size[0] + first[number, 0] + column
    # Slot of each pair: the number of pairs with the same cell before it.
    order = np.argsort(cell, kind="stable")
    begins = np.diff(cell[order], prepend=-1) != 0
    place = np.arange(len(cell))
    slot = np.empty(len(cell), int)
    slot[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    if scale == 1:
        _check(decals, mesh, off, number[slot >= CELL_SLOTS])
    layers = max(-(-(slot.max(initial=0) + 1) // CELL_SLOTS), 1)
    slots = np.zeros((size[1], layers, size[0], CELL_SLOTS), np.uint32)
    row, column = np.divmod(cell, size[0])
    layer, place = np.divmod(slot, CELL_SLOTS)
    slots[row, layer, column, place] = number + 1
    pairs: NDArray[np.uint32] = slots[..., 0::2] | (slots[..., 1::2] << np.uint32(16))
    return pairs


def _check(
    decals: Sequence[Decal], mesh: Mesh, off: NDArray[np.bool_], crowded: NDArray[np.intp]
) -> None:
    """Raise SceneError for the first decal that is `off` its sheet [N] or in `crowded` [K]."""
    wrong = np.union1d(np.flatnonzero(off), crowded).tolist()
    if not wrong:
        return
    i = wrong[0]
    decal = decals[i]
    if off[i]:
        *_, width, height = mesh.charts[mesh.chart_index(decal.face)].rect_mm
        raise SceneError(
            f"decals[{i}] ({decal.kind} on {decal.face}): center_mm {decal.center_mm} lies off "
            f"its sheet of {width:.0f} x {height:.0f} mm; move it onto the sheet"
        )
    raise SceneError(
        f"decals[{i}] ({decal.kind} on {decal.face} at {decal.center_mm}): more than "
        f"{CELL_SLOTS} decals within {DECAL_CELL_MM:g} mm; spread them"
    )
