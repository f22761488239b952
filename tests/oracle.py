"""Reference results from a slow, simple method: Embree rays through pixel centres, and numpy."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen.camera.projection import View
from fastgen.geometry import damage_law
from fastgen.geometry.door_gear import is_gear
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.seals import scene_seals
from fastgen.geometry.spreader import build_spreader
from fastgen.scene import Damage, Decal, Scene

_MOST_LAYERS = 12

SPREADER = 60000
"""Id of the spreader's pixels."""

SEAL = 60001
"""Id of a seal at the first hasp."""

CATEGORIES = {
    **{"axis": 2, "concave": 3, "dented": 4, "perforation": 5, "scrape": 6},
    **{"rust_through": 7, "missing_paint": 8, "graffiti": 9, "door_gear": 10},
    "buckle": 11,  # of the package in docs/extend.md
}
"""COCO category of each kind of damage; values of damage targets are category * 100 + instance."""


@dataclass
class Hits:
    """Surface seen by the ray through each pixel centre.

    Attributes:
        triangle: int [H, W], -1 where the ray hits nothing.
        hole: int [H, W], index of the first perforation that the ray passes through, or -1.
        rest_mm: [H, W, 3], position before damage.
        atlas_mm: [H, W, 2], atlas coordinates.
        depth_m: [H, W], depth along the view axis, inf where the ray hits nothing.
        spreader: bool [H, W], where the spreader is nearest; triangle and hole are -1 there.
    """

    triangle: np.ndarray
    hole: np.ndarray
    rest_mm: np.ndarray
    atlas_mm: np.ndarray
    depth_m: np.ndarray
    spreader: np.ndarray

    @property
    def hit(self) -> np.ndarray:
        return self.triangle >= 0


@lru_cache(4)  # tests look at one container through several cameras
def body_of(mesh: Mesh, damages: tuple[Damage, ...]) -> tuple[np.ndarray, RayMeshIntersector]:
    """Return the vertices [V, 3] of a damaged mesh in mm, and its ray caster in metres."""
    moved = damage_law.deform(damages, mesh.positions_mm.astype(np.float64))
    # Embree computes in float32, so it gets metres around the origin
    body = RayMeshIntersector(trimesh.Trimesh(moved * 1e-3, mesh.triangles, process=False))
    return moved, body


def cast(
    mesh: Mesh, view: View, scene: Scene | None = None, pixels: np.ndarray | None = None
) -> Hits:
    """Return what each pixel centre sees: the first outer face or, through a hole, inner face.

    Args:
        mesh: The container's mesh. `scene` adds its damages and its spreader.
        pixels: Image positions [..., 2] to look through instead of the pixel centres.
    """
    damages = scene.damages if scene else ()
    rest = mesh.positions_mm.astype(np.float64)
    tears = ~np.array([is_gear(chart) for chart in mesh.charts])[mesh.chart[mesh.triangles[:, 0]]]
    moved, body = body_of(mesh, damages)
    start, rays = view.rays(pixels)
    shape = rays.shape[:-1]
    rays = rays.reshape(-1, 3)
    count = len(rays)
    seen = np.full(count, -1)
    hole = np.full(count, -1)
    where = np.zeros((count, 3))
    atlas = np.zeros((count, 2))
    depth = np.full(count, np.inf)
    travelled = np.zeros(count)
    active = np.arange(count)
    for _ in range(_MOST_LAYERS):
        ray = rays[active]
        origins = (start + (travelled[active, None] + 0.02) * ray) * 1e-3
        triangle = body.intersects_first(origins, ray)
        active, ray, triangle = (a[triangle >= 0] for a in (active, ray, triangle))
        if not active.size:
            break
        distance, b, c, facing = _meet(moved[mesh.triangles[triangle]], start, ray)
        corners = rest[mesh.triangles[triangle]]
        point = _between(corners, b, c)
        travelled[active] = np.maximum(distance, travelled[active] + 0.02)
        torn = np.full(len(active), -1)
        for i, damage in enumerate(damages):
            torn[damage_law.in_hole(damage, point) & tears[triangle]] = i
        inside = hole[active] >= 0
        # outer faces stop a ray from outside, inner faces one that entered through a hole
        wall = facing != inside
        opened = wall & ~inside & (torn >= 0)
        hole[active[opened]] = torn[opened]
        ends = wall & (torn < 0)
        at = active[ends]
        seen[at] = triangle[ends]
        where[at] = point[ends]
        atlas_corners = mesh.atlas_mm[mesh.triangles[triangle[ends]]].astype(np.float64)
        atlas[at] = _between(atlas_corners, b[ends], c[ends])
        depth[at] = view.to_view(start + distance[ends, None] * ray[ends])[:, 2]
        active = active[~ends]
    before = np.zeros(count, bool)
    if scene and scene.spreader.present:
        nearer = _spreader_depth(scene, view, start, rays)
        before = nearer < depth
        depth[before], seen[before], hole[before] = nearer[before], -1, -1
    return Hits(
        seen.reshape(shape),
        hole.reshape(shape),
        where.reshape(*shape, 3),
        atlas.reshape(*shape, 2),
        depth.reshape(shape),
        before.reshape(shape),
    )


