"""Labels of one image: boxes, areas and visibility of all labelled objects."""

from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.classes import ALL_DAMAGE_CLASSES, SPREADER_ID
from fastgen.geometry.decal_facets import DecalSurface
from fastgen.geometry.decal_outlines import EDGE_POINTS
from fastgen.geometry.facets import Facets
from fastgen.geometry.prepared_scene import CORNER_SIGNS
from fastgen.geometry.ray_triangles import RayTriangles
from fastgen.labels.coverage import boxes, covered, facing, pixels_beyond, project
from fastgen.labels.damage import damage_objects
from fastgen.labels.seals import seal_objects
from fastgen.labels.visibility import (
    Shot,
    float_boxes,
    mask_box,
    too_little,
    visibility,
    within_visibility,
)
from fastgen.sample import Keypoint, LabelledPart, Object
from fastgen.scene import Decal, Scene
from fastgen.scene.limits import MM, NEAR_M
from fastgen.scene.object_ids import scene_numbers

_PIECES = 12
"""Pieces along each edge of the container's outer box in images with lens distortion."""

CASTINGS = tuple(
    f"{end}_{side}_{level}"
    for end in ("no_door", "door")
    for side in ("front", "back")
    for level in ("bottom", "top")
)
"""Names of a container's keypoints, the outer corners of its eight corner castings, in the order of
CORNER_SIGNS."""

