"""Choice of the containers that are drawn in an image."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.geometry.damage_law import inward_mm
from fastgen.geometry.prepared_scene import Member
from fastgen.render.regions import Region, box_corners
from fastgen.render.tiles import Mask, Tiles
from fastgen.scene.boxes import OrientedBox, away_mm, back_to_front, rotation_of
from fastgen.scene.damage_kinds import form_of
from fastgen.scene.limits import MM, NEAR_M

_SKIN_MM = 150.0
"""Depth below its outer box from which an undamaged container hides what is behind it."""

_LEAST_AWAY_MM = 5 * NEAR_M / MM
"""Shortest distance from camera to container at which the near plane cuts off no visible part. Rays
are at most 78 degrees off the axis."""

Array = NDArray[np.float64]


def visible_members(
    members: Sequence[Member], view: View, tiles: Tiles
) -> list[tuple[Member, Region]]:
    """Return every container that the image may show, with the region that may show it.

    Containers outside the image or hidden by nearer ones are left out.

    Args:
        members: Containers that are present.
        view: Projection of the image, in the world frame.
        tiles: Its tiles.

    Returns:
        Containers from back to front, each with a region in pixels: x, y, width, height. Outside
        its region a container is hidden.

    Raises:
        ConfigError: Containers hide one another in a circle.
    """
    eye_mm = view.position_m / MM
    hidden = np.zeros(tiles.shape, bool)
    found: list[tuple[Member, Region]] = []
    # all containers at once, because NumPy is slow for few points
    touched = tiles.touched(np.reshape([_bounds_mm(each) for each in members], (-1, 8, 3)))
    filled = hiding_tiles(members, view, tiles)
    for number in reversed(back_to_front([each.box for each in members], eye_mm)):
        member = members[number]
        shown = touched[number] & ~hidden
        if member.prepared.spreader is not None:  # it may be visible above its container
            shown[:] = True
        if shown.any():
            found.append((member, tiles.bounding_region(shown)))
            hidden |= filled[number]
    return found[::-1]


def hiding_tiles(members: Sequence[Member], view: View, tiles: Tiles) -> Mask:
    """Return the tiles [N, R, C] in which nothing behind each of N containers is seen."""
    eye_mm = view.position_m / MM
    solids = [_solid_mm(each, eye_mm) for each in members]
    solid = [number for number, corners in enumerate(solids) if corners is not None]
    found = np.zeros((len(members), *tiles.shape), bool)
    found[solid] = tiles.filled(np.reshape([solids[number] for number in solid], (-1, 8, 3)))
    return found


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


def _bounds_mm(member: Member) -> Array:
    """Return the corners [8, 3] of a box around a container without its spreader."""
    own = member.prepared
    corners_mm = box_corners(own.container.bounds_mm, own.scene.damages)
    found: Array = corners_mm @ rotation_of(member.pose).T + member.pose.position_mm
    return found