def _spreader_depth(scene: Scene, view: View, start: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Return the depth in metres of the spreader along rays [N, 3], inf where they miss it."""
    held = scene.spreader
    mesh = build_spreader(scene.container.kind, held.flippers_down, held.gap_mm)
    return first_hits(mesh, view, start, rays)[1]


def with_seals(ids: np.ndarray, hits: Hits, scene: Scene, view: View) -> np.ndarray:
    """Return the id target of `object_ids` with the seals of the scene in front of `hits`."""
    seals, depth = seal_hits(scene, view)
    return np.where(depth < hits.depth_m, seals, ids).astype(np.uint16)


def seal_hits(
    scene: Scene, view: View, pixels: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the id of the seal that each ray hits first, and its depth in metres, inf for none."""
    seals = scene_seals(scene)
    assert seals is not None
    start, rays = view.rays(pixels)
    triangle, depth = first_hits(seals.mesh, view, start, rays.reshape(-1, 3))
    owner = seals.facets.owner[seals.mesh.triangles[triangle, 0]]
    numbers = np.array([SEAL + seal.hasp for seal in scene.seals])
    return numbers[owner].reshape(rays.shape[:-1]), depth.reshape(rays.shape[:-1])


def first_hits(
    mesh: Mesh, view: View, start: np.ndarray, rays: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangle that each ray [N, 3] hits first, -1 for none, and its depth in metres."""
    positions, body = body_of(mesh, ())
    triangle = body.intersects_first(np.tile(start * 1e-3, (len(rays), 1)), rays)
    hit = triangle >= 0
    distance, *_ = _meet(positions[mesh.triangles[triangle[hit]]], start, rays[hit])
    depth = np.full(len(rays), np.inf)
    depth[hit] = view.to_view(start + distance[:, None] * rays[hit])[:, 2]
    return triangle, depth


def _meet(
    corners: np.ndarray, start: np.ndarray, ray: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return distance, weights of corners 1 and 2, and whether the front is hit, in float64."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e1, e2)
    along = (ray * normal).sum(1)
    distance = ((corners[:, 0] - start) * normal).sum(1) / along
    local = start + distance[:, None] * ray - corners[:, 0]
    area = (normal * normal).sum(1)
    b = (np.cross(local, e2) * normal).sum(1) / area
    c = (np.cross(e1, local) * normal).sum(1) / area
    return distance, b, c, along < 0


def _between(corners: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    first = corners[:, 0]
    one, other = corners[:, 1] - first, corners[:, 2] - first
    between: np.ndarray = first + b[:, None] * one + c[:, None] * other
    return between


def inside(decal: Decal, sheet_mm: np.ndarray) -> np.ndarray:
    """Return whether sheet points [..., 2] lie in the decal's outline, bool [...]."""
    angle = np.deg2rad(decal.rotation_deg)
    offset = sheet_mm - np.array(decal.center_mm)
    x = offset @ np.array([np.cos(angle), np.sin(angle)])
    y = offset @ np.array([-np.sin(angle), np.cos(angle)])
    half_width, half_height = np.array(decal.size_mm) / 2
    if decal.kind == "marker":
        within: np.ndarray = np.abs(x) / half_width + np.abs(y) / half_height <= 1
    elif decal.kind == "triangle":
        # the width shrinks evenly from the lower side to the tip
        left = (half_height - y) / (2 * half_height)
        within = (y >= -half_height) & (np.abs(x) <= left * half_width)
    else:
        within = (np.abs(x) <= half_width) & (np.abs(y) <= half_height)
    return within


def object_ids(scene: Scene, mesh: Mesh, hits: Hits) -> np.ndarray:
    """Return the id target expected from the rays, uint16 [H, W]."""
    ids = np.where(hits.hit, 1, 0).astype(np.uint16)
    ids[hits.spreader] = SPREADER
    outside = np.flatnonzero(hits.hit & (hits.hole < 0))
    chart = mesh.chart[mesh.triangles[hits.triangle.ravel()[outside], 0]]
    atlas_mm = hits.atlas_mm.reshape(-1, 2)
    seen = {}  # pixels of a face, and their places on its sheet
    following = 2
    for decal in scene.decals:
        if not decal.class_name:
            continue
        number = mesh.chart_index(decal.face)
        if number not in seen:
            pixels = outside[chart == number]
            seen[number] = pixels, atlas_mm[pixels] - mesh.charts[number].rect_mm[:2]
        pixels, sheet_mm = seen[number]
        ids.flat[pixels[inside(decal, sheet_mm)]] = following
        following = 600 if following == 199 else following + 1  # 200 to 599 are damages
    return ids


def damage_values(scene: Scene, hits: Hits, threshold_mm: float) -> np.ndarray:
    """Return the damage target expected from the rays, uint16 [H, W]."""
    values, counts = [], dict.fromkeys(CATEGORIES, 0)
    for damage in scene.damages:
        counts[damage.kind] += 1
        values.append(CATEGORIES[damage.kind] * 100 + counts[damage.kind])
    target = np.where(hits.hit, 101, 0).astype(np.uint16)
    most = np.full(target.shape, threshold_mm)
    for damage, value in zip(scene.damages, values, strict=True):
        amount = np.abs(damage_law.amount_mm(damage, hits.rest_mm))
        more = hits.hit & (hits.hole < 0) & (amount > most)
        target[more], most[more] = value, amount[more]
    together = np.linalg.norm(
        damage_law.deform(scene.damages, hits.rest_mm) - hits.rest_mm, axis=-1
    )
    target[hits.hit & (together < threshold_mm)] = 101
    marks = zip(scene.damages, values, strict=True)
    # marks of later kinds cover those of earlier ones
    for damage, value in sorted(marks, key=lambda mark: -(mark[1] // 100)):
        marked = hits.hit & (hits.hole < 0) & damage_law.is_marked(damage, hits.rest_mm)
        target[marked & (target == 101)] = value
    for i, value in enumerate(values):
        target[hits.hole == i] = value
    return target


def box_of(mask: np.ndarray) -> tuple[int, int, int, int] | None:
    """Return the tight box of a mask (x0, y0, x1, y1), end exclusive, or None if it is empty."""
    rows, columns = np.nonzero(mask)
    if not rows.size:
        return None
    return int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1


def near_edge(values: np.ndarray) -> np.ndarray:
    """Return which pixels [H, W] lie within one pixel of a change in `values` [H, W]."""
    padded = np.pad(values, 1, mode="edge")
    height, width = values.shape
    around = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    changes: np.ndarray = np.any([a != values for a in around], axis=0)
    return changes
