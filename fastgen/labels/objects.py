"""Frame + Scene -> Objects: boxes, areas and visibility of everything labelled, vectorised."""

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import CONTAINER_ID, SPREADER_ID
from fastgen.geometry.damage_law import deform
from fastgen.geometry.decal_facets import decal_facets, decal_outlines
from fastgen.geometry.decal_outlines import EDGE_POINTS
from fastgen.geometry.divided_mesh import as_drawn
from fastgen.geometry.facets import Facets, in_fours, mesh_facets
from fastgen.geometry.mesh import Mesh
from fastgen.labels.coverage import boxes, covered, facing, project
from fastgen.labels.damage import damage_objects
from fastgen.labels.visibility import Shot, float_boxes, visibility
from fastgen.sample import Keypoint, Object
from fastgen.scene import Decal, Scene
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.limits import MM, NEAR_M
from fastgen.scene.object_ids import object_ids

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
    count, own = len(labelled), ids[labelled]
    least = CONTAINER_ID + 1
    seen_boxes, areas = shot.boxes_on_container(frame.ids, least, int(own.max()) + 1)
    seen = project(decal_facets(scene, mesh), view)
    bounds = float_boxes(boxes(seen.pixels, seen.facets.owner, count))
    # of what is not seen, what it would cover does not matter
    owner = seen.facets.owner.take(seen.facets.corners[:, 0])
    asked = np.flatnonzero((areas[own - least] > 0)[owner])
    polygons = seen.pixels.take(seen.facets.corners.take(asked, axis=0), axis=0)
    alone = covered(polygons, owner[asked], count, view.size)
    pixel, whose = alone.pixels()
    lost = whose[frame.ids.ravel().take(pixel) != own.take(whose)]
    hidden = np.bincount(lost, minlength=count).tolist()
    pixels, depth = view.project(outlines_mm(scene, mesh))
    before = np.asarray((depth > 0).all(axis=1))
    edges = np.round(pixels, 2)
    outlines = edges.reshape(count, -1).tolist()
    # from the outline's corners in the order in which the eye finds them
    quads = edges[:, ::EDGE_POINTS][:, ::-1].reshape(count, -1).tolist()
    counts: dict[str, int] = {}
    objects = []
    for row, i in enumerate(labelled.tolist()):
        decal, object_id = scene.decals[i], int(ids[i])
        counts[decal.class_name] = counts.get(decal.class_name, 0) + 1
        area = int(areas[object_id - least])
        objects.append(
            Object(
                id=object_id,
                class_name=decal.class_name,
                instance=counts[decal.class_name],
                bbox=seen_boxes[object_id - least],
                amodal_bbox=bounds[row],
                area=area,
                text=decal.text,
                polygon=tuple(outlines[row]) if before[row] else (),
                quad=tuple(quads[row]) if before[row] else (),
                reading=("vertical" if decal.vertical else "horizontal") if decal.text else "",
                **visibility(shot.config, area, hidden[row], int(alone.beyond[row])),
            )
        )
    return objects


@lru_cache(maxsize=4)
def outlines_mm(scene: Scene, mesh: Mesh) -> NDArray[np.float64]:
    """Outlines [N, points, 3] of the labelled decals after damage; a scene's cameras share them."""
    return decal_outlines(scene, mesh)


def _container(shot: Shot) -> Object:
    """The container's pixels are also those of its decals: what lies on it is part of it.

    Where the spreader hides it, or the image ends, its outer box stands for it, a few millimetres
    larger than rails and sheets: its visible fraction is true to one percent of the whole.
    """
    frame, view = shot.frame, shot.view
    area = cv2.countNonZero(frame.damage)
    corners = _corners_mm(shot.scene)
    points = _container_points(shot.scene, shot.mesh, view.distortion is not None)
    pixels, depth = view.project(points)
    if depth.min() < NEAR_M:
        pixels = project(mesh_facets(shot.mesh, shot.scene.damages), view).pixels
    (bounds,) = boxes(pixels, np.zeros(len(pixels), np.int64), 1)
    sides = corners[list(_SIDES)]
    if view.distortion:
        sides = _pieces(sides)
    polygons = project(Facets.of(sides, np.zeros(len(sides), np.int64)), view).polygons
    # what is void within the box is known: nothing hides there
    asked = shot.spreader_box or (0, 0, 0, 0)
    alone = covered(polygons, np.zeros(len(polygons), np.int64), 1, view.size, asked)
    hidden = int(alone.shown(shot.spreader_shown)[0]) if shot.spreader_box else 0
    castings, polygon = _castings(shot, corners)
    (amodal_bbox,) = float_boxes(bounds[None])
    told = visibility(shot.config, area, hidden, int(alone.beyond[0]))
    if area and ((bounds[:2] < 0).any() or (bounds[2:] > view.size).any()):
        told["truncated"] = True  # damage bulges out of the box
    return Object(
        id=CONTAINER_ID,
        class_name="container",
        instance=1,
        bbox=shot.container_box,
        amodal_bbox=amodal_bbox,
        area=area,
        polygon=polygon,
        keypoints=castings,
        **told,
    )


