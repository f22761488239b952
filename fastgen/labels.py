"""Frame + Scene -> Objects: boxes, areas and visibility of everything labelled, vectorised."""

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.camera import MM, NEAR_M
from fastgen.classes import CONTAINER_ID, SPREADER_ID
from fastgen.container import KINDS
from fastgen.damage import deform
from fastgen.drawing.decal_tables import object_ids
from fastgen.geometry.divided_mesh import as_drawn
from fastgen.geometry.mesh import Mesh
from fastgen.labelling.coverage import boxes, covered, project
from fastgen.labelling.damage_labels import damage_objects
from fastgen.labelling.facets import Facets, decal_facets, in_fours, mesh_facets
from fastgen.labelling.visibility import Shot, float_box, mask_box, visibility
from fastgen.sample import Box, Keypoint, Object
from fastgen.scene import Decal, Scene

_EDGE_POINTS = 16
"""Points along each side of a decal's outline, which follows the corrugation."""

_PIECES = 24
"""Along each side of the container's outer box, where a lens bends it."""

CASTINGS = tuple(
    f"{end}_{side}_{level}"
    for end in ("no_door", "door")
    for side in ("front", "back")
    for level in ("bottom", "top")
)
"""Names of a container's keypoints: the outer corners of its eight corner castings."""


def decal_of(scene: Scene, object_id: int) -> Decal:
    """The decal that bears `object_id` in the id target. Raises KeyError where none does."""
    ids = object_ids(scene)
    if object_id < 2 or object_id not in ids:
        raise KeyError(f"no decal has id {object_id} in scene {scene.index}")
    return scene.decals[ids.index(object_id)]


def label(shot: Shot) -> list[Object]:
    """All labelled objects of one image, those of which nothing is visible included."""
    return [_container(shot), *_spreader(shot), *damage_objects(shot), *_decals(shot)]


def _decals(shot: Shot) -> list[Object]:
    frame, scene, view, mesh = shot.frame, shot.scene, shot.view, shot.mesh
    ids = np.array(object_ids(scene), np.int64)
    labelled = np.flatnonzero(ids)
    if not labelled.size:
        return []
    count = len(labelled)
    seen_boxes, areas = visible_boxes(frame.ids, int(ids.max()) + 1)
    seen = project(_decal_facets(scene, mesh), view)
    bounds = boxes(seen.pixels, seen.owner, count)
    # of what is not seen, what it would cover does not matter
    asked = (areas[ids[labelled]] > 0)[seen.owner]
    alone = covered(seen.pixels[asked], seen.owner[asked], count, view.size)
    hidden = alone.hidden(frame.ids.ravel()[alone.pixel] == ids[labelled][alone.owner])
    pixels, depth = view.project(outlines_mm(scene, mesh))
    counts: dict[str, int] = {}
    objects = []
    for row, i in enumerate(labelled):
        decal, object_id = scene.decals[i], int(ids[i])
        counts[decal.class_name] = counts.get(decal.class_name, 0) + 1
        outline = np.round(pixels[row], 2) if (depth[row] > 0).all() else np.zeros((0, 2))
        area = int(areas[object_id])
        objects.append(
            Object(
                id=object_id,
                class_name=decal.class_name,
                instance=counts[decal.class_name],
                bbox=seen_boxes[object_id],
                amodal_bbox=float_box(bounds[row]),
                area=area,
                text=decal.text,
                polygon=tuple(outline.ravel().tolist()),
                # from the outline's corners in the order in which the eye finds them
                quad=tuple(outline[::_EDGE_POINTS][::-1].ravel().tolist()) if outline.size else (),
                reading=("vertical" if decal.vertical else "horizontal") if decal.text else "",
                **visibility(shot.config, area, int(hidden[row]), int(alone.beyond[row])),
            )
        )
    return objects


def visible_boxes(
    ids: NDArray[np.uint16], count: int
) -> tuple[list[Box | None], NDArray[np.int64]]:
    """Tight boxes and areas of every id below `count` in one pass over the labelled pixels.

    ids: uint16 [H, W]. Returns a list of `count` boxes, None where an id is not seen, and int64
    [count] areas in pixels. Ids 0 and 1 (void and container) are left out, None and 0, as are those
    of `count` and above.
    """
    mask = (ids > CONTAINER_ID) & (ids < count)
    at = cv2.findNonZero(mask.view(np.uint8))
    columns, rows = np.zeros((2, 0), np.int32) if at is None else at.reshape(-1, 2).T
    found = ids[rows, columns].astype(np.int64)
    areas = np.bincount(found, minlength=count)[:count]
    x0, y0 = np.full((2, count), max(ids.shape), np.int32)
    x1, y1 = np.zeros((2, count), np.int32)
    # pixels come row by row, and of those that write to one place the last stays
    y0[found[::-1]] = rows[::-1]
    y1[found] = rows + 1
    np.minimum.at(x0, found, columns)
    np.maximum.at(x1, found, columns + 1)
    found_boxes: list[Box | None] = [
        (int(x0[i]), int(y0[i]), int(x1[i]), int(y1[i])) if areas[i] else None for i in range(count)
    ]
    return found_boxes, areas


