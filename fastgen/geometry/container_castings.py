"""The eight corner fittings with their apertures, ISO 1161.

An aperture is a dark polygon of twelve corners, flush with the face. At 10 m, a 45 mm lens and a
36 mm sensor of 640 pixels resolve 12.5 mm: a 63 mm opening covers 5 pixels, which show neither a
rounder arc nor the walls inside.
"""

import numpy as np

from fastgen.geometry.container_layout import Array, Layout
from fastgen.geometry.unfold import Patch, Sheet, beside, flat, polygon
from fastgen.scene.container_kinds import CASTING_MM
from fastgen.scene.faces import FACE_AXES, FACES

APERTURE_CENTER_MM = (101.5, 89.0, 59.0)
"""Distance of the aperture centres from the end (x), the side (y) and the bottom or top (z)."""

_APERTURES_MM = ((63.5, 51.0), (79.0, 63.5), (124.0, 63.5))
"""Width and height seen from outside, by the axis of the face."""


def castings(layout: Layout) -> list[Sheet]:
    """Return all sheets of the eight fittings."""
    half = np.array([*layout.half, layout.top / 2])
    sheets = []
    for x_face in ("no_door", "door"):
        for y_face in ("front", "back"):
            for z_face in ("underside", "roof"):
                name = f"casting.{x_face}.{y_face}.{z_face}"
                signs = np.array([FACE_AXES[f].out for f in (x_face, y_face, z_face)]).sum(axis=0)
                sheets.extend(_casting(name, (x_face, y_face, z_face), half, signs))
    return sheets


def _casting(name: str, faces: tuple[str, str, str], half: Array, signs: Array) -> list[Sheet]:
    """Return the sheets of the fitting at corner `signs` [3] of a box of half size `half` [3]."""
    size = np.array(CASTING_MM)
    shift = np.array([0.0, 0.0, half[2]])
    corner = signs * half + shift
    far = corner - signs * size
    holes_center = corner - signs * np.array(APERTURE_CENTER_MM)
    sheets, plain = [], []
    for axis, face in enumerate(faces):
        axes = FACE_AXES[face]
        center = holes_center.copy()
        center[axis] = corner[axis]
        right, up = np.array(axes.right, np.float64), np.array(axes.up, np.float64)
        outline = center + _stadium(*_APERTURES_MM[axis]) @ np.array([right, up])
        rectangle = _rectangle(corner, far, axis, corner[axis])
        front = _plate_with_hole(rectangle, outline, right, up)
        aperture = polygon(outline, right, up)
        sheets.append(Sheet(f"{name}.{face}", face, "casting", face, front))
        sheets.append(Sheet(f"{name}.{face}.aperture", face, "rubber", face, aperture))
        opposite = FACE_AXES[_opposite(face)]
        plain.append(polygon(_rectangle(corner, far, axis, far[axis]), opposite.right, opposite.up))
    sheets.append(Sheet(f"{name}.inner", faces[0], "casting", "frame", beside(plain)))
    return sheets


def _opposite(face: str) -> str:
    out = np.array(FACE_AXES[face].out)
    return next(f for f in FACES if np.array_equal(np.array(FACE_AXES[f].out), -out))


def _rectangle(corner: Array, far: Array, axis: int, level: float) -> Array:
    """Return the corners [4, 3] of a casting's face at `level` along `axis`, in order around it."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    points = np.empty((4, 3))
    points[:, axis] = level
    points[:, i] = (corner[i], far[i], far[i], corner[i])
    points[:, j] = (corner[j], corner[j], far[j], far[j])
    return points


def _stadium(width: float, height: float) -> Array:
    """Return an outline [12, 2] around the origin, counter-clockwise, with points on both axes."""
    radius = height / 2
    straight = width / 2 - radius
    diagonal = radius * np.sqrt(0.5)
    quarter = [(width / 2, 0.0), (straight + diagonal, diagonal), (straight, radius)]
    x, y = np.array(quarter).T
    second = np.column_stack([-x[:0:-1], y[:0:-1]])
    upper = np.concatenate([np.column_stack([x, y]), [(0.0, radius)], second])
    return np.concatenate([upper, -upper])


def _plate_with_hole(rectangle: Array, outline: Array, right: Array, up: Array) -> Patch:
    """Return the plate between corners [4, 3] and an outline [12, 3] with points on both axes."""
    seen = np.column_stack([rectangle @ right, rectangle @ up])
    middle = seen.mean(axis=0)
    turn = np.arctan2(seen[:, 1] - middle[1], seen[:, 0] - middle[0])
    corners = rectangle[np.argsort(turn % (2 * np.pi))]
    count = len(outline)
    quarter = count // 4
    triangles = []
    for i in range(count):
        triangles.append((count + i // quarter, (i + 1) % count, i))
        if i % quarter == 0:
            triangles.append((count + (i // quarter - 1) % 4, count + i // quarter, i))
    return flat(np.concatenate([outline, corners]), triangles, right, up)
