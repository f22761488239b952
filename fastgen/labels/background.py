"""Labels of the background containers, which only the panorama shows."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.camera.weather import BACKDROP_M
from fastgen.classes import BACKGROUND_ID
from fastgen.labels.visibility import Shot, mask_box, value_boxes, visibility, window
from fastgen.light.container_map import POINTS, ContainerMap
from fastgen.light.environment import to_map_frame
from fastgen.sample import Box, Object, Sample
from fastgen.scene.limits import MM

SMALL_PX = 16
"""A container with fewer visible pixels has no label of its own. Pixels of such containers that
touch one another form a group, which is one ignored object."""

_STEP_RAD = 0.02
_STEPS_PX = 2, 16
_BEND = 0.5
"""Rays are computed at nodes about _STEP_RAD apart and interpolated between them. Where the second
difference of three nodes is above _BEND texels, each pixel's ray is computed; elsewhere the error
is at most about an eighth of this."""


def background_objects(
    shot: Shot, containers: ContainerMap
) -> tuple[list[Object], NDArray[np.uint16]]:
    """Label the containers that the panorama shows in one image.

    Pixels with an object, a damage or a finite depth, which the ground has, hide the panorama.

    Args:
        shot: The image.
        containers: Container map of the scene's environment.

    Returns:
        The visible containers and groups, and the image uint16 [H, W] of their numbers, 0 for
        everything else. An object's id is its number plus BACKGROUND_ID. Numbers up to
        `containers.count` are those of the map; groups have larger ones, in no particular order.
    """
    frame = shot.frame
    shown = panorama_containers(shot.view, containers, shot.scene.environment.yaw_deg)
    inside = shown[1:-1, 1:-1]
    free = (frame.ids == 0) & (frame.damage == 0) & np.isinf(frame.depth)
    seen = inside * free
    box = mask_box(seen > 0)
    if box is None:
        return [], seen
    x0, y0, x1, y1 = box
    part = seen[y0:y1, x0:x1]
    _merge_small(part, containers.count)
    boxes, areas = value_boxes(part, 1, int(part.max()) + 1)
    whole = np.bincount(inside[inside > 0], minlength=len(boxes) + 1)
    beyond = _beyond(shot, containers, shown, areas, whole)
    in_fog = 0 < shot.scene.weather.visibility_mm < BACKDROP_M / MM
    objects = []
    for number, found in enumerate(boxes, start=1):
        if found is None:
            continue
        area = int(areas[number - 1])
        group = number > containers.count
        hidden = 0 if group else int(whole[number]) - area
        facts = visibility(shot.config, shot.view.size, area, hidden, beyond.get(number, 0))
        facts["ignored"] |= group or in_fog or shot.config.labels.background == "ignore"
        objects.append(
            Object(
                id=BACKGROUND_ID + number,
                class_name="container",
                instance=number,
                bbox=(found[0] + x0, found[1] + y0, found[2] + x0, found[3] + y0),
                amodal_bbox=None,
                area=area,
                container=-1,
                background=True,
                **facts,
            )
        )
    return objects, seen


def background_masks(sample: Sample) -> Iterator[tuple[Object, Box, NDArray[np.bool_]]]:
    """Yield each labelled container of the panorama with its visible pixels.

    Yields:
        The object, its box, and the mask bool [h, w] of its pixels in the box.
    """
    for thing in sample.objects:
        if thing.background and thing.bbox is not None and sample.background is not None:
            part = window(sample.background, thing.bbox) == thing.id - BACKGROUND_ID
            yield thing, thing.bbox, part


def panorama_containers(view: View, containers: ContainerMap, yaw_deg: float) -> NDArray[np.uint16]:
    """Return the number of the panorama's container along the ray of each pixel centre.

    Args:
        view: The camera.
        containers: The container map.
        yaw_deg: Rotation of the environment.

    Returns:
        uint16 [H + 2, W + 2]; the image with a border of one pixel around it.
    """
    width, height = view.size[0] + 2, view.size[1] + 2
    found = np.zeros((height, width), np.uint16)
    step = int(np.clip(round(_STEP_RAD * view.focal_px), *_STEPS_PX))
    # node k is at (k - 0.5) * step from the corner of the border, which is at (-1, -1)
    x, y = ((np.arange(-(-length // step) + 2) - 0.5) * step - 1 for length in (width, height))
    _, rays = view.rays(np.stack(np.meshgrid(x, y), axis=-1))
    column, row = containers.texels(rays, yaw_deg)
    reach = 2 * np.abs(np.diff(row, axis=0)).max() + 2 * np.abs(np.diff(row, axis=1)).max()
    near = (row > -reach) & (row < len(containers.rows) + reach)
    box = mask_box(near)
    if box is None:
        return found
    first, limit = max(box[1] - 1, 0), min(box[3] + 1, len(y))
    top, bottom = first * step, min((limit - 2) * step, height)
    if top >= bottom:  # only nodes below the image are near
        return found
    inner = slice(step, step + bottom - top), slice(step, step + width)
    middle, _ = containers.texels(view.rotation[2], yaw_deg)
    least = middle - containers.width / 2
    column = least + (column - least) % containers.width  # continues across the map's border
    columns, rows = (
        cv2.resize(nodes[first:limit].astype(np.float32), None, fx=step, fy=step)[inner]
        for nodes in (column, row)
    )
    bent = (_bent(column, row) & near)[first:limit]
    if bent.any():
        v, u = np.nonzero(np.repeat(np.repeat(bent, step, 0), step, 1)[inner])
        _, rays = view.rays(np.stack([u - 0.5, v + top - 0.5], axis=-1))
        columns[v, u], rows[v, u] = containers.texels(rays, yaw_deg)
    np.clip(rows, 0, len(containers.rows) - 1, out=rows)
    found[top:bottom] = cv2.remap(
        containers.rows, columns, rows, cv2.INTER_NEAREST, borderMode=cv2.BORDER_WRAP
    )
    return found


def _bent(column: NDArray[np.float64], row: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the nodes beside which interpolation is not accurate."""
    bent = np.zeros(column.shape, np.uint8)
    for nodes in (column, row):
        bent[1:-1] |= np.abs(np.diff(nodes, 2, axis=0)) > _BEND
        bent[:, 1:-1] |= np.abs(np.diff(nodes, 2, axis=1)) > _BEND
    return cv2.dilate(bent, np.ones((3, 3), np.uint8)).astype(bool)