_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Sides of the outer box as indices into CORNER_SIGNS, counter-clockwise from outside."""


def labelled_decals(scene: Scene) -> dict[int, Decal]:
    """Return the labelled decals of all containers by their ids."""
    carried = [scene.decals, *(each.decals for each in scene.neighbours)]
    return {
        number: decal
        for decals, numbers in zip(carried, scene_numbers(scene), strict=True)
        for decal, number in zip(decals, numbers.decals, strict=True)
        if number
    }


def label(shot: Shot) -> list[Object]:
    """Return all labelled objects of one image, including those that are not visible.

    A scene without a container has none. The objects of the first container come first, then those
    of its neighbours; instances of a class count up over all containers.
    """
    if not shot.scene.container.present:
        return []
    if not shot.scene.neighbours:
        return _ignore_hidden_by_fog(shot, _label(shot))
    found: list[Object] = []
    for member in shot.prepared.members:
        before = Counter(item.class_name for item in found)
        found += [
            replace(
                item,
                container=member.number,
                # instances of damages count up over the scene already
                instance=item.instance
                + before[item.class_name] * (item.class_name not in ALL_DAMAGE_CLASSES),
            )
            for item in _label(shot.of_member(member))
        ]
    return _ignore_hidden_by_fog(shot, found)


def _ignore_hidden_by_fog(shot: Shot, objects: list[Object]) -> list[Object]:
    """Mark objects as ignored that have too few pixels within the visibility in fog.

    All other pixels count as hidden.
    """
    if not shot.scene.weather.visibility_mm:
        return objects
    frame, size = shot.frame, shot.view.size
    near = within_visibility(frame.depth, shot.view, shot.scene)
    ids, damages = (np.bincount(each[near], minlength=65536) for each in (frame.ids, frame.damage))

    def hidden(item: Object) -> bool:
        if item.class_name in ALL_DAMAGE_CLASSES:
            left = damages[item.id]
        elif item.class_name == "container":
            numbers = shot.prepared.members[item.container].prepared.numbers
            left = damages[[numbers.undamaged, *numbers.damages]].sum()
        else:
            left = ids[item.id]
        return too_little(shot.config, size, int(left), item.area / item.visible_fraction)

    return [
        replace(item, ignored=True) if not item.ignored and hidden(item) else item
        for item in objects
    ]


def _label(shot: Shot) -> list[Object]:
    return [
        _container(shot),
        *_spreader(shot),
        *damage_objects(shot),
        *_decals(shot),
        *seal_objects(shot),
    ]


def _decals(shot: Shot) -> list[Object]:
    frame, scene, view = shot.frame, shot.scene, shot.view
    surface = shot.prepared.decals
    if not surface.decals:
        return []
    ids = np.array(shot.prepared.numbers.decals, np.int64)
    labelled = np.flatnonzero(ids)
    count, own = len(labelled), ids[labelled]
    least = int(own.min())
    seen_boxes, areas = shot.boxes_on_container(frame.ids, least, int(own.max()) + 1)
    seen = project(surface.facets, view)
    bounds = float_boxes(boxes(seen.pixels, seen.facets.owner, count))
    # only visible decals need their unoccluded area
    owner = seen.facets.owner.take(seen.facets.corners[:, 0])
    visible = np.flatnonzero((areas[own - least] > 0)[owner])
    polygons = seen.pixels.take(seen.facets.corners.take(visible, axis=0), axis=0)
    alone = covered(polygons, owner[visible], count, view.size)
    pixel, whose = alone.pixels()
    lost = whose[frame.ids.ravel().take(pixel) != own.take(whose)]
    hidden = np.bincount(lost, minlength=count).tolist()
    pixels, depth = view.project(surface.outlines_mm)
    before = np.asarray((depth > 0).all(axis=1))
    edges = np.round(pixels, 2)
    outlines = edges.reshape(count, -1).tolist()
    corners, _ = view.project(surface.corners_mm)
    quads = np.round(corners, 2).reshape(count, -1).tolist()
    parts = _parts(surface, view)
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
                parts=tuple(parts.get(row, ())) if before[row] else (),
                **visibility(
                    shot.config, shot.view.size, area, hidden[row], int(alone.beyond[row])
                ),
            )
        )
    return objects


def _parts(surface: DecalSurface, view: View) -> dict[int, list[LabelledPart]]:
    """Return the labelled parts of texts by index of their decal."""
    found: dict[int, list[LabelledPart]] = {}
    if surface.parts:
        pixels, _ = view.project(surface.part_corners_mm)
        quads = np.round(pixels, 2).reshape(-1, 8).tolist()
        for (row, box), quad in zip(surface.parts, quads, strict=True):
            found.setdefault(row, []).append(LabelledPart(box.role, box.text, tuple(quad)))
    return found


def _container(shot: Shot) -> Object:
    """Return the container, whose pixels include those of its decals.

    Its outer box replaces it where something hides it and outside the image. The box is a few
    millimetres larger than rails and sheets, which makes the visible fraction accurate to one
    percent.
    """
    frame, view, prepared = shot.frame, shot.view, shot.prepared
    area = cv2.countNonZero(frame.damage)
    corners = prepared.corners_mm
    points = prepared.rim_points_mm if shot.lens else prepared.hull_points_mm
    pixels, depth = view.project(points)
    passes_camera = depth.min() < NEAR_M
    if passes_camera:
        pixels = pixels_beyond(prepared.facets, view)
    (bounds,) = boxes(pixels, np.zeros(len(pixels), np.int64), 1)
    hidden = beyond = 0
    if area:  # otherwise its fraction is 0
        hidden, beyond = _unseen(shot, corners, passes_camera)
    castings, polygon = _castings(shot, corners)
    (amodal_bbox,) = float_boxes(bounds[None])
    facts = visibility(shot.config, shot.view.size, area, hidden, beyond)
    if area and ((bounds[:2] < 0).any() or (bounds[2:] > view.size).any()):
        facts["truncated"] = True  # damage bulges out of the box
    return Object(
        id=prepared.numbers.container,
        class_name="container",
        instance=1,
        bbox=shot.container_box,
        amodal_bbox=amodal_bbox,
        area=area,
        polygon=polygon,
        keypoints=castings,
        **facts,
    )


def _unseen(shot: Shot, corners: NDArray[np.float64], passes_camera: bool) -> tuple[int, int]:
    """Count the pixels of the container's box that are hidden, and that are outside the image.

    Args:
        shot: The image.
        corners: Corners [8, 3] of the box.
        passes_camera: A part of the container is before the near plane.
    """
    sides = corners[list(_SIDES)]
    if shot.lens:
        sides = _pieces(sides)
    polygons = project(Facets.of(sides, np.zeros(len(sides), np.int64)), shot.view).polygons
    if not passes_camera:  # otherwise the near plane opens the box, and its inner sides are seen
        polygons = polygons[facing(polygons)]
    # void pixels within the box are not hidden; only the spreader and other containers hide any
    hiding_box = None if shot.hiding is None else mask_box(shot.hiding)
    owner = np.zeros(len(polygons), np.int64)
    alone = covered(polygons, owner, 1, shot.view.size, hiding_box or (0, 0, 0, 0))
    hidden = 0 if shot.hiding is None or hiding_box is None else int(alone.shown(shot.hiding)[0])
    return hidden, int(alone.beyond[0])


def _spreader(shot: Shot) -> list[Object]:
    """Return the spreader with its headblock and the modelled part of the cables, if present."""
    shape = shot.prepared.spreader
    if shape is None:
        return []
    area = cv2.countNonZero(shot.spreader_shown.view(np.uint8))
    seen = project(shape.facets(shot.lens), shot.view)
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
            **visibility(shot.config, shot.view.size, area, hidden, int(alone.beyond[0])),
        )
    ]


def _pieces(sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cut quadrilaterals [K, 4, 3] into a grid of smaller ones [K * n * n, 4, 3], same winding."""
    across, up = np.meshgrid(*[np.linspace(0, 1, _PIECES + 1)] * 2, indexing="ij")
    weights = np.stack([(1 - across) * (1 - up), across * (1 - up), across * up, (1 - across) * up])
    grid = np.einsum("wxy,kwc->kxyc", weights, sides)
    corners = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
    return np.stack(corners, axis=3).reshape(-1, 4, 3)


