"""Labels of damages: where each would be seen alone, and how much of that the image shows."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import MM
from fastgen.classes import SOUND_CONTAINER
from fastgen.damage import amount_mm, in_hole, mask_values, may_be_seen
from fastgen.geometry.mesh import Mesh
from fastgen.labelling.coverage import Points, project, surface_points
from fastgen.labelling.facets import Facets, damage_facets
from fastgen.labelling.visibility import Shot, float_box, mask_box, visibility
from fastgen.sample import Box, Object
from fastgen.scene import Damage, Scene

_DEPTH_SLACK = 1e-3
"""A point this share of its depth behind the depth target's still is the one that is seen."""


def damage_objects(shot: Shot) -> list[Object]:
    """Damages by their mask value, which is also their id; it marks the damage target, not the ids.

    A damage is where it alone would have moved the sheet beyond the threshold, or torn it away. Its
    amodal box is that of the pixels there; None where a camera so placed cannot see it.
    """
    objects = []
    for damage, value in zip(shot.scene.damages, mask_values(shot.scene.damages), strict=True):
        shown = shot.frame.damage == value
        area = int(np.count_nonzero(shown))
        bbox = mask_box(shown)
        hidden, beyond, bounds = _alone(shot, damage, shown, bbox)
        objects.append(
            Object(
                id=value,
                class_name=damage.kind,
                instance=value % 100,
                bbox=bbox,
                amodal_bbox=float_box(bounds),
                area=area,
                **visibility(shot.config, area, hidden, beyond),
            )
        )
    return objects


def _alone(
    shot: Shot, damage: Damage, shown: NDArray[np.bool_], bbox: Box | None
) -> tuple[int, int, NDArray[np.float64]]:
    """Of what the damage would cover alone: pixels of the image that are not shown, how many lie
    outside it, and the bounds of all, infinite where it is nothing. bbox: of `shown`."""
    unbounded = np.array([np.inf, np.inf, -np.inf, -np.inf])
    x, y, z = shot.view.position_m / MM
    # where a hole is in view all damages are drawn, and more of them are seen than one might think
    if not may_be_seen(damage, (x, y, z), shot.scene.damages) and bbox is None:
        return 0, 0, unbounded
    bounds = unbounded if bbox is None else np.array(bbox, np.float64)
    hidden, beyond = np.zeros(shown.size, bool), 0
    for points in surface_points(
        project(_facets(shot.scene, shot.mesh, damage), shot.view), shot.view.size
    ):
        part = _damaged(shot, damage, points, shown)
        column, row, within = points.column[part], points.row[part], points.within[part]
        if not len(part):
            continue
        size = np.where(within, 1, points.step)
        least = column.min(), row.min()
        most = (column + size).max(), (row + size).max()
        bounds = np.concatenate([np.minimum(bounds[:2], least), np.maximum(bounds[2:], most)])
        hidden[row[within] * shown.shape[1] + column[within]] = True
        off = ~within
        beyond += _distinct(column[off] // points.step, row[off] // points.step) * points.step**2
    return int(np.count_nonzero(hidden & ~shown.ravel())), beyond, bounds


def _damaged(
    shot: Shot, damage: Damage, points: Points, shown: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Which of the points damage has reached, but for those where the image shows it or that the
    sheet is sound."""
    place = np.where(points.within, points.row * shown.shape[1] + points.column, 0)
    # where the sheet itself is seen, the damage target knows the answer already
    known = points.within & (points.depth_m <= shot.frame.depth.ravel()[place] * (1 + _DEPTH_SLACK))
    known &= (shot.frame.damage.ravel()[place] == SOUND_CONTAINER) | shown.ravel()[place]
    asked = np.flatnonzero(~known)
    rest_mm = points.rest_mm(asked)
    part = np.abs(amount_mm(damage, rest_mm)) > shot.config.damage.mask_threshold_mm
    part |= in_hole(damage, rest_mm)
    return asked[part]


def _distinct(columns: NDArray[np.int64], rows: NDArray[np.int64]) -> int:
    """How many cells [P] of a grid differ: coverage.surface_points bounds their number, and sorting
    them takes ten times as long."""
    if not len(columns):
        return 0
    columns, rows = columns - columns.min(), rows - rows.min()
    met = np.zeros((rows.max() + 1, columns.max() + 1), bool)
    met[rows, columns] = True
    return int(np.count_nonzero(met))


def _facets(scene: Scene, mesh: Mesh, damage: Damage) -> Facets:
    """The cameras of a scene share them."""
    kept = _kept_facets(scene, mesh)
    if damage not in kept:
        kept[damage] = damage_facets(scene, mesh, damage, 0)
    return kept[damage]


@lru_cache(maxsize=2)
def _kept_facets(scene: Scene, mesh: Mesh) -> dict[Damage, Facets]:
    """Of this scene's damages, those that were asked for."""
    return {}
