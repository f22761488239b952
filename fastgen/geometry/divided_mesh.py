"""The same surface with smaller triangles, for images with lens distortion.

A lens bends only the corners of triangles; their edges stay straight.
"""

from dataclasses import replace

import numpy as np

from fastgen.geometry.mesh import Mesh

LENS_EDGE_MM = 400.0
"""Longest edge of a spreader that is drawn with lens distortion; containers have shorter edges.
With 100 pixels per metre and a radius of curvature of 600 pixels, as in a wide fisheye, the error
is a third of a pixel."""


def divided(mesh: Mesh, edge_mm: float) -> Mesh:
    """Divide a mesh until no edge is longer than edge_mm; zones and groups stay.

    Triangles are bisected at the middle of their longest edge (Rivara 1984, "Algorithms for
    refining triangular grids"). Neighbours cut a shared edge at the same point, so no gaps open.
    """
    values = np.concatenate(
        [mesh.positions_mm, mesh.normals, mesh.atlas_mm, mesh.zone[:, None]], axis=1
    ).astype(np.float64)
    corners = values[mesh.triangles]
    group = np.repeat(np.arange(len(mesh.groups)), [s.stop - s.start for s in mesh.groups.values()])
    done, done_group = [], []
    while len(corners):
        edges = np.roll(corners[..., :3], -1, axis=1) - corners[..., :3]
        length = np.linalg.norm(edges, axis=2)
        short = length.max(axis=1) <= edge_mm
        done.append(corners[short])
        done_group.append(group[short])
        corners, group, length = corners[~short], group[~short], length[~short]
        turn = (length.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners, turn[..., None], axis=1).transpose(1, 0, 2)
        middle = (a + b) / 2
        halves = [np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)]
        corners, group = np.concatenate(halves), np.tile(group, 2)
    group = np.concatenate(done_group)
    order = np.argsort(group, kind="stable")
    found = np.concatenate(done)[order].reshape(-1, values.shape[1])
    unique, triangles = np.unique(found.astype(np.float32), axis=0, return_inverse=True)
    ends = np.searchsorted(group[order], np.arange(len(mesh.groups) + 1))
    return replace(
        mesh,
        positions_mm=np.ascontiguousarray(unique[:, :3]),
        normals=np.ascontiguousarray(unique[:, 3:6]),
        atlas_mm=np.ascontiguousarray(unique[:, 6:8]),
        zone=np.rint(unique[:, 8]).astype(np.uint16),
        triangles=triangles.reshape(-1, 3).astype(np.uint32),
        groups={name: slice(int(ends[i]), int(ends[i + 1])) for i, name in enumerate(mesh.groups)},
    )
