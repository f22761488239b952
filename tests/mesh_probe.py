"""Ray casts and measurements with which tests examine a Mesh from outside."""

from functools import lru_cache

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen.geometry.mesh import Mesh

ISO_668 = {
    "20": (6058, 2438, 2591, "22G1"),
    "40": (12192, 2438, 2591, "42G1"),
    "40HC": (12192, 2438, 2896, "45G1"),
    "45HC": (13716, 2438, 2896, "L5G1"),
}
OUT = {
    "front": (0, -1, 0), "back": (0, 1, 0), "door": (1, 0, 0), "no_door": (-1, 0, 0),
    "roof": (0, 0, 1), "underside": (0, 0, -1),
}  # fmt: skip
RIGHT = {
    "front": (1, 0, 0), "back": (-1, 0, 0), "door": (0, 1, 0), "no_door": (0, -1, 0),
    "roof": (1, 0, 0),
}  # fmt: skip
WALLS = ("front", "back", "no_door", "roof")


@lru_cache
def caster(mesh: Mesh) -> RayMeshIntersector:
    body = trimesh.Trimesh(mesh.positions_mm, mesh.triangles.astype(np.int64), process=False)
    return RayMeshIntersector(body)


def first_hits(mesh: Mesh, origins, directions):
    """Return the triangle (-1 for none) and the distance in mm of each ray's first hit."""
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    triangle = caster(mesh).intersects_first(origins, directions)
    corner = mesh.positions_mm[mesh.triangles[triangle, 0]].astype(np.float64)
    normal = winding_normals(mesh)[triangle]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.einsum("ij,ij->i", corner - origins, normal) / np.einsum(
            "ij,ij->i", directions, normal
        )
    return triangle, distance


def winding_normals(mesh: Mesh):
    a, b, c = mesh.positions_mm[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def chart_of(mesh: Mesh, triangles):
    return mesh.chart[mesh.triangles[triangles, 0]]


def triangles_of(mesh: Mesh, name: str):
    return np.flatnonzero(chart_of(mesh, slice(None)) == mesh.chart_index(name))


def depths(mesh: Mesh, face: str, points):
    """Cast rays straight into `face` through `points` [N, 3].

    Returns the triangles hit and their depth in mm behind the outer plane of the face.
    """
    out = np.array(OUT[face], float)
    plane = (mesh.positions_mm @ out).max()
    origins = points - (points @ out - plane - 100)[:, None] * out
    triangle, distance = first_hits(mesh, origins, np.tile(-out, (len(points), 1)))
    assert (triangle >= 0).all()
    return triangle, distance - 100


def around(rng, mesh: Mesh, count: int):
    """Return random points outside the bounding box, at distances from 1 mm to tens of metres."""
    low, high = mesh.positions_mm.min(axis=0), mesh.positions_mm.max(axis=0)
    reach = 10 ** rng.uniform(0, 4.3, (count, 1))
    points = rng.uniform(low - reach, high + reach)
    outside = ((points < low) | (points > high)).any(axis=1)
    return points[outside]


def behind_the_middle(container, points, toward):
    """Return whether rays from points [K, 3] in mm along `toward` [3] cross the container's core.

    The core is the bounding box shrunk by 350 mm on each side. This is a slab test.
    """
    low, high = np.array(container.bounds_mm) + [[350.0], [-350.0]]
    with np.errstate(divide="ignore"):
        ways = np.sort([(low - points) / toward, (high - points) / toward], axis=0)
    enters, leaves = ways[0].max(axis=1), ways[1].min(axis=1)
    return (enters > 0) & (leaves > enters)
