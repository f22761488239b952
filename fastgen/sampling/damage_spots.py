"""Places of damages on the unfolded sheets, for decals that are put on or beside a damage."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fastgen.geometry.mesh import Mesh
from fastgen.scene import Damage, Vec2
from fastgen.scene.damage_kinds import form_of, kind_named
from fastgen.scene.faces import FACE_AXES, SHEET_FACES


class Spot(NamedTuple):
    """Upright rectangle on a sheet.

    Attributes:
        face: Face of the sheet.
        center_mm: Centre, in sheet coordinates.
        size_mm: Width and height.
        hole: Whether the damage may be a hole.
    """

    face: str
    center_mm: Vec2
    size_mm: Vec2
    hole: bool = False


def damage_spots(mesh: Mesh, damages: Sequence[Damage]) -> list[Spot]:
    """Return the place of each damage on a sheet. Damages of edges and door gear have none.

    Args:
        mesh: Mesh of the undamaged container.
        damages: Damages of the container.
    """
    made = []
    for damage in damages:
        if damage.face not in SHEET_FACES or kind_named(damage.kind).on_gear:
            continue
        axes = FACE_AXES[damage.face]
        turn = np.array([axes.right, axes.up]) @ np.transpose([damage.along, damage.across])
        width, height = np.abs(turn) @ damage.size_mm
        place = _sheet_place(mesh, damage)
        hole = form_of(damage).outline is not None
        made.append(Spot(damage.face, place, (float(width), float(height)), hole))
    return made


def _sheet_place(mesh: Mesh, damage: Damage) -> Vec2:
    """Return the origin of a damage in the coordinates of its sheet, mm."""
    chart = mesh.chart_index(damage.face)
    own = np.flatnonzero(mesh.chart == chart)
    away = damage.origin_mm - mesh.positions_mm[own].astype(np.float64)
    nearest = int((away * away).sum(axis=1).argmin())
    x, y = mesh.atlas_mm[own[nearest]] - mesh.charts[chart].rect_mm[:2]
    axes = FACE_AXES[damage.face]
    return float(x + away[nearest] @ axes.right), float(y + away[nearest] @ axes.up)