def _merge_small(seen: NDArray[np.uint16], count: int) -> None:
    """Give groups of small containers numbers above `count`, in place."""
    small = np.bincount(seen.ravel(), minlength=count + 1) < SMALL_PX
    small[0] = False
    mask = small.take(seen)
    if not mask.any():
        return
    _, groups = cv2.connectedComponents(mask.view(np.uint8), connectivity=8, ltype=cv2.CV_16U)
    np.add(groups, np.uint16(count), out=seen, where=mask)


def _beyond(
    shot: Shot,
    containers: ContainerMap,
    shown: NDArray[np.uint16],
    areas: NDArray[np.int64],
    whole: NDArray[np.int64],
) -> dict[int, int]:
    """Return the pixels outside the image of each visible container that the image border cuts.

    Points on the container, inside and outside the image, give the ratio to the pixels inside.
    """
    border = np.concatenate([shown[0], shown[-1], shown[:, 0], shown[:, -1]])
    cut = np.flatnonzero(np.bincount(border, minlength=len(areas) + 1)[1 : len(areas) + 1]) + 1
    cut = cut[areas[cut - 1] > 0]
    if not len(cut):
        return {}
    view = shot.view
    ways = to_map_frame(containers.points[cut], -shot.scene.environment.yaw_deg)
    ahead = ways @ view.rotation[2] > 1e-3
    pixels, _ = view.project(view.position_m / MM + ways / MM)
    within = ahead & ((pixels >= 0) & (pixels < view.size)).all(axis=-1)
    share = np.maximum(within.mean(axis=1), 1 / POINTS)
    beyond = np.rint(whole[cut] * (1 - share) / share).astype(np.int64)
    return dict(zip(cut.tolist(), np.maximum(beyond, 1).tolist(), strict=True))
