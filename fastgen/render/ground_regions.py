"""Regions of an image in which the ground pass draws with different programs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.render.blocks import MAX_BOXES
from fastgen.render.constants import GROUND_FADE_START
from fastgen.render.prop_tiles import joined, reaches, tile_masks
from fastgen.render.regions import Region, hull_corners, outside, within
from fastgen.render.variant import GroundVariant
from fastgen.scene import Ground, Scene
from fastgen.scene.boxes import OrientedBox, prop_box

_BLOCK_PX = 16
"""Height of the blocks of rows in which it is decided what to draw."""

_COLUMNS = 17
"""Columns of an image whose rays are followed to find what its rows see."""

_SHADED_MM = 600.0
"""Distance from a prop within which it shades the ground, see ground_props.glsl."""

_BLURRED_MM = 150.0
"""Distance beyond a container's shadow to which its edge may be blurred."""

_BOX_COUNTS = (0, 1, 2, 4, 8, MAX_BOXES)
"""Numbers of containers that programs are compiled for."""

Array = NDArray[np.float64]


class GroundDraw(NamedTuple):
    """A region of the image, and the program that draws it.

    Attributes:
        variant: Choices that the program is compiled for.
        region: The region.
    """

    variant: GroundVariant
    region: Region


class GroundPlan(NamedTuple):
    """Regions that the ground pass draws in an image, and the props of its tiles.

    Attributes:
        draws: Disjoint regions, with the program that draws each.
        tiles: Masks of the props of each tile, see `tile_masks`; None without props.
    """

    draws: list[GroundDraw]
    tiles: NDArray[np.uint32] | None


def ground_plan(
    scene: Scene, ground: Ground, view: View, boxes: Sequence[OrientedBox], toward: Array
) -> GroundPlan:
    """Return the regions that the ground pass draws in an image, each with its program.

    Args:
        scene: The scene, for its props.
        ground: Its ground.
        view: Projection of the image.
        boxes: Outer boxes of the containers that are present.
        toward: Unit vector [3] to the first directional light.
    """
    count = next(most for most in _BOX_COUNTS if most >= len(boxes))
    plain = GroundVariant(ground.kind, 0, view.distortion is not None, ground.wetness > 0)
    near = replace(plain, boxes=count, fades=True, shadows=True)
    draws: list[GroundDraw] = []
    rest = [*_bands(ground, view)]
    tiles = None
    if scene.props:
        parts = [prop_box(prop) for prop in scene.props]
        bodies, _ = hull_corners(view, np.stack([part.corners_mm for part in parts]))
        shades, _ = hull_corners(view, reaches(parts, ground.height_mm, toward, _SHADED_MM))
        tiles = tile_masks(bodies, shades, view.size)
        shown, around = joined(bodies), joined(shades)
        draws += [GroundDraw(replace(near, props=True), region) for region in shown]
        ground_around = [part for band in [*rest[0], *rest[1]] for part in within(around, band)]
        draws += [GroundDraw(near, region) for region in outside(ground_around, shown)]
        rest = [outside(outside(bands, around), shown) for bands in rest]
    dark: list[Region] = []
    if boxes and plain.wet:  # it may mirror a box anywhere
        dark = [(0, 0, *view.size)]
    elif boxes:
        dark = joined(hull_corners(view, reaches(boxes, ground.height_mm, toward, _BLURRED_MM))[0])
    for bands, fades in zip(rest, (False, True), strict=True):
        lit = outside(bands, dark)
        draws += [GroundDraw(replace(plain, fades=fades), region) for region in lit]
        # one program for near and far, because each takes a while to compile
        by_boxes = replace(plain, boxes=count, fades=True)
        draws += [GroundDraw(by_boxes, region) for region in outside(bands, lit)]
    return GroundPlan(draws, tiles)


def _bands(ground: Ground, view: View) -> tuple[list[Region], list[Region]]:
    """Return the rows that see only the near ground, and the other rows that may see ground.

    Near ground is the disc in which the ground does not fade. Without lens distortion its image is
    convex, so a row is near if its first and last columns are.
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