def _castings(
    shot: Shot, corners: NDArray[np.float64]
) -> tuple[tuple[Keypoint, ...], tuple[float, ...]]:
    """Return the castings' outer corners as keypoints, and the polygon around them.

    A corner of a convex body is visible if any of the planes that meet in it faces the camera and
    neither the spreader nor the outer box of another container hides it.
    """
    spreader, eye_mm = shot.prepared.spreader, shot.view.position_m / MM
    pixels, depth = shot.view.project(corners)
    outward = np.where(CORNER_SIGNS == 0, -1, CORNER_SIGNS)
    faces = np.any((eye_mm - corners) * outward > 0, axis=1)
    inside = (depth > 0) & ((pixels >= 0) & (pixels < shot.view.size)).all(axis=1)
    blocking = [] if spreader is None else [spreader.ray_triangles]
    blocking += [] if shot.blocking is None else [RayTriangles(shot.blocking)]
    for each in blocking:
        candidates = np.flatnonzero(faces & inside)
        faces[candidates] = ~each.hide(eye_mm, corners[candidates])
    found: list[Keypoint] = [
        (round(x, 3), round(y, 3), 2 if face else 1) if within else (0.0, 0.0, 0)
        for (x, y), face, within in zip(
            pixels.tolist(), faces.tolist(), inside.tolist(), strict=True
        )
    ]
    if depth.min() <= 0:
        return tuple(found), ()
    straight = pixels
    if shot.lens:
        straight, _ = replace(shot.view, distortion=None).project(corners)
    hull = cv2.convexHull(straight.astype(np.float32), returnPoints=False).ravel()
    outline = pixels[hull]
    if shot.lens:  # straight edges are curves in the image
        along = np.arange(EDGE_POINTS)[:, None] / EDGE_POINTS
        lines = zip(corners[hull], corners[np.roll(hull, -1)], strict=True)
        outline, _ = shot.view.project(np.concatenate([a + along * (b - a) for a, b in lines]))
    return tuple(found), tuple(np.round(outline.reshape(-1), 2).tolist())
