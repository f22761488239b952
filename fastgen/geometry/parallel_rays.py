"""Intersections of parallel rays with triangles and with a box."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

_PARTS = 16
"""Number of batches of rays, from left to right."""


def first_hits(start: Array, ray: Array, corners: Array) -> tuple[NDArray[np.intp], Array]:
    """Cast parallel rays at triangles that all face them.

    Args:
        start: Origins, [N, 3].
        ray: Direction, [3].
        corners: [T, 3, 3].

    Returns:
        Index of the first triangle that each ray hits, and its distance, inf without a hit.
    """
    # batches along x, because spreaders are long and few triangles share a range of x
    along = np.array([1.0, 0.0, 0.0]) - ray[0] * ray
    along /= np.linalg.norm(along)
    frame = np.stack([along, np.cross(ray, along), ray])
    at, seen = start @ frame.T, corners @ frame.T
    # the side of an edge and the distance to the plane are linear in the position of the origin;
    # corners are clockwise as the rays see them
    run, rise = (np.roll(seen, -1, axis=1) - seen)[..., :2].transpose(2, 0, 1)
    edges = np.stack([-rise, run, rise * seen[..., 0] - run * seen[..., 1]])
    across = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    slope = -across[:, :2] / across[:, 2:]
    planes = np.column_stack([slope, seen[:, 0, 2] - (slope * seen[:, 0, :2]).sum(axis=1)]).T
    edges, planes = edges.astype(np.float32), planes.astype(np.float32)
    low, high = seen[..., 0].min(axis=1), seen[..., 0].max(axis=1)
    first, away = np.zeros(len(at), np.intp), np.full(len(at), np.inf)
    for part in np.array_split(np.argsort(at[:, 0]), _PARTS):
        if not len(part):
            continue
        left, right = at[part[[0, -1]], 0]
        near = np.flatnonzero((low <= right) & (high >= left))
        if not len(near):
            continue
        places = np.column_stack([at[part, :2], np.ones(len(part))]).astype(np.float32)
        outside = places @ edges[:, near, 0]
        for k in (1, 2):
            np.maximum(outside, places @ edges[:, near, k], out=outside)
        far = places @ planes[:, near] - at[part, 2:].astype(np.float32)
        far[(outside > 0) | (far <= 0)] = np.inf
        least = far.argmin(axis=1)
        first[part], away[part] = near[least], far[np.arange(len(part)), least]
    return first, away


def entered(start: Array, ray: Array, box: Array) -> tuple[NDArray[np.intp], Array]:
    """Intersect parallel rays with a box.

    Args:
        start: Origins [N, 3], outside the box.
        ray: Direction, [3].
        box: Lowest and highest coordinates, [2, 3].

    Returns:
        Side through which each ray enters, 2 k for the lower side of axis k and 2 k + 1 for the
        upper, and the distance, inf if the ray misses.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = np.sort((box[:, None] - start) / ray, axis=0)
    axis = near.argmax(axis=1)
    entry = near.max(axis=1)
    hit = (entry > 0) & (entry < far.min(axis=1))
    return 2 * axis + (ray[axis] < 0), np.where(hit, entry, np.inf)
