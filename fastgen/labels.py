"""Frame + Scene -> Objects: boxes, areas and visibility of everything labelled, vectorised."""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera import View
from fastgen.damage import mask_values
from fastgen.decal_tables import object_ids
from fastgen.mesh import Mesh
from fastgen.programs import CONTAINER_ID
from fastgen.sample import Box, Frame, Object
from fastgen.scene import Decal, Scene

_EDGE_POINTS = 16
"""Points along each side of a decal's outline, which follows the corrugation."""


def decal_of(scene: Scene, object_id: int) -> Decal:
    """The decal that bears `object_id` in the id target. Raises KeyError where none does."""
    ids = object_ids(scene)
    if object_id < 2 or object_id not in ids:
        raise KeyError(f"no decal has id {object_id} in scene {scene.index}")
    return scene.decals[ids.index(object_id)]


def label(frame: Frame, scene: Scene, view: View, mesh: Mesh) -> list[Object]:
    """All labelled objects of `scene` in one image, those of which nothing is visible included."""
    height, width = frame.ids.shape
    objects = [_container(frame, view, mesh), *_damages(frame, scene)]
    ids = np.array(object_ids(scene), np.int64)
    labelled = np.flatnonzero(ids)
    if not labelled.size:
        return objects
    boxes, areas = visible_boxes(frame.ids, int(ids.max()) + 1)
    pixels, depth = view.project(outlines_mm(scene, mesh))
    counts: dict[str, int] = {}
    for row, i in enumerate(labelled):
        decal, object_id = scene.decals[i], int(ids[i])
        counts[decal.class_name] = counts.get(decal.class_name, 0) + 1
        ahead = bool((depth[row] > 0).all())
        points = pixels[row]
        area = int(areas[object_id])
        low, high = points.min(axis=0), points.max(axis=0)
        whole = abs(cv2.contourArea(points.astype(np.float32))) if ahead else 0.0
        outside = not ahead or (low < 0).any() or high[0] > width or high[1] > height
        objects.append(
            Object(
                id=object_id,
                class_name=decal.class_name,
                instance=counts[decal.class_name],
                bbox=boxes[object_id],
                amodal_bbox=_floats(low, high) if ahead else None,
                area=area,
                visible_fraction=min(area / whole, 1.0) if whole > 0 else 0.0,
                truncated=bool(area) and bool(outside),
                text=decal.text,
                polygon=tuple(np.round(points, 2).ravel().tolist()) if ahead else (),
            )
        )
    return objects


def visible_boxes(
    ids: NDArray[np.uint16], count: int
) -> tuple[list[Box | None], NDArray[np.int64]]:
    """Tight boxes and areas of every id below `count` in one pass over the labelled pixels.

    ids: uint16 [H, W]. Returns a list of `count` boxes, None where an id is not seen, and int64
    [count] areas in pixels. Ids 0 and 1 (void and container) are left out: None and 0.
    """
    rows, columns = np.nonzero(ids > CONTAINER_ID)
    found = ids[rows, columns].astype(np.int64)
    areas = np.bincount(found, minlength=count)[:count]
    shape = ids.shape
    x0, y0 = np.full(count, shape[1]), np.full(count, shape[0])
    x1, y1 = np.zeros(count, np.int64), np.zeros(count, np.int64)
    np.minimum.at(x0, found, columns)
    np.minimum.at(y0, found, rows)
    np.maximum.at(x1, found, columns + 1)
    np.maximum.at(y1, found, rows + 1)
    boxes: list[Box | None] = [
        (int(x0[i]), int(y0[i]), int(x1[i]), int(y1[i])) if areas[i] else None for i in range(count)
    ]
    return boxes, areas


@lru_cache(maxsize=4)
def outlines_mm(scene: Scene, mesh: Mesh) -> NDArray[np.float64]:
    """Outlines [N, points, 3] of the labelled decals; the cameras of a scene share them."""
    return np.stack([outline_mm(decal, mesh) for decal in scene.decals if decal.class_name])


def outline_mm(decal: Decal, mesh: Mesh) -> NDArray[np.float64]:
    """World points [4 * _EDGE_POINTS, 3] in mm along a decal's edge on the sheet.

    A marker's edge is the diamond inscribed in its rectangle, other decals' the rectangle itself.
    """
    half = np.array(decal.size_mm) / 2
    if decal.kind == "marker":
        corners = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]) * half
    else:
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    steps = np.arange(_EDGE_POINTS)[:, None] / _EDGE_POINTS
    edge = np.concatenate(
        [a + steps * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    angle = np.deg2rad(decal.rotation_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    positions, _ = mesh.sheet_to_surface(decal.face, edge @ turn.T + np.array(decal.center_mm))
    return np.asarray(positions, np.float64)


def _damages(frame: Frame, scene: Scene) -> list[Object]:
    """Damages by their mask value, which is also their id; it marks the damage target, not the ids.

    What is hidden of a damage, or lies outside the image, is not known here: its amodal box is
    left open and its visible fraction says only whether anything is seen.
    """
    objects = []
    for damage, value in zip(scene.damages, mask_values(scene.damages), strict=True):
        mask = frame.damage == value
        bbox = _mask_box(mask)
        height, width = mask.shape
        at_border = bbox is not None and (0 in bbox[:2] or bbox[2] == width or bbox[3] == height)
        objects.append(
            Object(
                id=value,
                class_name=damage.kind,
                instance=value % 100,
                bbox=bbox,
                amodal_bbox=None,
                area=int(np.count_nonzero(mask)),
                visible_fraction=float(bbox is not None),
                truncated=at_border,
                text="",
                polygon=(),
            )
        )
    return objects


def _container(frame: Frame, view: View, mesh: Mesh) -> Object:
    """The container's box spans its decals too: what lies on it is part of it."""
    seen = frame.ids > 0
    low, high = mesh.bounds_mm
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    pixels, depth = view.project(low + corners * (high - low))
    ahead = bool((depth > 0).all())
    area = int(np.count_nonzero(seen))
    fraction, outside = 0.0, True
    amodal = None
    polygon: tuple[float, ...] = ()
    if ahead:
        hull = cv2.convexHull(pixels.astype(np.float32))
        whole = cv2.contourArea(hull)
        fraction = min(area / whole, 1.0) if whole > 0 else 0.0
        amodal = _floats(pixels.min(axis=0), pixels.max(axis=0))
        outside = amodal[0] < 0 or amodal[1] < 0
        outside |= amodal[2] > view.size[0] or amodal[3] > view.size[1]
        polygon = tuple(np.round(hull.reshape(-1), 2).astype(float).tolist())
    return Object(
        id=CONTAINER_ID,
        class_name="container",
        instance=1,
        bbox=_mask_box(seen),
        amodal_bbox=amodal,
        area=area,
        visible_fraction=fraction,
        truncated=bool(area) and outside,
        text="",
        polygon=polygon,
    )


def _mask_box(mask: NDArray[np.bool_]) -> Box | None:
    """Tight box of a mask [H, W], None where it is empty."""
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    if not rows.size:
        return None
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _floats(low: np.ndarray, high: np.ndarray) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = (round(float(v), 3) for v in (*low, *high))
    return x0, y0, x1, y1
