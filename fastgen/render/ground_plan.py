"""Choice of the tiles that the background and the ground pass draw in an image."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.prepared_scene import Member
from fastgen.light.directional_lights import DirectionalLight
from fastgen.render.constants import GROUND_FILTER_PX, PROP_SHADE_M
from fastgen.render.ground_values import clear_radius_mm
from fastgen.render.tiles import Mask, Tiles, bit_masks
from fastgen.render.variant import GroundVariant
from fastgen.render.visible_members import hiding_tiles
from fastgen.scene import Ground, Prop
from fastgen.scene.boxes import OrientedBox, prop_box
from fastgen.scene.limits import MM

_FILTER_PX = 2 * GROUND_FILTER_PX
"""GROUND_FILTER_PX in pixels of the whole image, where the ground has half the resolution."""

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
    lights: Sequence[DirectionalLight],
) -> GroundPlan:
    """Return what is drawn of the background, the plane and the props of a scene.

    Nothing is drawn where containers hide it, and no background where the plane does.

    Args:
        ground: The plane.
        props: Props on it.
        members: Containers that are present.
        view: Projection of the image.
        lights: Directional lights in the world frame, brightest first. Each casts the shadows of
            containers, and the first also those of props.
    """
    tiles = Tiles(view)
    seen, near = _plane_tiles(tiles, ground, clear_radius_mm(ground, members, props))
    shown = shaded = dark = _none(tiles)
    masks = None
    hidden = _any(hiding_tiles(members, view, tiles))
    if props:
        parts = [prop_box(prop) for prop in props]
        seen_props = tiles.touched(np.stack([part.corners_mm for part in parts]))
        shades = tiles.touched(_reaches(parts, ground, view, lights[:1], PROP_SHADE_M / MM)[0])
        shown, shaded = _any(seen_props), _any(shades)
        masks = np.concatenate([bit_masks(seen_props), bit_masks(shades)], axis=-1)
    wet = ground.wetness > 0
    if members and wet:  # it may mirror a container anywhere
        dark = ~_none(tiles)
    elif members:
        boxes = [member.box for member in members]
        dark = _any(tiles.touched(np.concatenate(_reaches(boxes, ground, view, lights))))
    plain = GroundVariant(ground.kind, wet=wet)
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


def _reaches(
    boxes: Sequence[OrientedBox],
    ground: Ground,
    view: View,
    lights: Sequence[DirectionalLight],
    margin_mm: float = 0.0,
) -> Array:
    """Return points [max(K, 1), N, P, 3] for each of K lights above the plane and each box, in mm.

    Their hull contains the part of the plane below the box, the margin around this part, and the
    shadow of the box with its penumbra.

    Args:
        boxes: Boxes above the plane, N.
        ground: The plane.
        view: Projection of the image.
        lights: Directional lights in the world frame.
        margin_mm: Horizontal margin around each box.
    """
    corners = np.stack([box.corners_mm for box in boxes])
    at, above_mm = corners[..., :2], np.maximum(corners[..., 2] - ground.height_mm, 0)
    margin = np.full(above_mm.shape, margin_mm)
    below = _rectangles(at, np.array([1.0, 0.0]), margin, margin)
    found = [
        np.concatenate([below, _shadows(at, above_mm, each, ground, view)], axis=1)
        for each in lights
        if each.direction[2] > 0
    ]
    return np.insert(np.stack(found or [below]), 2, ground.height_mm, axis=-1)


def _shadows(
    at: Array, above_mm: Array, light: DirectionalLight, ground: Ground, view: View
) -> Array:
    """Return points [N, 4 P, 2] around the shadows of N bodies, including penumbra and filter.

    Args:
        at: Corners [N, P, 2] of each body in mm, seen from above.
        above_mm: Their heights [N, P] above the plane.
        light: A light above the plane, in the world frame.
        ground: The plane. Shadows may end outside of its reach.
        view: Projection of the image, over whose pixels edges of shadows are filtered.
    """
    level, sine = np.array(light.direction[:2]), light.direction[2]
    cosine = float(np.linalg.norm(level))
    away = -level / cosine if cosine > 1e-6 else np.array([1.0, 0.0])  # any direction if overhead
    cosine = max(cosine, 1e-6)
    longest = ground.reach_mm + np.linalg.norm(at, axis=-1).max()
    length = np.minimum(above_mm * cosine / sine, longest)
    ends = at + length[..., None] * away
    eye = view.position_m / MM - (0, 0, ground.height_mm)
    height = max(eye[2], 1.0)
    distance = np.hypot(np.linalg.norm(ends - eye[:2], axis=-1), height)
    filtered = _FILTER_PX / view.focals_px[0] * distance * np.sqrt(distance / height)
    # a disc around the ray to the light, from the corner to the plane
    across = light.radius * length / cosine + filtered
    # rays that touch the disc at its far side meet the plane at a flatter angle than its axis
    along = np.minimum(across / max(sine - light.radius * cosine, 1e-6), longest)
    return _rectangles(ends, away, along, across)


def _rectangles(center: Array, direction: Array, along: Array, across: Array) -> Array:
    """Return the corners [N, 4 P, 2] of rectangles.

    Args:
        center: Their centres [N, P, 2].
        direction: Unit vector [2].
        along: Half of their lengths [N, P] in this direction.
        across: Half of their widths [N, P].
    """
    aside = np.array([-direction[1], direction[0]])
    ahead, beside = along[..., None] * direction, across[..., None] * aside
    return np.concatenate(
        [center + i * ahead + k * beside for i in (-1, 1) for k in (-1, 1)], axis=1
    )
