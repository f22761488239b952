"""Panel grids of the container, their unfolding, and the mapping from a sheet to the surface."""

import numpy as np
import pytest

from fastgen.geometry.container import build_container
from fastgen.geometry.mesh import MATERIALS, Mesh
from fastgen.scene.container_kinds import WallProfiles
from fastgen.scene.faces import FACES
from tests.mesh_probe import (
    ISO_668,
    OUT,
    RIGHT,
    WALLS,
    triangles_of,
    winding_normals,
)


def sheet_jacobian(mesh: Mesh):
    """Return d position / d sheet [T, 3, 2] and the signed sheet area [T] of each triangle."""
    p = mesh.positions_mm[mesh.triangles].astype(np.float64)
    s = mesh.atlas_mm[mesh.triangles].astype(np.float64)
    edges = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2)
    sheet_edges = np.stack([s[:, 1] - s[:, 0], s[:, 2] - s[:, 0]], axis=2)
    return edges @ np.linalg.inv(sheet_edges), np.linalg.det(sheet_edges) / 2


@pytest.mark.parametrize("kind", ISO_668)
def test_nothing_on_a_sheet_is_mirrored(kind):
    mesh = build_container(kind)
    jacobian, area = sheet_jacobian(mesh)
    assert area.min() > 0.1
    turned = np.cross(jacobian[:, :, 0], jacobian[:, :, 1])
    assert np.einsum("ij,ij->i", turned, winding_normals(mesh)).min() > 0.5


@pytest.mark.parametrize("face", RIGHT)
def test_sheet_axes_point_right_and_up_for_a_viewer_in_front_of_the_panel(face):
    mesh = build_container("40")
    width, height = mesh.charts[mesh.chart_index(face)].rect_mm[2:]
    sheet = np.array([[0.1, 0.5], [0.9, 0.5], [0.4, 0.1], [0.4, 0.9]]) * (width, height)
    p, _ = mesh.sheet_to_surface(face, sheet)
    right, out = np.array(RIGHT[face], float), np.array(OUT[face], float)
    up = np.cross(out, right)
    assert (p[1] - p[0]) @ right > 0.7 * 0.8 * width
    assert (p[3] - p[2]) @ up > 0.7 * 0.8 * height


@pytest.mark.parametrize("kind", ISO_668)
def test_texel_density_is_even(kind):
    mesh = build_container(kind)
    jacobian, area = sheet_jacobian(mesh)
    stretch = np.linalg.svd(jacobian, compute_uv=False)
    for face in (*WALLS, "underside"):
        assert np.abs(stretch[triangles_of(mesh, face)] - 1).max() < 0.01
    assert np.abs(stretch - 1).max() < 0.25
    # the flat stiles share the swages' unfolding, see door.SWAGE
    door = triangles_of(mesh, "door")
    uneven = (np.abs(stretch[door] - 1) > 0.01).any(axis=1)
    assert area[door][uneven].sum() < 0.03 * area[door].sum()


@pytest.mark.parametrize("kind", ISO_668)
def test_charts_keep_a_gutter_and_fit_a_16k_atlas_at_a_millimetre(kind):
    mesh = build_container(kind)
    assert len(mesh.charts) < 1000
    assert max(mesh.atlas_size_mm) <= 16400
    rects = np.array([c.rect_mm for c in mesh.charts])
    low, high = rects[:, :2], rects[:, :2] + rects[:, 2:]
    assert (low >= 0).all()
    assert (high <= np.array(mesh.atlas_size_mm)).all()
    apart = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() >= 16
    assert np.prod(rects[:, 2:], axis=1).sum() > 0.78 * np.prod(mesh.atlas_size_mm)
    assert (mesh.atlas_mm >= low[mesh.chart] - 1e-2).all()
    assert (mesh.atlas_mm <= high[mesh.chart] + 1e-2).all()
    assert len({c.name for c in mesh.charts}) == len(mesh.charts)
    assert all(MATERIALS[c.material_index] == c.material for c in mesh.charts)


def test_no_point_of_the_atlas_belongs_to_two_triangles():
    mesh = build_container("20")
    step = 6.1
    columns, rows = (int(side / step) + 2 for side in mesh.atlas_size_mm)
    count = np.zeros((rows, columns), np.uint8)
    corners = mesh.atlas_mm[mesh.triangles].astype(np.float64) / step
    for triangle in corners:
        x0, y0 = np.ceil(triangle.min(axis=0)).astype(int)
        x1, y1 = np.floor(triangle.max(axis=0)).astype(int) + 1
        if x0 >= x1 or y0 >= y1:
            continue
        x, y = np.arange(x0, x1), np.arange(y0, y1)[:, None]
        inside = np.ones((y1 - y0, x1 - x0), bool)
        for (ax, ay), (bx, by) in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
            inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 1e-6
        count[y0:y1, x0:x1] += inside
    assert count.max() == 1
    assert count.mean() > 0.6


@pytest.mark.parametrize("max_edge", [150.0, 90.0])
def test_panel_edges_are_no_longer_than_max_edge_mm(max_edge):
    mesh = build_container("20", max_edge_mm=max_edge)
    for face in (*WALLS, "door"):
        p = mesh.positions_mm[mesh.triangles[triangles_of(mesh, face)]].astype(np.float64)
        longest = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max()
        assert 0.5 * max_edge < longest <= max_edge + 0.01


