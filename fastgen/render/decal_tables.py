"""Tables from which the shader evaluates the decals of a scene at any point of the atlas.

A coarse grid over the atlas lists the decals that may cover each cell. Each decal has a table row
with its placement and ink. A glyph table holds the letters of all texts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import FastgenError
from fastgen.geometry.mesh import Mesh
from fastgen.render.constants import DECAL_CELL_MM
from fastgen.render.glyph_runs import GlyphRun, glyph_run
from fastgen.scene import Decal
from fastgen.scene.limits import COMPUTED_ART, DECAL_KINDS, MOST_NEARBY

DECAL_TEXELS = 5
"""Texels of one row of the decal table."""

CELL_SLOTS = MOST_NEARBY
"""Most decals that one cell of the grid can list."""

GLYPH_COLUMNS = 256
"""Width of the glyph table."""

_PAPER = ("marker", "sticker", "triangle")
"""Kinds of decals that are tinted; all others have a colour."""

MARGIN_MM = 26.0
"""Margin around a decal within which antialiasing blends its edge.

It is half the width of a lookup (sample_lattice.LOOKUP_PX) in the coarsest usual view, which has
39 mm per pixel in an image 640 pixels wide. Coarser views cut edges off at this margin."""


class SceneError(FastgenError):
    """The renderer cannot draw a scene; the message names the part to change."""


@dataclass(frozen=True, eq=False)
class DecalTables:
    """Decals of one scene in the form that the shader reads.

    Attributes:
        grid: uint32 [rows, columns, CELL_SLOTS / 2]. Each number packs two 1-based decal numbers of
            a cell, the first in the lower 16 bits. Lower decals come first; 0 is an empty slot.
        table: float32 [N, DECAL_TEXELS, 4], one row per decal with the texels below. A scene
            without decals has one row of zeros.
            0. Rotation: cos, sin, -sin, cos.
            1. Placement in the atlas: centre x, centre y, half width, half height, mm.
            2. Albedo r, g, b, or the tint of markers and stickers; wear.
            3. Kind, object id, art layer, fade.
            4. Texts: cap height in mm, first glyph, number of glyphs, parts per mm. Others:
               `Decal.torn`.
        glyphs: float32 [rows, GLYPH_COLUMNS, 4], the glyphs of all texts in order, see GlyphRun.
    """

    grid: NDArray[np.uint32]
    table: NDArray[np.float32]
    glyphs: NDArray[np.float32]


def pack_decals(
    decals: Sequence[Decal], ids: Sequence[int], mesh: Mesh, art_layers: Mapping[str, int]
) -> DecalTables:
    """Compute the decal tables of a container.

    Args:
        decals: The decals.
        ids: Object id of each decal, 0 without a label.
        mesh: Mesh of the container.
        art_layers: Texture layer of each artwork by name.

    Returns:
        Tables for the shader.

    Raises:
        SceneError: A decal lies outside its sheet, or a cell has more than CELL_SLOTS decals.
    """
    count = len(decals)
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
    for row, decal, object_id in zip(table, decals, ids, strict=False):
        kind = decal.art if decal.art in COMPUTED_ART else decal.kind
        row[2] = *(decal.tint if kind in _PAPER else decal.albedo), decal.wear
        row[3] = DECAL_KINDS[kind], object_id, art_layers.get(decal.art, 0), decal.fade
        row[4] = decal.torn
        if decal.kind == "text":
            run = glyph_run(decal.lettering)
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
    """Return the grid of DecalTables; `low` and `high` bound each decal, [N, 2] (x, y) in cells."""
    size = np.ceil(np.array(mesh.atlas_size_mm) / DECAL_CELL_MM).astype(int)
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
    crowded = slot >= CELL_SLOTS
    _check(decals, mesh, off, number[crowded])
    slots = np.zeros((size[1], size[0], CELL_SLOTS), np.uint32)
    slots.reshape(-1, CELL_SLOTS)[cell, slot] = number + 1
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
