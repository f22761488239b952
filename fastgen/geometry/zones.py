"""Zones of a chart: parts with their own edges and their own direction of running water.

A chart may contain many sides of many beams, packed as space allowed. Rust and dirt collect along
the edges of each side, and water runs down each side.
"""

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import Zone

Array = NDArray[np.float64]

_LEVEL = 0.8
"""Mean rise below which a zone counts as level; the rise of a slope of 53 degrees."""

_CREASE = 0.3
"""Cosine of the smallest angle, 73 degrees, of folds that are edges. The folds of a box are edges,
those of a bar with eight sides are not."""

_ANY_FOLD = -1.1
"""A limit below every cosine, which joins triangles across all folds."""

_SMALL_MM = 100.0
"""Width below which all parts of a chart with one orientation share a zone. They are near an edge
everywhere, because rust reaches about 90 mm from edges."""

_POINTS_A_MM = 20.0
"""Grid cells per mm in which corners in the atlas count as one point."""


def zones_of(
    chart: int,
    atlas_mm: Array,
    heights_mm: Array,
    normals: Array,
    triangles: NDArray[np.int64],
    panel: bool = False,
) -> tuple[list[Zone], NDArray[np.int64]]:
    """Divide a chart into zones.

    Args:
        chart: Index of the chart.
        atlas_mm: float64 [V, 2], atlas coordinates of the vertices.
        heights_mm: float64 [V], z of the vertices in the container frame.
        normals: float64 [V, 3].
        triangles: int [T, 3]. Triangles that share a vertex share a zone.
        panel: True for a part rolled from one sheet, which has no inner edges even if its waves are
            sharp.

    Returns:
        The zones, largest first, and the number [T] of each triangle's zone.
    """
    piece = _connected(atlas_mm, normals, triangles, _ANY_FOLD if panel else _CREASE)
    turns, level = (
        found[piece] for found in _quarter_turns(atlas_mm[triangles], heights_mm[triangles], piece)
    )
    low, high = _bounds(atlas_mm[triangles], piece)
    small = ((high - low).min(axis=1) < _SMALL_MM)[piece]
    _, first, piece = np.unique(
        np.where(small, -1 - turns - 4 * level, piece), return_index=True, return_inverse=True
    )
    low, high = _bounds(atlas_mm[triangles], piece)
    order = np.argsort(-(high - low).prod(axis=1), kind="stable")
    rank = np.argsort(order)
    found = [
        Zone(
            chart,
            (*low[i].tolist(), *(high - low)[i].tolist()),
            int(turns[first[i]]),
            bool(small[first[i]]),
            bool(level[first[i]]),
        )
        for i in order
    ]
    return found, rank[piece]


def _quarter_turns(
    corners: Array, heights: Array, piece: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return Zone.quarter_turns [P] and Zone.level [P] of pieces, from their mean rise.

    The mean over a piece makes a corrugated roof level: it falls as often as it rises.

    Args:
        corners: Corners [T, 3, 2] of triangles in the atlas, in mm.
        heights: Heights [T, 3] of the corners.
        piece: Piece [T] of each triangle.
    """
    sides, rises = corners[:, 1:] - corners[:, :1], heights[:, 1:] - heights[:, :1]
    area = np.abs(np.linalg.det(sides))
    gradient = np.linalg.solve(sides, rises[..., None])[..., 0]
    along_x, along_y = (np.bincount(piece, area * part) for part in gradient.T)
    rise = np.hypot(along_x, along_y) / np.bincount(piece, area)
    turns = np.where(
        np.abs(along_y) >= np.abs(along_x),
        np.where(along_y >= 0, 0, 2),
        np.where(along_x >= 0, 1, 3),
    )
    level = rise < _LEVEL
    return np.where(level, 0, turns), level


def _connected(
    atlas_mm: Array, normals: Array, triangles: NDArray[np.int64], crease: float
) -> NDArray[np.int64]:
    """Return the piece [T] of each triangle.

    Triangles that share an edge in the atlas belong to one piece if the cosine of the angle between
    their normals is greater than `crease`.
    """
    from scipy.sparse import coo_array  # takes 0.3 s, and finished meshes are kept on disk
    from scipy.sparse.csgraph import connected_components

    places = np.rint(atlas_mm * _POINTS_A_MM).astype(np.int64)
    _, point = np.unique(places, axis=0, return_inverse=True)
    corners = point[triangles]
    ends = np.stack([corners, np.roll(corners, -1, axis=1)])
    code = (ends.min(axis=0) * (point.max() + 1) + ends.max(axis=0)).ravel()
    order = np.argsort(code, kind="stable")
    shared = np.flatnonzero(code[order][1:] == code[order][:-1])
    first, second = order[shared] // 3, order[shared + 1] // 3
    normal = normals[triangles[:, 0]]
    even = (normal[first] * normal[second]).sum(axis=1) > crease
    count = len(triangles)
    links = coo_array((even[even], (first[even], second[even])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], np.int64)


def _bounds(corners: Array, piece: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the lowest and highest atlas coordinates [P, 2] of pieces, from corners [T, 3, 2]."""
    low = np.full((piece.max() + 1, 2), np.inf)
    high = -low
    np.minimum.at(low, piece, corners.min(axis=1))
    np.maximum.at(high, piece, corners.max(axis=1))
    return low, high
