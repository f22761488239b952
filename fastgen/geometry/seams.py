"""Seams between parts: both parts get the same vertices, so that rasterizers leave no gap.

At a T-junction a vertex of one part lies within an edge of its neighbour. Rounding opens a crack
there that a few pixel centres fall into. Such edges are split at the vertex.
"""

from collections import defaultdict
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.distinct_rows import distinct_rows

Array = NDArray[np.float64]

_SAME_MM = 0.02
_SHIFT_MM = 0.0073
"""Offset of the grid of cells; no coordinate in use lies on the border of a cell."""

_ON_EDGE_MM = 0.05
"""Largest distance from an edge of a vertex that splits it, and least distance from its ends."""


def merged(positions_mm: Array) -> tuple[Array, NDArray[np.int64]]:
    """Make positions [V, 3] that coincide equal; also return the number int [V] of each point."""
    cells = np.floor((positions_mm + _SHIFT_MM) / _SAME_MM + 0.5).astype(np.int64)
    first, point = distinct_rows(cells)
    return positions_mm[first][point], point


def junctions(
    positions_mm: Array, point: NDArray[np.int64], triangles: NDArray[np.int64]
) -> dict[tuple[int, int], list[int]]:
    """Find vertices within edges that have a triangle on one side only.

    Args:
        positions_mm: float64 [V, 3].
        point: int [V], equal for vertices that coincide.
        triangles: int [T, 3].

    Returns:
        Vertices in order along the edge, by (triangle, edge). Edge 0 leads from the first to the
        second corner, and so on.
    """
    from scipy.spatial import cKDTree  # takes 0.3 s, and finished meshes are kept on disk

    corners = point[triangles]
    edges = np.concatenate([corners, np.roll(corners, -1, axis=1)]).reshape(2, -1).T
    places = np.arange(edges.shape[0])
    code = edges.min(axis=1) * (point.max() + 1) + edges.max(axis=1)
    _, which, uses = np.unique(code, return_inverse=True, return_counts=True)
    loose = places[uses[which] == 1]
    if not loose.size:
        return {}
    vertex_of = np.zeros(point.max() + 1, np.int64)
    vertex_of[point] = np.arange(len(point))
    starts, ends = (positions_mm[vertex_of[edges[loose, side]]] for side in (0, 1))
    length = np.linalg.norm(ends - starts, axis=1)
    candidates = vertex_of[np.unique(edges[loose])]
    found = cKDTree(positions_mm[candidates]).query_ball_point((starts + ends) / 2, length / 2)
    count = np.array([len(near) for near in found])
    edge = np.repeat(np.arange(len(loose)), count)
    vertex = candidates[np.concatenate(found).astype(np.int64)]
    along = (ends - starts)[edge] / length[edge, None]
    offset = positions_mm[vertex] - starts[edge]
    distance = (offset * along).sum(axis=1)
    aside = np.linalg.norm(offset - distance[:, None] * along, axis=1)
    within = (distance > _ON_EDGE_MM) & (distance < length[edge] - _ON_EDGE_MM)
    on = np.flatnonzero((aside < _ON_EDGE_MM) & within)
    on = on[np.lexsort((distance[on], edge[on]))]
    result: dict[tuple[int, int], list[int]] = defaultdict(list)
    for i in on.tolist():
        triangle, side = divmod(int(loose[edge[i]]), 3)
        result[triangle, side].append(int(vertex[i]))
    return result


def stitched(
    positions_mm: Array, values: Array, triangles: NDArray[np.int64]
) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """Split edges at T-junctions.

    Args:
        positions_mm: float64 [V, 3].
        values: float64 [V, C], other values of the vertices, linear on each triangle.
        triangles: int [T, 3].

    Returns:
        Positions and values with new vertices at the end, triangles, and for each triangle the
        index of the triangle that it was cut from.
    """
    positions_mm, point = merged(positions_mm)
    found = junctions(positions_mm, point, triangles)
    more_positions: list[Array] = []
    more_values: list[Array] = []

    def cut(corners: list[int], inner: list[list[int]]) -> list[list[int]]:
        """Split a triangle whose edge k contains the vertices inner[k]."""
        side = next((k for k in range(3) if inner[k]), None)
        if side is None:
            return [corners]
        a, b, c = corners[side:] + corners[:side]
        _, after, before = inner[side:] + inner[:side]
        chain = [a, *(added(a, b, vertex) for vertex in inner[side]), b]
        parts: list[list[int]] = []
        for i, (start, end) in enumerate(pairwise(chain)):
            rest = [[], after if i == len(chain) - 2 else [], before if i == 0 else []]
            parts += cut([start, end, c], rest)
        return parts

    def added(a: int, b: int, vertex: int) -> int:
        position = positions_mm[vertex]
        span = np.linalg.norm(positions_mm[b] - positions_mm[a])
        share = np.linalg.norm(position - positions_mm[a]) / span
        more_positions.append(position)
        more_values.append(values[a] + share * (values[b] - values[a]))
        return len(positions_mm) + len(more_positions) - 1

    broken = sorted({triangle for triangle, _ in found})
    pieces, owner = [], []
    for triangle in broken:
        inner = [found.get((triangle, side), []) for side in range(3)]
        parts = cut(triangles[triangle].tolist(), inner)
        pieces += parts
        owner += [triangle] * len(parts)
    if not pieces:
        return positions_mm, values, triangles, np.arange(len(triangles))
    kept = np.setdiff1d(np.arange(len(triangles)), broken)
    return (
        np.concatenate([positions_mm, more_positions]),
        np.concatenate([values, more_values]),
        np.concatenate([triangles[kept], pieces]),
        np.concatenate([kept, owner]),
    )