def _spreader(shot: Shot) -> list[Object]:
    """The spreader with its headblock and the cables as far as they are modelled."""
    if shot.spreader is None:
        return []
    area = cv2.countNonZero(shot.spreader_shown.view(np.uint8))
    mesh = as_drawn(shot.spreader, shot.view.distortion is not None)
    seen = project(_all_facets(mesh), shot.view)
    bounds = float_boxes(boxes(seen.pixels, seen.facets.owner, 1))
    polygons = seen.polygons
    polygons = polygons[facing(polygons)]
    alone = covered(polygons, np.zeros(len(polygons), np.int64), 1, shot.view.size)
    hidden = int(alone.area[0] - alone.shown(shot.spreader_shown)[0])
    return [
        Object(
            id=SPREADER_ID,
            class_name="spreader",
            instance=1,
            bbox=shot.spreader_box,
            amodal_bbox=bounds[0],
            area=area,
            **visibility(shot.config, area, hidden, int(alone.beyond[0])),
        )
    ]


@lru_cache(maxsize=32)
def _all_facets(mesh: Mesh) -> Facets:
    """Of a mesh that nothing damages."""
    return in_fours(mesh_facets(mesh))


@lru_cache(maxsize=4)
def _container_points(scene: Scene, mesh: Mesh, bent: bool) -> NDArray[np.float64]:
    """Points [P, 3] in mm after damage: from any side the container's outermost are among them.

    bent: whether a lens bends what is seen, so that others than corners of the hull may be.
    """
    if not scene.damages:
        return mesh.points_mm if bent else mesh.points_mm[mesh.hull]
    moved = deform(scene.damages, mesh.points_mm)
    if bent:
        return moved
    # a box that no corner has been pushed into: all in it lies within their convex hull
    corners = _corners_mm(scene)
    least = np.where(_SIGNS > 0, -np.inf, corners).max(axis=0)
    most = np.where(_SIGNS > 0, corners, np.inf).min(axis=0)
    inner = [(along > a) & (along < b) for along, a, b in zip(moved.T, least, most, strict=True)]
    return moved.compress(~np.logical_and.reduce(inner), axis=0)


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
        asked = np.flatnonzero(faces & inside)
        faces[asked] = ~_behind(shot.spreader, shot.view.position_m / MM, corners[asked])
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
        along = np.arange(EDGE_POINTS)[:, None] / EDGE_POINTS
        lines = zip(corners[hull], corners[np.roll(hull, -1)], strict=True)
        outline, _ = shot.view.project(np.concatenate([a + along * (b - a) for a, b in lines]))
    return tuple(found), tuple(np.round(outline.reshape(-1), 2).tolist())


def _behind(
    mesh: Mesh, eye_mm: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which of points [N, 3] the mesh hides from the eye, bool [N]; Moeller and Trumbore 1997."""
    a, b_a, c_a, normal = _spanned(mesh)
    ray, offset = points - eye_mm, eye_mm[:, None] - a
    # their triple products, turned so that nothing is crossed for each ray anew
    q = _cross(offset, b_a)
    scale = ray @ normal
    scale[np.abs(scale) < 1e-9] = np.inf
    u = ray @ _cross(c_a, offset) / scale
    v = ray @ q / scale
    along = (q * c_a).sum(axis=0) / scale
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0) & (along < 1)
    return np.asarray(met.any(axis=1), bool)


@lru_cache(maxsize=32)
def _spanned(mesh: Mesh) -> tuple[NDArray[np.float64], ...]:
    """Of each triangle [3, T]: its first corner, the edges to the others, and their product."""
    corners = mesh.positions_mm.take(mesh.triangles, axis=0).astype(np.float64)
    a, b, c = np.ascontiguousarray(corners.transpose(1, 2, 0))
    return a, b - a, c - a, _cross(c - a, b - a)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cross products of vectors [3, T]; NumPy's own takes five times as long."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
