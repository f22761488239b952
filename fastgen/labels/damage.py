"""Labels of damages: the pixels that each damage covers alone, and how many of them are visible."""

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import DAMAGE_VALUES
from fastgen.geometry.damage_law import amount_mm, in_hole, is_marked, largest_mm, may_be_seen
from fastgen.labels.coverage import project
from fastgen.labels.surface_points import Points, surface_points
from fastgen.labels.visibility import Shot, float_boxes, visibility
from fastgen.sample import Box, Object
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import form_of
from fastgen.scene.limits import MM

_DEPTH_SLACK = 1e-3
"""A point counts as visible up to this fraction of its depth behind the depth target."""


def damage_objects(shot: Shot) -> list[Object]:
    """Return the damages of a scene; their ids are their values in the damage target.

    A damage covers the places where it alone moves the sheet farther than the mask threshold, tears
    it away, or marks it. Its amodal box is that of the pixels there, None if the damage faces
    away from the camera.
    """
    damages = shot.scene.damages
    if not damages:
        return []
    seen_boxes, areas = shot.boxes_on_container(
        shot.frame.damage, DAMAGE_VALUES.start, DAMAGE_VALUES.stop
    )
    objects = []
    for number, value in enumerate(shot.prepared.numbers.damages):
        bbox, area = seen_boxes[value - DAMAGE_VALUES.start], areas[value - DAMAGE_VALUES.start]
        hidden, beyond, bounds = _alone(shot, number, value, bbox)
        (amodal_bbox,) = float_boxes(bounds[None])
        objects.append(
            Object(
                id=value,
                class_name=damages[number].kind,
                instance=value % 100,
                bbox=bbox,
                amodal_bbox=amodal_bbox,
                area=int(area),
                face=damages[number].face,
                severity_mm=severity_mm(damages[number]),
                **visibility(shot.config, shot.view.size, int(area), hidden, beyond),
            )
        )
    return objects


def severity_mm(damage: Damage) -> float:
    """Return the largest displacement by a damage, or the length of a hole or mark, in mm.

    Other damages at the same place do not count. Forms with rounded folds do not reach their
    nominal depth, and flattened corrugation adds to the displacement.
    """
    cut = form_of(damage).outline or form_of(damage).marked
    return damage.size_mm[0] if cut else round(largest_mm(damage), 2)


def _alone(
    shot: Shot, number: int, value: int, bbox: Box | None
) -> tuple[int, int, NDArray[np.float64]]:
    """Compare the pixels that one damage covers alone with the image.

    Args:
        shot: The image.
        number: Index of the damage in Scene.damages.
        value: Its value in the damage target.
        bbox: Box of its visible pixels.

    Returns:
        Number of covered pixels in the image that do not show the damage, number of covered pixels
        outside the image, and bounds float64 [4] of all covered pixels, infinite if there are none.
    """
    damage = shot.scene.damages[number]
    unbounded = np.array([np.inf, np.inf, -np.inf, -np.inf])
    x, y, z = shot.view.position_m / MM
    # an image that shows a hole draws all damages, so one that faces away may be visible inside
    if not may_be_seen(damage, (x, y, z), shot.scene.damages) and bbox is None:
        return 0, 0, unbounded
    bounds = unbounded if bbox is None else np.array(bbox, np.float64)
    places, beyond = [np.zeros((2, 0), np.int64)], 0
    seen = project(shot.prepared.damage_facets(number), shot.view)
    for points in surface_points(seen, shot.view.size):
        chosen, hidden = _damaged(shot, damage, points, value)
        column, row, within = (a.take(chosen) for a in (points.column, points.row, points.within))
        if not len(chosen):
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
    """Find the points inside the damage, except those that the damage target already decides.

    It decides points of visible sheet whose pixels show this damage or undamaged sheet.

    Returns:
        Indices int [D] of these points, and bool [D], True for points in the image whose pixels do
        not show the damage.
    """
    width = shot.view.size[0]
    place = np.where(points.within, points.row * width + points.column, 0)
    depth, drawn = shot.frame.depth.ravel().take(place), shot.frame.damage.ravel().take(place)
    # where the sheet is visible, the damage target has the answer
    known = points.within & (points.depth_m <= depth * (1 + _DEPTH_SLACK))
    known &= (drawn == shot.prepared.numbers.undamaged) | (drawn == value)
    unsettled = np.flatnonzero(~known)
    rest_mm = points.rest_mm(unsettled)
    damaged = in_hole(damage, rest_mm) | is_marked(damage, rest_mm)
    if form_of(damage).marked is None:
        others = np.flatnonzero(~damaged)
        moved_mm = np.abs(amount_mm(damage, rest_mm.take(others, axis=0)))
        damaged[others] = moved_mm > shot.config.damage.mask_threshold_mm
    found = unsettled[damaged]
    return found, points.within.take(found) & (drawn.take(found) != value)


def _distinct(columns: NDArray[np.int64], rows: NDArray[np.int64]) -> int:
    """Count the distinct cells [P] of a grid.

    surface_points.py bounds the grid's size; sorting the cells takes ten times as long.
    """
    if not len(columns):
        return 0
    columns, rows = columns - columns.min(), rows - rows.min()
    occupied = np.zeros((rows.max() + 1, columns.max() + 1), bool)
    occupied[rows, columns] = True
    return int(np.count_nonzero(occupied))
