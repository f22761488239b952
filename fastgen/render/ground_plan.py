"""Choice of the tiles that the background and the ground pass draw in an image."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.damage_law import inward_mm
from fastgen.geometry.mesh import UNIT_CUBE
from fastgen.geometry.prepared_scene import Member
from fastgen.render.ground_values import clear_radius_mm
from fastgen.render.tiles import Mask, Tiles, bit_masks
from fastgen.render.variant import GroundVariant
from fastgen.scene import Ground, Prop
from fastgen.scene.boxes import OrientedBox, away_mm, prop_box
from fastgen.scene.damage_kinds import form_of
from fastgen.scene.limits import MM, NEAR_M

_SHADED_MM = 600.0
"""Distance from a prop within which it shades the ground, see ground_props.glsl."""

_BLURRED_MM = 150.0
"""Distance beyond a container's shadow to which its edge may be blurred."""

_LONGEST_SHADOW_MM = 60000.0

_SKIN_MM = 150.0
"""Depth below its outer box from which an undamaged container hides what is behind it."""

_LEAST_AWAY_MM = 5 * NEAR_M / MM
"""Distance of a container to the camera from which the near plane cuts off no visible part of it;
rays are at most 78 degrees off the axis."""

Array = NDArray[np.float64]


class GroundDraw(NamedTuple):
    """Tiles of the image, and the program that draws them.

    Attributes:
        variant: Choices that the program is compiled for.
        tiles: bool [R, C].
    """

    variant: GroundVariant
    tiles: Mask


class GroundPlan(NamedTuple):
    """Tiles that the background and the ground pass draw in an image.

    Attributes:
        tiles: The grid of tiles.
        sky: Tiles that may show the background alone.
        plane: Disjoint tiles that may show the plane, each with the program that draws them.
        props: Tiles that may show props; the program draws the plane behind them as well.
        masks: Two masks of 64 bits for each tile, uint32 [R, C, 4], low word first. Bit k of the
            first is set if the tile may show prop k, and bit k of the second if prop k may shade
            its ground. None without props.
    """

    tiles: Tiles
    sky: Mask
    plane: list[GroundDraw]
    props: GroundDraw
    masks: NDArray[np.uint32] | None


def ground_plan(
    ground: Ground,
    props: Sequence[Prop],
    members: Sequence[Member],
    view: View,
    toward: Array,
) -> GroundPlan:
    """Return what is drawn of the background, the plane and the props of a scene.

    Nothing is drawn where containers hide it, and no background where the plane does.

    Args:
        ground: The plane.
        props: Props on it.
        members: Containers that are present.
        view: Projection of the image.
        toward: Unit vector [3] to the first directional light.
    """
    tiles = Tiles(view)
    seen, near = _plane_tiles(tiles, ground, clear_radius_mm(ground, members, props))
    shown = shaded = dark = _none(tiles)
    masks = None
    eye_mm = view.position_m / MM
    solids = [solid for each in members if (solid := _solid_mm(each, eye_mm)) is not None]
    hidden = tiles.filled(np.reshape(solids, (-1, 8, 3)))
    if props:
        parts = [prop_box(prop) for prop in props]
        seen_props = tiles.touched(np.stack([part.corners_mm for part in parts]))
        shades = tiles.touched(_reaches(parts, ground.height_mm, toward, _SHADED_MM))
        shown, shaded = _any(seen_props), _any(shades)
        masks = np.concatenate([bit_masks(seen_props), bit_masks(shades)], axis=-1)
    wet = ground.wetness > 0
    if members and wet:  # it may mirror a container anywhere
        dark = ~_none(tiles)
    elif members:
        boxes = [member.box for member in members]
        dark = _any(tiles.touched(_reaches(boxes, ground.height_mm, toward, _BLURRED_MM)))
    plain = GroundVariant(ground.kind, lens=view.distortion is not None, wet=wet)
    near_bodies = replace(plain, boxes=bool(members), shadows=bool(props))
    alone = seen & ~(hidden | dark | shaded)
    plane = [GroundDraw(plain, alone), GroundDraw(near_bodies, seen & ~hidden & ~alone)]
    return GroundPlan(
        tiles,
        sky=~hidden & ~near,
        plane=[each for each in plane if each.tiles.any()],
        props=GroundDraw(replace(near_bodies, props=True), shown & ~hidden),
        masks=masks,
    )