@lru_cache(maxsize=4)
def _decal_facets(scene: Scene, mesh: Mesh) -> Facets:
    """The cameras of a scene share them."""
    return decal_facets(scene, mesh)


@lru_cache(maxsize=4)
def outlines_mm(scene: Scene, mesh: Mesh) -> NDArray[np.float64]:
    """Outlines [N, points, 3] of the labelled decals after damage; a scene's cameras share them."""
    decals = [decal for decal in scene.decals if decal.class_name]
    rest = np.empty((len(decals), 4 * _EDGE_POINTS, 3))
    for face in {decal.face for decal in decals}:
        rows = [row for row, decal in enumerate(decals) if decal.face == face]
        edges = np.stack([_outline(decals[row]) for row in rows])
        positions, _ = mesh.sheet_to_surface(face, edges.reshape(-1, 2))
        rest[rows] = positions.reshape(len(rows), -1, 3)
    return deform(scene.damages, rest)


def _outline(decal: Decal) -> NDArray[np.float64]:
    """Sheet points [4 * _EDGE_POINTS, 2] in mm along a decal's edge.

    A marker's edge is the diamond inscribed in its rectangle, other decals' the rectangle itself.
    It starts at the lowest corner of a diamond, the lower left one of a rectangle, and goes round
    counter-clockwise from outside.
    """
    half = np.array(decal.size_mm) / 2
    edge = (_DIAMOND if decal.kind == "marker" else _RECTANGLE) * half
    return np.asarray(edge @ decal.turn.T + np.array(decal.center_mm), np.float64)


def _along_edges(corners: ArrayLike) -> NDArray[np.float64]:
    """Points [_EDGE_POINTS * K, 2] along the polygon of `corners` [K, 2]."""
    begin = np.array(corners, np.float64)[:, None]
    steps = np.arange(_EDGE_POINTS)[:, None] / _EDGE_POINTS
    return (begin + steps * (np.roll(begin, -1, axis=0) - begin)).reshape(-1, 2)


_DIAMOND = _along_edges([[0, -1], [1, 0], [0, 1], [-1, 0]])
_RECTANGLE = _along_edges([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def _container(shot: Shot) -> Object:
    """The container's pixels are also those of its decals: what lies on it is part of it.

    Where the spreader hides it, or the image ends, its outer box stands for it, a few millimetres
    larger than rails and sheets: its visible fraction is true to one percent of the whole.
    """
    frame, view = shot.frame, shot.view
    shown = frame.damage > 0  # what is seen through two holes is the container's, though void
    area = int(np.count_nonzero(shown))
    points = _container_points(shot.scene, shot.mesh, view.distortion is not None)
    pixels, depth = view.project(points)
    x, y = pixels.T.copy()
    bounds = np.array([x.min(), y.min(), x.max(), y.max()])
    if depth.min() < NEAR_M:
        everything = project(mesh_facets(shot.scene, shot.mesh, list(shot.mesh.groups), 0), view)
        (bounds,) = boxes(everything.pixels, everything.owner, 1)
    corners = _corners_mm(shot.scene)
    sides = corners[list(_SIDES)]
    if view.distortion:
        sides = _pieces(sides)
    box = project(Facets(sides, sides, np.zeros(len(sides), np.int64)), view)
    # what is void within the box is known: nothing hides there
    asked = mask_box(shot.spreader_shown) or (0, 0, 0, 0)
    alone = covered(box.pixels, box.owner, 1, view.size, asked)
    (hidden,) = alone.hidden(~shot.spreader_shown.ravel()[alone.pixel])
    castings, polygon = _castings(shot, corners)
    told = visibility(shot.config, area, int(hidden), int(alone.beyond[0]))
    if area and ((bounds[:2] < 0).any() or (bounds[2:] > view.size).any()):
        told["truncated"] = True  # damage bulges out of the box
    return Object(
        id=CONTAINER_ID,
        class_name="container",
        instance=1,
        bbox=mask_box(shown),
        amodal_bbox=float_box(bounds),
        area=area,
        polygon=polygon,
        keypoints=castings,
        **told,
    )


def _spreader(shot: Shot) -> list[Object]:
    """The spreader with its headblock and the cables as far as they are modelled."""
    if shot.spreader is None:
        return []
    shown = shot.spreader_shown
    area = int(np.count_nonzero(shown))
    mesh = as_drawn(shot.spreader, shot.view.distortion is not None)
    seen = project(_all_facets(mesh), shot.view)
    (bounds,) = boxes(seen.pixels, seen.owner, 1)
    alone = covered(seen.pixels[seen.faces], seen.owner[seen.faces], 1, shot.view.size)
    (hidden,) = alone.hidden(shown.ravel()[alone.pixel])
    return [
        Object(
            id=SPREADER_ID,
            class_name="spreader",
            instance=1,
            bbox=mask_box(shown),
            amodal_bbox=float_box(bounds),
            area=area,
            **visibility(shot.config, area, int(hidden), int(alone.beyond[0])),
        )
    ]


@lru_cache(maxsize=2)
def _all_facets(mesh: Mesh) -> Facets:
    """Of a mesh that nothing damages; the cameras of a scene share them."""
    return in_fours(mesh_facets(None, mesh, list(mesh.groups), 0))


@lru_cache(maxsize=4)
def _container_points(scene: Scene, mesh: Mesh, bent: bool) -> NDArray[np.float64]:
    """Points [P, 3] in mm after damage: from any side the container's outermost are among them.

    bent: whether a lens bends what is seen, so that others than corners of the hull may be.
    """
    if scene.damages:
        return deform(scene.damages, mesh.points_mm)
    return mesh.points_mm if bent else mesh.points_mm[mesh.hull]


def _pieces(sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """Four-sided `sides` [K, 4, 3] cut into smaller ones of the same winding, [K * n * n, 4, 3]."""
    across, up = np.meshgrid(*[np.linspace(0, 1, _PIECES + 1)] * 2, indexing="ij")
    weights = np.stack([(1 - across) * (1 - up), across * (1 - up), across * up, (1 - across) * up])
    grid = np.einsum("wxy,kwc->kxyc", weights, sides)
    corners = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
    return np.stack(corners, axis=3).reshape(-1, 4, 3)


_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)])
_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Corners of the outer box in the order of CASTINGS, and its sides."""


def _corners_mm(scene: Scene) -> NDArray[np.float64]:
    """The castings' outer corners [8, 3] after damage."""
    kind = KINDS[scene.container.kind]
    rest = _SIGNS * np.array([kind.length_mm / 2, kind.width_mm / 2, kind.height_mm])
    return deform(scene.damages, rest)


