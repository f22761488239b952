"""Labels of damages: where each would be seen alone, and how much of that the image shows."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DAMAGE_VALUES, SOUND_CONTAINER
from fastgen.geometry.damage_law import amount_mm, in_hole, may_be_seen
from fastgen.geometry.facets import Facets, damage_facets
from fastgen.geometry.mesh import Mesh
from fastgen.labels.coverage import project
from fastgen.labels.surface_points import Points, surface_points
from fastgen.labels.visibility import Shot, float_boxes, visibility
from fastgen.sample import Box, Object
from fastgen.scene import Damage, Scene
from fastgen.scene.limits import MM
from fastgen.scene.object_ids import mask_values

_DEPTH_SLACK = 1e-3
"""A point this share of its depth behind the depth target's still is the one that is seen."""


def damage_objects(shot: Shot) -> list[Object]:
    """Damages by their mask value, which is also their id; it marks the damage target, not the ids.

    A damage is where it alone would have moved the sheet beyond the threshold, or torn it away. Its
    amodal box is that of the pixels there; None where a camera so placed cannot see it.
    """
    damages = shot.scene.damages
    if not damages:
        return []
    seen_boxes, areas = shot.boxes_on_container(
        shot.frame.damage, DAMAGE_VALUES.start, DAMAGE_VALUES.stop
    )
    objects = []
    for damage, value in zip(damages, mask_values(damages), strict=True):
        bbox, area = seen_boxes[value - DAMAGE_VALUES.start], areas[value - DAMAGE_VALUES.start]
        hidden, beyond, bounds = _alone(shot, damage, value, bbox)
        (amodal_bbox,) = float_boxes(bounds[None])
        objects.append(
            Object(
                id=value,
                class_name=damage.kind,
                instance=value % 100,
                bbox=bbox,
                amodal_bbox=amodal_bbox,
                area=int(area),
                **visibility(shot.config, int(area), hidden, beyond),
            )
        )
    return objects


def _alone(
    shot: Shot, damage: Damage, value: int, bbox: Box | None
) -> tuple[int, int, NDArray[np.float64]]:
    """Of what the damage would cover alone: pixels of the image that are not shown, how many lie
    outside it, and the bounds of all, infinite where it is nothing. value: the damage's in the
    damage target; bbox: of what is shown."""
    unbounded = np.array([np.inf, np.inf, -np.inf, -np.inf])
    x, y, z = shot.view.position_m / MM
    # where a hole is in view all damages are drawn, and more of them are seen than one might think
    if not may_be_seen(damage, (x, y, z), shot.scene.damages) and bbox is None:
        return 0, 0, unbounded
    bounds = unbounded if bbox is None else np.array(bbox, np.float64)
    places, beyond = [np.zeros((2, 0), np.int64)], 0
    for points in surface_points(
        project(_facets(shot.scene, shot.mesh, damage), shot.view), shot.view.size
    ):
        part, hidden = _damaged(shot, damage, points, value)
        column, row, within = (a.take(part) for a in (points.column, points.row, points.within))
        if not len(part):
            continue
        size = np.where(within, 1, points.step)
        least = column.min(), row.min()
        most = (column + size).max(), (row + size).max()
        bounds = np.concatenate([np.minimum(bounds[:2], least), np.maximum(bounds[2:], most)])
        places.append(np.stack([column[hidden], row[hidden]]))
        off = ~within
        beyond += _distinct(column[off] // points.step, row[off] // points.step) * points.step**2
    return _distinct(*np.concatenate(places, axis=1)), beyond, bounds


def _damaged(
    shot: Shot, damage: Damage, points: Points, value: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Which of the points damage has reached, int [D], but for those where the image shows it or
    that the sheet is sound; and which of these lie in the image, that does not show it, bool [D].
    """
    width = shot.view.size[0]
    place = np.where(points.within, points.row * width + points.column, 0)
    depth, drawn = shot.frame.depth.ravel().take(place), shot.frame.damage.ravel().take(place)
    # where the sheet itself is seen, the damage target knows the answer already
    known = points.within & (points.depth_m <= depth * (1 + _DEPTH_SLACK))
    known &= (drawn == SOUND_CONTAINER) | (drawn == value)
    asked = np.flatnonzero(~known)
    rest_mm = points.rest_mm(asked)
    part = np.abs(amount_mm(damage, rest_mm)) > shot.config.damage.mask_threshold_mm
    part |= in_hole(damage, rest_mm)
    found = asked[part]
    return found, points.within.take(found) & (drawn.take(found) != value)


def _distinct(columns: NDArray[np.int64], rows: NDArray[np.int64]) -> int:
    """How many cells [P] of a grid differ: surface_points.py bounds their number, and sorting them
    takes ten times as long."""
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
        kept[damage] = damage_facets(scene, mesh, damage)
    return kept[damage]


@lru_cache(maxsize=2)
def _kept_facets(scene: Scene, mesh: Mesh) -> dict[Damage, Facets]:
    """Of this scene's damages, those that were asked for."""
    return {}
