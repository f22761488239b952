"""Labels of damages: where each would be seen alone, and how much of that the image shows."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import MM
from fastgen.classes import SOUND_CONTAINER
from fastgen.damage import amount_mm, in_hole, mask_values, may_be_seen
from fastgen.geometry.mesh import Mesh
from fastgen.labelling.coverage import NOTHING, Cover, project, surface_points
from fastgen.labelling.facets import Facets, damage_facets
from fastgen.labelling.visibility import Shot, float_box, mask_box, visibility
from fastgen.sample import Object
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
        alone, bounds = _cover(shot, damage, shown)
        objects.append(
            Object(
                id=value,
                class_name=damage.kind,
                instance=value % 100,
                bbox=mask_box(shown),
                amodal_bbox=float_box(bounds),
                area=area,
                **visibility(shot, alone, shot.frame.damage, value, area),
            )
        )
    return objects


def _cover(
    shot: Shot, damage: Damage, shown: NDArray[np.bool_]
) -> tuple[Cover, NDArray[np.float64]]:
    """What the damage would cover alone, and the bounds of that, infinite where it is nothing."""
    unbounded = np.array([np.inf, np.inf, -np.inf, -np.inf])
    x, y, z = shot.view.position_m / MM
    # where a hole is in view all damages are drawn, and more of them are seen than one might think
    if not may_be_seen(damage, (x, y, z), shot.scene.damages) and not shown.any():
        return NOTHING, unbounded
    size = shot.view.size
    points = surface_points(project(_facets(shot.scene, shot.mesh, damage), shot.view), size)
    pixel, within = points.pixel, points.within
    x, y = np.where(within[:, None], pixel, 0).T
    # where the sheet itself is seen, the damage target knows the answer already
    known = within & (points.depth_m <= shot.frame.depth[y, x] * (1 + _DEPTH_SLACK))
    known &= (shot.frame.damage[y, x] == SOUND_CONTAINER) | shown[y, x]
    rest_mm = points.rest_mm[~known]
    part = np.abs(amount_mm(damage, rest_mm)) > shot.config.damage.mask_threshold_mm
    part |= in_hole(damage, rest_mm)
    rows, columns = np.divmod(np.flatnonzero(shown), size[0])
    covered = np.concatenate([pixel[~known][part], np.stack([columns, rows], axis=1)])
    if not len(covered):
        return NOTHING, unbounded
    within = np.append(within[~known][part], np.ones(len(rows), bool))
    ends = covered + np.where(within, 1, points.step)[:, None]
    bounds = np.concatenate([covered.min(axis=0), ends.max(axis=0)]).astype(np.float64)
    beyond = _distinct(covered[~within] // points.step) * points.step**2
    inside = covered[within]
    if not len(inside):
        return Cover(NOTHING.mask, (0, 0), beyond), bounds
    low = inside.min(axis=0)
    mask = np.zeros((inside.max(axis=0) - low + 1)[::-1], bool)
    mask[*(inside - low).T[::-1]] = True
    return Cover(mask, (int(low[0]), int(low[1])), beyond), bounds


def _distinct(cells: NDArray[np.int64]) -> int:
    """How many of cells [P, 2] of a grid differ: coverage.surface_points bounds their number, and
    sorting them takes ten times as long."""
    if not len(cells):
        return 0
    columns, rows = (cells - cells.min(axis=0)).T
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