def _castings(
    shot: Shot, corners: NDArray[np.float64]
) -> tuple[tuple[Keypoint, ...], tuple[float, ...]]:
    """The castings' outer corners in the order of CASTINGS, and the polygon around them.

    A convex body's corner is seen where any of the planes that meet in it faces the camera, and
    the spreader is not before it.
    """
    pixels, depth = shot.view.project(corners)
    outward = np.where(_SIGNS == 0, -1, _SIGNS)
    faces = np.any((shot.view.position_m / MM - corners) * outward > 0, axis=1)
    inside = (depth > 0) & ((pixels >= 0) & (pixels < shot.view.size)).all(axis=1)
    if shot.spreader is not None:
        faces &= ~_behind(shot.spreader, shot.view.position_m / MM, corners)
    found: list[Keypoint] = [
        (round(x, 3), round(y, 3), 2 if face else 1) if within else (0.0, 0.0, 0)
        for (x, y), face, within in zip(
            pixels.tolist(), faces.tolist(), inside.tolist(), strict=True
        )
    ]
    if depth.min() <= 0:
        return tuple(found), ()
    straight = pixels
    if shot.view.distortion:
        straight, _ = replace(shot.view, distortion=None).project(corners)
    hull = cv2.convexHull(straight.astype(np.float32), returnPoints=False).ravel()
    outline = pixels[hull]
    if shot.view.distortion:  # lines of the world are curves in the image
        along = np.arange(_EDGE_POINTS)[:, None] / _EDGE_POINTS
        lines = zip(corners[hull], corners[np.roll(hull, -1)], strict=True)
        outline, _ = shot.view.project(np.concatenate([a + along * (b - a) for a, b in lines]))
    return tuple(found), tuple(np.round(outline.reshape(-1), 2).tolist())


def _behind(
    mesh: Mesh, eye_mm: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which of points [N, 3] the mesh hides from the eye, bool [N]; Moeller and Trumbore 1997."""
    a, b_a, c_a, normal = _spanned(mesh)
    ray, offset = points - eye_mm, eye_mm - a
    # their triple products, turned so that nothing is crossed for each ray anew
    q = np.cross(offset, b_a)
    scale = ray @ normal.T
    scale[np.abs(scale) < 1e-9] = np.inf
    u = ray @ np.cross(c_a, offset).T / scale
    v = ray @ q.T / scale
    along = (q * c_a).sum(axis=1) / scale
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0) & (along < 1)
    return np.asarray(met.any(axis=1), bool)


@lru_cache(maxsize=2)
def _spanned(mesh: Mesh) -> tuple[NDArray[np.float64], ...]:
    """Of each triangle [T, 3]: its first corner, the edges to the others, and their product. The
    cameras of a scene share them."""
    a, b, c = mesh.positions_mm[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    return a, b - a, c - a, np.cross(c - a, b - a)
