"""Shadow maps of directional lights, compared with rays and algebra."""

from contextlib import contextmanager

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen.geometry.container import build_container, container_outline
from fastgen.geometry.damage_law import deform
from fastgen.geometry.solids import without_cables
from fastgen.geometry.spreader import CABLE_TIER, build_spreader, tier_of_vertices
from fastgen.render.depth_map import occluder_program
from fastgen.render.gl import open_context
from fastgen.render.shadow_map import ShadowMap
from fastgen.render.sky_visibility_probe import probe_points
from fastgen.scene import Damage
from fastgen.scene.container_kinds import KINDS
from tests.mesh_probe import behind_the_middle


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


@contextmanager
def shadow_map(gl, detail):
    made = ShadowMap(gl.ctx, occluder_program(gl.ctx), detail)
    yield made
    made.release()


@pytest.fixture
def shadow(gl):
    with shadow_map(gl, 1.0) as made:
        yield made


@pytest.fixture(params=[1.0, 0.5])
def detail(request):
    return request.param


@pytest.fixture
def detailed(gl, detail):
    with shadow_map(gl, detail) as made:
        yield made


def depth_in(shadow):
    """Return the shadow map's depth texture, float32 [rows, columns]."""
    across = shadow.depth.size[::-1]
    return np.frombuffer(shadow.depth.read(alignment=1), np.float32).reshape(across)


@pytest.mark.parametrize("suns", [1, 2, 3, 4])
def test_shadows_of_the_spreader_equal_ray_casts(detailed, detail, suns):
    """All sheets that face a sun are checked, for high and low suns, alone and several at once."""
    ways = [(0.8, -0.58, 0.14), (0.55, -0.6, 0.58), (-0.7, 0.3, 0.4), (0.1, 0.9, 0.2)][:suns]
    ways = np.array(ways) / np.linalg.norm(ways, axis=1, keepdims=True)
    container, spreader = build_container("20"), build_spreader("20")
    detailed.cast(container, without_cables(spreader), ways)
    depth = depth_in(detailed)
    eye_m = np.array([3.0, -9.0, 2.0])
    for toward, matrix in zip(ways, detailed.from_ray(eye_m), strict=True):
        check_against_rays(container, spreader, toward, depth, matrix, eye_m, 10 / detail)


