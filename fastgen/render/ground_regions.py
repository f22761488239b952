"""Regions of an image in which the ground pass draws with different programs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.render.blocks import MAX_BOXES
from fastgen.render.constants import GROUND_FADE_START
from fastgen.render.regions import Region, merged, outside, region_of, within
from fastgen.render.variant import GroundVariant
from fastgen.scene import Ground, Prop, Scene
from fastgen.scene.boxes import OrientedBox, prop_box

_BLOCK_PX = 16
"""Height of the blocks of rows in which it is decided what to draw."""

_COLUMNS = 17
"""Columns of an image whose rays are followed to find what its rows see."""

_SHADED_MM = 600.0
"""Distance from a prop within which it shades the ground, see ground_props.glsl."""

_BLURRED_MM = 150.0
"""Distance beyond a container's shadow to which its edge may be blurred."""

_APART_MM = 400.0
"""Least distance between the props of two vehicles."""

_LONGEST_SHADOW_MM = 60000.0

_BOX_COUNTS = (0, 1, 2, 4, 8, MAX_BOXES)
"""Numbers of containers that programs are compiled for."""

Array = NDArray[np.float64]


class GroundDraw(NamedTuple):
    """A region of the image, and the program that draws it.

    Attributes:
        variant: What the program is compiled for.
        region: The region.
        props: First prop that the region or a shadow in it may show, and the one after the last.
    """

    variant: GroundVariant
    region: Region
    props: tuple[int, int] = (0, 0)


def ground_regions(
    scene: Scene, ground: Ground, view: View, boxes: Sequence[OrientedBox], toward: Array
) -> list[GroundDraw]:
    """Return disjoint regions of the image with the program that draws each.

    Args:
        scene: The scene, for its props.
        ground: Its ground.
        view: Projection of the image.
        boxes: Outer boxes of the containers that are present.
        toward: Unit vector [3] to the first directional light.
    """
    whole = (0, 0, *view.size)
    count = next(most for most in _BOX_COUNTS if most >= len(boxes))
    plain = GroundVariant(ground.kind, 0, view.distortion is not None, ground.wetness > 0)
    near = replace(plain, boxes=count, fades=True, shadows=True)
    draws: list[GroundDraw] = []
    rest = [*_bands(ground, view)]
    if scene.props:
        vehicles = _clusters(scene.props)
        bodies, shaded = [], []
        for first, end in vehicles:
            parts = [prop_box(prop) for prop in scene.props[first:end]]
            corners = np.concatenate([part.corners_mm for part in parts])
            bodies.append(region_of(view, _around(corners)) or whole)
            shaded.append(region_of(view, _reach(parts, ground, toward, _SHADED_MM)) or whole)
        shown = [region for region in merged(bodies) if region is not None]
        around = [region for region in merged(shaded) if region is not None]
        for variant, regions in (
            (replace(near, props=True), shown),
            (
                near,
                outside(
                    [part for bands in rest for band in bands for part in within(around, band)],
                    shown,
                ),
            ),
        ):
            for region in regions:
                found = [v for v, s in zip(vehicles, shaded, strict=True) if within([s], region)]
                if region[2] > 0 < region[3]:
                    ends = (found[0][0], found[-1][1]) if found else (0, 0)
                    draws.append(GroundDraw(variant, region, ends))
        rest = [outside(outside(bands, around), shown) for bands in rest]
    # a wet plane mirrors boxes from everywhere
    dark = (
        [whole]
        if plain.wet
        else [region_of(view, _reach([box], ground, toward, _BLURRED_MM)) or whole for box in boxes]
    )
    for bands, fades in zip(rest, (False, True), strict=True):
        lit = outside(bands, dark) if boxes else bands
        draws += [GroundDraw(replace(plain, fades=fades), region) for region in lit]
        # one program for near and far, because each takes a while to compile
        by_boxes = replace(plain, boxes=count, fades=True)
        draws += [GroundDraw(by_boxes, region) for region in outside(bands, lit)]
    return draws


def _clusters(props: Sequence[Prop]) -> list[tuple[int, int]]:
    """Return the ranges of consecutive props that are close to one another, such as a vehicle."""
    found: list[tuple[int, int]] = []
    low = high = np.zeros(2)
    for number, prop in enumerate(props):
        corners = prop_box(prop).corners_mm[:, :2]
        least, most = corners.min(axis=0), corners.max(axis=0)
        if found and (least < high + _APART_MM).all() and (most > low - _APART_MM).all():
            found[-1] = (found[-1][0], number + 1)
            low, high = np.minimum(low, least), np.maximum(high, most)
        else:
            found.append((number, number + 1))
            low, high = least, most
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
    return np.concatenate([hull, _around(shadows)])


def _around(points: Array) -> Array:
    """Return the corners [8, 3] of the upright box around points [N, 3].

    Regions of few points are found much faster if the lens distorts.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    corners: Array = low + UNIT_CUBE * (high - low)
    return corners
