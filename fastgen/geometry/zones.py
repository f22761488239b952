"""Zones of a chart: what wears by itself, for water knows edges and which way is down.

A chart may hold many sides of many beams, laid out as there was room. Rust and dirt sit along the
edges of each side, and run-off runs down it.
"""

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import Zone

Array = NDArray[np.float64]

_LEVEL = 0.8
"""Mean rise, of a slope of 53 degrees, below which a zone counts as level."""

_CREASE = 0.3
"""Cosine of the angle, 73 degrees, from which on a fold is an edge: that of a box, not of a bar of
eight sides."""

_ANY_FOLD = -1.1
"""Less than any cosine."""

_SMALL_MM = 100.0
"""What is narrower shares a zone with the rest of its chart that stands as it does: it is near an
edge all over, as rust reaches some 90 mm in."""

_POINTS_A_MM = 20.0
"""Corners on the sheet that are closer than the inverse of this are one."""


def zones_of(
    chart: int,
    sheet_mm: Array,
    heights_mm: Array,
    normals: Array,
    triangles: NDArray[np.int64],
    panel: bool = False,
) -> tuple[list[Zone], NDArray[np.int64]]:
    """The zones of chart number `chart`, widest first, and which of them each triangle is in, [T].

    sheet_mm: [V, 2], where vertices lie in the atlas. heights_mm: [V], their z in the world.
    normals: [V, 3]. triangles: [T, 3]. Triangles that share a vertex share a zone. panel: whether
    it is rolled from one sheet, which has no edge within, however sharp its waves are.
    """
    piece = _connected(sheet_mm, normals, triangles, _ANY_FOLD if panel else _CREASE)
    turns, level = (
        found[piece] for found in _quarter_turns(sheet_mm[triangles], heights_mm[triangles], piece)
    )
    low, high = _bounds(sheet_mm[triangles], piece)
    small = ((high - low).min(axis=1) < _SMALL_MM)[piece]
    _, first, piece = np.unique(
        np.where(small, -1 - turns - 4 * level, piece), return_index=True, return_inverse=True
    )
    low, high = _bounds(sheet_mm[triangles], piece)
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
    """Zone.quarter_turns [P] of pieces and whether they are level, by their mean rise: a corrugated
    roof goes down as often as up. corners: of triangles on the sheet, [T, 3, 2]. heights: [T, 3].
    piece: [T]."""
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
    sheet_mm: Array, normals: Array, triangles: NDArray[np.int64], crease: float
) -> NDArray[np.int64]:
    """Number of the piece of each triangle [T]: those that meet along an edge of the sheet, their
    normals' cosine greater than `crease`, are one."""
    from scipy.sparse import coo_array  # takes 0.3 s, and finished meshes are kept on disk
    from scipy.sparse.csgraph import connected_components

    places = np.rint(sheet_mm * _POINTS_A_MM).astype(np.int64)
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
    """Lowest and highest sheet coordinates [P, 2] of pieces with triangles of corners [T, 3, 2]."""
    low = np.full((piece.max() + 1, 2), np.inf)
    high = -low
    np.minimum.at(low, piece, corners.min(axis=1))
    np.maximum.at(high, piece, corners.max(axis=1))
    return low, high
