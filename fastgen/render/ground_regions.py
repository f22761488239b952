"""Regions of an image in which the ground pass draws with different programs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.render.blocks import MAX_BOXES
from fastgen.render.constants import GROUND_FADE_START
from fastgen.render.ground_values import prop_box
from fastgen.render.regions import Region, outside, region_of
from fastgen.render.variant import GroundVariant
from fastgen.scene import Ground, Scene
from fastgen.scene.boxes import OrientedBox

_BLOCK_PX = 16
"""Height of the blocks of rows in which it is decided what to draw."""

_COLUMNS = 17
"""Columns of an image whose rays are followed to find what its rows see."""

_SHADED_MM = 600.0
"""Distance from a prop within which it shades the ground, see ground_props.glsl."""

_BLURRED_MM = 150.0
"""Distance beyond a container's shadow to which its edge may be blurred."""

_LONGEST_SHADOW_MM = 60000.0

_BOX_COUNTS = (0, 1, 2, 4, 8, MAX_BOXES)
"""Numbers of containers that programs are compiled for."""

Array = NDArray[np.float64]


def ground_regions(
    scene: Scene, ground: Ground, view: View, boxes: Sequence[OrientedBox], toward: Array
) -> dict[GroundVariant, list[Region]]:
    """Return disjoint regions of the image by the program that draws each.

    Args:
        scene: The scene, for its props.
        ground: Its ground.
        view: Projection of the image.
        boxes: Outer boxes of the containers that are present.
        toward: Unit vector [3] to the first directional light.
    """
    whole = (0, 0, *view.size)
    near, far = _bands(ground, view)
    count = next(most for most in _BOX_COUNTS if most >= len(boxes))
    plain = GroundVariant(ground.kind, 0, view.distortion is not None, ground.wetness > 0)
    found: dict[GroundVariant, list[Region]] = {}
    rest = [near, far]
    if scene.props:
        props = [prop_box(prop) for prop in scene.props]
        around = [region_of(view, _reach(props, ground, toward, _SHADED_MM)) or whole]
        found[replace(plain, boxes=count, fades=True, props=True)] = around
        rest = [outside(bands, around) for bands in rest]
    # a wet plane mirrors boxes from everywhere
    shaded = (
        [whole]
        if plain.wet
        else [region_of(view, _reach([box], ground, toward, _BLURRED_MM)) or whole for box in boxes]
    )
    open_ = [outside(bands, shaded) for bands in rest]
    found[plain], found[replace(plain, fades=True)] = open_
    if boxes:  # one program for near and far, because each takes a while to compile
        near, far = rest
        closed = [*outside(near, open_[0]), *outside(far, open_[1])]
        found[replace(plain, fades=True, boxes=count)] = closed
    return found


def _bands(ground: Ground, view: View) -> tuple[list[Region], list[Region]]:
    """Return the rows that see only the near ground, and the others that may see ground.

    Near ground is not faded at all. It is the inside of a circle, and so is what an image sees of
    it convex without lens distortion; the border columns decide.
    """
    width, height = view.size
    rows = np.append(np.arange(0, height, _BLOCK_PX), height)
    x, y = np.meshgrid(np.linspace(0, width, _COLUMNS), rows)
    eye_mm, rays = view.rays(np.stack([x, y], axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (ground.height_mm - eye_mm[2]) / rays[..., 2]
        at = eye_mm[:2] + distance[..., None] * rays[..., :2]
    away = np.where(distance > 0, np.hypot(at[..., 0], at[..., 1]), np.inf)
    all_near = away.max(axis=1) < 0.97 * GROUND_FADE_START * ground.reach_mm
    some = away.min(axis=1) < ground.reach_mm
    blocks_near = all_near[1:] & all_near[:-1]
    # a block beside one that sees ground may see some between the columns
    seen = some[1:] | some[:-1]
    blocks_seen = seen | np.append(seen[1:], False) | np.append(False, seen[:-1])
    found: tuple[list[Region], list[Region]] = ([], [])
    for regions, blocks in zip(found, (blocks_near, blocks_seen & ~blocks_near), strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], blocks.astype(int), [0]])))
        for first, end in edges.reshape(-1, 2):
            top, bottom = int(rows[first]), int(rows[end])
            regions.append((0, top, width, bottom - top))
    return found


def _reach(boxes: Sequence[OrientedBox], ground: Ground, toward: Array, margin_mm: float) -> Array:
    """Return points [N, 3] in mm whose hull contains boxes, a margin and their shadows."""
    corners = np.concatenate([box.corners_mm for box in boxes])
    low, high = corners.min(axis=0), corners.max(axis=0)
    low[:2], high[:2] = low[:2] - margin_mm, high[:2] + margin_mm
    low[2] = min(low[2], ground.height_mm)
    hull = low + UNIT_CUBE * (high - low)
    above = np.maximum(corners[:, 2:] - ground.height_mm, 0)
    thrown = -toward[:2] * above / max(toward[2], 1e-3)
    far = np.hypot(*thrown.T)[:, None]
    thrown *= np.minimum(1, _LONGEST_SHADOW_MM / np.maximum(far, 1)) * 1.02
    shadows = np.column_stack([corners[:, :2] + thrown, np.full(len(corners), ground.height_mm)])
    return np.concatenate([hull, shadows])