def _none(tiles: Tiles) -> Mask:
    return np.zeros(tiles.shape, bool)


def _any(masks: Mask) -> Mask:
    return np.asarray(masks.any(axis=0), bool)


def _plane_tiles(tiles: Tiles, ground: Ground, alone_mm: float) -> tuple[Mask, Mask]:
    """Return the tiles that may see the plane, and the tiles that see the plane alone.

    The latter see the disc of radius `alone_mm`, in which nothing of the panorama is seen. Without
    lens distortion its image is convex, so a tile sees nothing else if its corners do not.
    """
    eye_mm, rays = tiles.view.position_m / MM, tiles.rays
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (ground.height_mm - eye_mm[2]) / rays[..., 2]
        at = eye_mm[:2] + distance[..., None] * rays[..., :2]
    away = np.where(distance > 0, np.hypot(at[..., 0], at[..., 1]), np.inf)
    corners = np.stack([away[:-1, :-1], away[:-1, 1:], away[1:, :-1], away[1:, 1:]])
    near = ~_any(corners >= 0.97 * alone_mm)
    some = np.pad(_any(corners < ground.reach_mm), 1)
    # a tile beside one that sees the plane may see some between its corners
    rows = some[:-2] | some[1:-1] | some[2:]
    seen: Mask = rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
    return seen, near


def _solid_mm(member: Member, eye_mm: Array) -> Array | None:
    """Return corners [8, 3] of a box through which nothing behind a container is seen.

    None for a container with holes, with too deep dents, or beside the camera.
    """
    if away_mm(member.box, eye_mm) < _LEAST_AWAY_MM:
        return None
    damages = member.prepared.scene.damages
    skin_mm = _SKIN_MM + sum(map(inward_mm, damages))
    half = member.box.half_mm - skin_mm
    if half.min() <= 0 or any(form_of(damage).outline for damage in damages):
        return None
    return OrientedBox(member.box.center_mm, half, member.box.rotation).corners_mm


def _reaches(
    boxes: Sequence[OrientedBox], ground_mm: float, toward: Array, margin_mm: float
) -> Array:
    """Return points [N, 16, 3]; each row's hull contains a box, its margin and its shadow, in mm.

    Args:
        boxes: Boxes above the ground.
        ground_mm: Height of the ground.
        toward: Unit vector [3] to the light.
        margin_mm: Horizontal margin around each box.
    """
    corners = np.stack([box.corners_mm for box in boxes])
    low, high = corners.min(axis=1), corners.max(axis=1)
    low[:, :2], high[:, :2] = low[:, :2] - margin_mm, high[:, :2] + margin_mm
    low[:, 2] = np.minimum(low[:, 2], ground_mm)
    above = np.maximum(corners[..., 2:] - ground_mm, 0)
    thrown = -toward[:2] * above / max(toward[2], 1e-3)
    far = np.linalg.norm(thrown, axis=-1, keepdims=True)
    thrown *= np.minimum(1, _LONGEST_SHADOW_MM / np.maximum(far, 1)) * 1.02
    shadows = np.concatenate(
        [corners[..., :2] + thrown, np.full_like(corners[..., :1], ground_mm)], axis=-1
    )
    return np.concatenate(
        [_cuboids(low, high), _cuboids(shadows.min(axis=1), shadows.max(axis=1))], axis=1
    )


def _cuboids(low: Array, high: Array) -> Array:
    """Return the corners [N, 8, 3] of upright boxes from their lowest and highest points [N, 3]."""
    corners: Array = low[:, None] + UNIT_CUBE * (high - low)[:, None]
    return corners
