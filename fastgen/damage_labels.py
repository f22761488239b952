"""Labels of damages: where each would be seen alone, and how much of that the image shows."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import MM
from fastgen.classes import SOUND_CONTAINER
from fastgen.coverage import Canvas, project, surface_points
from fastgen.damage import amount_mm, in_hole, mask_values, may_be_seen
from fastgen.facets import Facets, damage_facets
from fastgen.mesh import Mesh
from fastgen.sample import Object
from fastgen.scene import Damage, Scene
from fastgen.visibility import Shot, float_box, mask_box, visibility

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
        alone = _canvas(shot, damage, shown)
        box = mask_box(alone.mask)
        amodal = np.array(box) * alone.scale + 2 * alone.corner if box else None
        objects.append(
            Object(
                id=value,
                class_name=damage.kind,
                instance=value % 100,
                bbox=mask_box(shown),
                amodal_bbox=None if amodal is None else float_box(amodal),
                area=area,
                **visibility(shot, alone, shot.frame.damage, value, area),
            )
        )
    return objects


def _canvas(shot: Shot, damage: Damage, shown: NDArray[np.bool_]) -> Canvas:
    """What the damage would cover alone."""
    empty = Canvas(np.zeros((0, 0), bool), (0, 0), 1)
    camera_mm = shot.view.position_m / MM
    if not may_be_seen(damage, (camera_mm[0], camera_mm[1], camera_mm[2])):
        return empty
    points = surface_points(project(_facets(shot.scene, shot.mesh, damage), shot.view))
    cell, step = points.cell, points.scale
    at = cell * step + step // 2
    within = np.all((at >= 0) & (at < shot.view.size), axis=1)
    x, y = np.where(within[:, None], at, 0).T
    # where the sheet itself is seen, the damage target knows the answer already
    known = within & (points.depth_m <= shot.frame.depth[y, x] * (1 + _DEPTH_SLACK))
    known &= (shot.frame.damage[y, x] == SOUND_CONTAINER) | shown[y, x]
    cell, rest_mm = cell[~known], points.rest_mm[~known]
    part = np.abs(amount_mm(damage, rest_mm)) > shot.config.damage.mask_threshold_mm
    part |= in_hole(damage, rest_mm)
    covered = np.concatenate([cell[part], np.argwhere(shown)[:, ::-1] // step])
    if not len(covered):
        return empty
    low = covered.min(axis=0)
    mask = np.zeros((covered.max(axis=0) - low + 1)[::-1], bool)
    mask[*(covered - low).T[::-1]] = True
    return Canvas(mask, (int(low[0]) * step, int(low[1]) * step), step)


@lru_cache(maxsize=64)
def _facets(scene: Scene, mesh: Mesh, damage: Damage) -> Facets:
    """The cameras of a scene share them."""
    return damage_facets(scene, mesh, damage, 0)