def test_the_outline_casts_the_shadow_of_the_whole_mesh(shadow):
    """Charts that a damage reaches need the whole mesh, as the outline lacks the vertices."""
    toward = np.array([[-0.7, -0.6, 0.4]]) / np.linalg.norm([-0.7, -0.6, 0.4])
    dent = Damage(
        "concave", "front", (0.0, -KINDS["20"].size_mm[1] / 2, 1300.0), (1.0, 0.0, 0.0),
        (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (900.0, 1400.0), 230.0,
    )  # fmt: skip
    whole, outline = build_container("20"), container_outline("20")
    depths = []
    for damages, lesser in (((dent,), None), ((dent,), outline), ((), outline)):
        shadow.cast(whole, None, toward, damages, lesser)
        columns, rows = (shadow.tiles[0, 2:] * shadow.depth.size).astype(int)  # the first tile
        depths.append(depth_in(shadow)[:rows, :columns].copy())
    spans_mm = 2 / np.linalg.norm(shadow.from_ray(np.zeros(3))[0, 2, :3]) * 500
    apart = np.abs(depths[1] - depths[0]) * spans_mm
    assert (apart > 5).mean() < 2e-4  # at facet edges
    assert (np.abs(depths[2] - depths[0]) * spans_mm > 20).mean() > 0.01


def check_against_rays(container, spreader, toward, depth, matrix, eye_m, texel_mm):
    lit = np.flatnonzero(container.normals @ toward > 0.1)
    at = (probe_points(container)[lit] / 1000 - eye_m) @ matrix[:3, :3].T + matrix[:3, 3]
    # under the lowest sun, 2 % of the door's vertices are nearer to a shadow than the map resolves
    least = 0.975 if toward[2] < 0.2 else 0.98
    assert agreement(container, spreader, toward, depth, lit, at, texel_mm) > least


def agreement(container, spreader, toward, depth, picked, at, texel_mm):
    """Return the share of vertices `picked` whose rays to the sun agree with the map.

    at: places [K, 3] of the vertices in the map. Vertices near a shadow's border do not count.
    """
    points = probe_points(container)[picked]
    column, row = (at[:, :2] * depth.shape[::-1]).astype(int).T
    found = at[:, 2] <= depth[row, column]

    # rays around each point find shadow borders: within a texel of one the map may say either
    aside = np.cross(container.normals[picked], toward)
    steps = (aside, np.cross(container.normals[picked], aside))
    around = [np.zeros(3), *(sign * texel_mm * step for sign in (-1, 1) for step in steps)]
    rays = np.concatenate([points + step for step in around])
    free = np.ones(len(rays), bool)
    solid = tier_of_vertices(spreader) != CABLE_TIER
    for mesh, kept in (
        (container, slice(None)),
        (spreader, solid[spreader.triangles[:, 0]]),
    ):
        triangles = mesh.triangles.astype(np.int64)[kept]
        body = trimesh.Trimesh(mesh.positions_mm, triangles, process=False)
        free &= ~RayMeshIntersector(body).intersects_any(rays, np.tile(toward, (len(rays), 1)))
    free = free.reshape(len(around), -1)
    # vertices buried in another part are never visible
    body = trimesh.Trimesh(container.positions_mm, container.triangles.astype(np.int64))
    buried = RayMeshIntersector(body).intersects_any(points, container.normals[picked])
    clear = (free == free[0]).all(axis=0) & ~buried
    assert 0.05 < free[0, clear].mean() < 0.95
    return (found == free[0])[clear].mean()


@pytest.mark.parametrize(
    "toward", [(0.75, -0.6, 0.2), (0.3, 0.4, 0.8), (0.9, 0.3, 0.3), (-0.6, -0.75, 0.25)]
)
def test_shadows_on_an_end_equal_ray_casts(detailed, detail, toward):
    """The end's own tile is accurate to 4 mm, or to 8 mm at half detail."""
    toward = np.array(toward) / np.linalg.norm(toward)
    container, spreader = build_container("40"), build_spreader("40")
    detailed.cast(container, without_cables(spreader), toward[None])
    depth = depth_in(detailed)
    eye_m = np.array([9.0, 1.0, 2.0])
    (matrix,) = detailed.from_ray(eye_m)
    end = detailed.end.side * container.positions_mm[:, 0] > detailed.end.from_mm
    picked = np.flatnonzero(end & (container.normals @ toward > 0.1))
    at = (probe_points(container)[picked] / 1000 - eye_m) @ matrix[:3, :3].T + matrix[:3, 3]
    fine = at.copy()
    fine[:, :2] = at[:, :2] * detailed.end.to_tile[:2] + detailed.end.to_tile[2:]
    assert ((fine[:, :2] > detailed.end.inner[:2]) & (fine[:, :2] < detailed.end.inner[2:])).all()
    found = agreement(container, spreader, toward, depth, picked, fine, 4 / detail)
    assert found > 0.98


def test_a_dents_shadow_on_itself_equals_ray_casts(shadow):
    """Under a raking sun, half of a deep dent lies in the shadow of the other half."""
    toward = np.array([0.93, -0.3, 0.2]) / np.linalg.norm([0.93, -0.3, 0.2])
    container = build_container("20")
    half_width = KINDS["20"].size_mm[1] / 2
    dent = Damage(
        "concave", "front", (0.0, -half_width, 1300.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0),
        (0.0, 1.0, 0.0), (900.0, 1400.0), 230.0,
    )  # fmt: skip
    shadow.cast(container, None, toward[None], (dent,))
    depth = depth_in(shadow)

    moved = deform((dent,), container.positions_mm)
    body = trimesh.Trimesh(moved, container.triangles.astype(np.int64), process=False)
    at = np.stack(np.meshgrid(np.linspace(-440, 440, 60), np.linspace(700, 1900, 60)), -1)
    eyes = np.insert(at.reshape(-1, 2), 1, -half_width - 500, axis=1)
    seen = RayMeshIntersector(body)
    points, _, triangle = seen.intersects_location(
        eyes, np.tile([0.0, 1.0, 0.0], (len(eyes), 1)), multiple_hits=False
    )
    normals = body.face_normals[triangle]
    facing = normals @ toward > 0.1
    points = (points + 2.0 * normals)[facing]

    def free_of(mesh, offset):
        rays = np.tile(toward, (len(points), 1))
        return ~RayMeshIntersector(mesh).intersects_any(points + offset, rays)

    aside = np.cross(toward, [0.0, 0.0, 1.0])
    around = [free_of(body, step * aside) for step in (-10, 0, 10)]
    clear = (around[0] == around[1]) & (around[2] == around[1])
    assert 0.2 < around[1].mean() < 0.8
    (matrix,) = shadow.from_ray(np.zeros(3))
    uvd = points / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (uvd[:, :2] * depth.shape[::-1]).astype(int).T
    found = uvd[:, 2] <= depth[row, column]
    assert (found == around[1])[clear].mean() > 0.97


@pytest.mark.parametrize(("across_mm", "depth_mm"), [(1200.0, 260.0), (20000.0, 900.0)])
def test_a_door_pushed_in_deep_is_lit(shadow, across_mm, depth_mm):
    """The dent is deeper than the map shifts front faces, or it moves the whole end."""
    container = build_container("20")
    half_length = KINDS["20"].size_mm[0] / 2
    dent = Damage(
        "concave", "door", (half_length, 0.0, 1300.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0),
        (-1.0, 0.0, 0.0), (across_mm, across_mm), depth_mm,
    )  # fmt: skip
    shadow.cast(container, None, np.array([[1.0, 0.0, 0.0]]), (dent,))
    (matrix,) = shadow.from_ray(np.zeros(3))
    middle = np.array([[half_length - depth_mm + 10.0, 0.0, 1300.0]])
    at = middle / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    if shadow.end.from_mm < middle[0, 0]:
        at[:, :2] = at[:, :2] * shadow.end.to_tile[:2] + shadow.end.to_tile[2:]
    depth = depth_in(shadow)
    column, row = (at[:, :2] * depth.shape[::-1]).astype(int).T
    assert (at[:, 2] <= depth[row, column]).all()
    assert depth.min() < 1.0


def test_only_a_sun_that_faces_an_end_gets_the_ends_tile(shadow):
    container = build_container("20")
    for x, there in ((0.6, True), (0.0, False), (-0.6, True)):
        shadow.cast(container, None, np.array([[x, -0.8, 0.6]]) / np.hypot(x, 1.0))
        assert (shadow.end.inner[:2] < shadow.end.inner[2:]).all() == there
        assert shadow.end.side == np.sign(x) or not there


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_sun_along_an_axis_lights_the_outermost_surface(shadow, axis):
    container = build_container("20")
    shadow.cast(container, None, np.array([axis]))
    depth = depth_in(shadow)
    height = container.positions_mm @ axis
    outermost = (container.normals @ axis > 0.9) & (height > height.max() - 1)
    (matrix,) = shadow.from_ray(np.zeros(3))
    at = container.positions_mm[outermost] / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (at[:, :2] * depth.shape[::-1]).astype(int).T
    assert outermost.sum() > 10
    assert (at[:, 2] <= depth[row, column]).mean() > 0.9


@pytest.mark.parametrize("toward", [(0.95, 0.25, 0.12), (0.35, 0.9, 0.25), (-0.3, -0.8, 0.5)])
def test_points_behind_the_container_lie_in_its_shadow(shadow, toward):
    """Points lie a millimetre off the surface, in every crease of rails, posts and walls."""
    toward = np.array(toward) / np.linalg.norm(toward)
    container = build_container("20")
    shadow.cast(container, None, toward[None])
    depth = depth_in(shadow)
    facing = container.normals @ toward > 0.05
    points = container.positions_mm[facing].astype(float) + container.normals[facing]
    behind = behind_the_middle(container, points, toward)
    (matrix,) = shadow.from_ray(np.zeros(3))
    at = points[behind] / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (at[:, :2] * depth.shape[::-1]).astype(int).T
    assert behind.sum() > 500
    assert (at[:, 2] > depth[row, column]).all()