@pytest.mark.parametrize(("face", "columns"), [("no_door", 2), ("front", 1)])
def test_wall_facets_have_enough_columns_for_light_to_vary_across_them(face, columns):
    """The end wall needs two because its waves are deep. Flats are the widest facets."""
    profiles = WallProfiles()
    mesh = build_container("20", profiles)
    p = mesh.positions_mm[np.unique(mesh.triangles[triangles_of(mesh, face)])].astype(np.float64)
    axis = 1 if face == "no_door" else 0
    along, out = p[:, axis], np.abs(p[:, 1 - axis])
    outer = np.unique(np.round(along[out > out.max() - 0.1], 1))
    inner = np.unique(np.round(along[out < out.min() + 0.1], 1))
    wave = profiles.end if face == "no_door" else profiles.side
    widest = max(wave.outer_mm, wave.inner_mm)
    flat = outer if wave.outer_mm == widest else inner
    steps = np.diff(flat)
    assert np.median(steps[steps < widest + 1]) == pytest.approx(widest / columns, abs=0.5)


def edges_of(mesh: Mesh, face: str):
    """Return welded points [N, 3], edges [E, 2], triangles per edge [E] and the triangle count."""
    corners = mesh.triangles[triangles_of(mesh, face)]
    points, number = np.unique(
        mesh.positions_mm[corners].reshape(-1, 3), axis=0, return_inverse=True
    )
    welded = number.reshape(-1, 3)
    edges = np.sort(np.concatenate([welded[:, [0, 1]], welded[:, [1, 2]], welded[:, [2, 0]]]))
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return points, unique, count, len(corners)


@pytest.mark.parametrize("face", WALLS)
def test_a_wall_is_one_disc_without_a_crack(face):
    points, edges, count, faces = edges_of(build_container("40HC"), face)
    assert set(count) == {1, 2}
    # a crack or a hole would change Euler's characteristic, which is 1 for a disc
    assert len(points) - len(edges) + faces == 1


@pytest.mark.parametrize("face", [*WALLS, "door"])
def test_no_vertex_lies_inside_a_border_edge_of_its_panel(face):
    points, edges, count, _ = edges_of(build_container("40HC"), face)
    border = edges[count == 1]
    a, b = points[border[:, 0], None].astype(float), points[border[:, 1], None].astype(float)
    p = points[None, np.unique(border)].astype(float)
    along = np.einsum("epd,epd->ep", p - a, np.broadcast_to(b - a, (len(a), p.shape[1], 3)))
    share = along / np.sum((b - a) ** 2, axis=2)
    away = np.linalg.norm(p - a - share[..., None] * (b - a), axis=2)
    assert not ((share > 1e-4) & (share < 1 - 1e-4) & (away < 1e-2)).any()


@pytest.mark.parametrize("name", [*FACES, "post.door.front", "rail.top.back", "door.handle.2"])
def test_sheet_to_surface_inverts_the_unfolding(name):
    mesh = build_container("40HC")
    rng = np.random.default_rng(8)
    chosen = rng.choice(triangles_of(mesh, name), 400)
    weights = rng.dirichlet((1, 1, 1), 400)
    corners = mesh.triangles[chosen]
    expected = np.einsum("kc,kcd->kd", weights, mesh.positions_mm[corners])
    atlas = np.einsum("kc,kcd->kd", weights, mesh.atlas_mm[corners])
    sheet = atlas - mesh.charts[mesh.chart_index(name)].rect_mm[:2]
    positions, normals = mesh.sheet_to_surface(name, sheet)
    assert np.linalg.norm(positions - expected, axis=1).max() < 0.02
    assert np.abs(normals - winding_normals(mesh)[chosen]).max() < 1e-3


def test_lengths_on_the_sheet_equal_lengths_on_the_wall():
    mesh = build_container("40")
    for face in WALLS:
        width, height = mesh.charts[mesh.chart_index(face)].rect_mm[2:]
        x = np.arange(400, width - 400, 0.25)
        p, _ = mesh.sheet_to_surface(face, np.column_stack([x, np.full(len(x), height / 2)]))
        walked = np.linalg.norm(np.diff(p, axis=0), axis=1).sum()
        assert walked == pytest.approx(x[-1] - x[0], rel=1e-3)


def test_sheet_points_between_the_door_leaves_lie_level_with_them():
    mesh = build_container("20")
    width, height = mesh.charts[mesh.chart_index("door")].rect_mm[2:]
    points = [[width / 2, height * share] for share in (0.2, 0.5, 0.8)]
    p, _ = mesh.sheet_to_surface("door", points)
    assert np.abs(p[:, 1]).max() < 1
    assert ((p[:, 0] > 3029 - 90) & (p[:, 0] < 3029 - 50)).all()


def test_flats_are_the_outermost_stretches_of_their_sheets():
    mesh = build_container("40HC")
    for face in (*WALLS, "door"):
        width, height = mesh.charts[mesh.chart_index(face)].rect_mm[2:]
        flats = np.array(mesh.flats[face])
        assert len(flats) > 3
        inside = (flats[:, :1] + (flats[:, 1:] - flats[:, :1]) * (0.02, 0.5, 0.98)).ravel()
        between = (flats[:-1, 1] + flats[1:, 0]) / 2
        for along, outermost in ((inside, True), (between, False)):
            sheet = np.full((len(along), 2), 0.4 * (height if face != "door" else width))
            sheet[:, 1 if face == "door" else 0] = along
            p, _ = mesh.sheet_to_surface(face, sheet)
            out = np.array(OUT[face], float)
            top = (mesh.positions_mm[mesh.triangles[triangles_of(mesh, face)]] @ out).max()
            assert ((top - p @ out < 0.01) == outermost).all()
