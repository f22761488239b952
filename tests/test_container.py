"""Shape of the container, measured with rays and not with the builder's own numbers."""

import numpy as np
import pytest

from fastgen.errors import ConfigError
from fastgen.geometry.container import build_container, container_outline
from fastgen.geometry.mesh import GROUP_SLACK_MM
from fastgen.scene.container_kinds import KINDS, WallProfiles, Wave
from fastgen.scene.faces import FACES
from fastgen.validation import check_fields
from tests.mesh_probe import (
    ISO_668,
    OUT,
    WALLS,
    around,
    chart_of,
    depths,
    first_hits,
    winding_normals,
)

DEEP = WallProfiles(
    Wave(278.0, 108.0, 72.0, 68.0, 70.0),
    Wave(250.0, 119.0, 110.0, 18.0, 104.0),
    Wave(209.0, 60.0, 91.0, 13.5, 91.0),
)


@pytest.mark.parametrize("kind", ISO_668)
def test_outer_size_is_exactly_that_of_iso_668(kind):
    mesh = build_container(kind)
    length, width, height, code = ISO_668[kind]
    assert np.array_equal(mesh.positions_mm.min(axis=0), [-length / 2, -width / 2, 0])
    assert np.array_equal(mesh.positions_mm.max(axis=0), [length / 2, width / 2, height])
    assert KINDS[kind].size_type == code


@pytest.mark.parametrize("kind", ISO_668)
def test_only_castings_reach_the_outer_planes(kind):
    mesh = build_container(kind)
    names = np.array([c.name for c in mesh.charts])[mesh.chart]
    for axis in range(3):
        values = mesh.positions_mm[:, axis]
        touching = names[(values == values.min()) | (values == values.max())]
        assert touching.size
        assert all(name.startswith("casting.") for name in touching)


@pytest.mark.parametrize("kind", ISO_668)
def test_castings_measure_178_by_162_by_118(kind):
    mesh = build_container(kind)
    names = np.array([c.name for c in mesh.charts])[mesh.chart]
    p = mesh.positions_mm[np.char.startswith(names, "casting.")]
    length, width, height, _ = ISO_668[kind]
    corner = np.sign(p - (0, 0, height / 2)) * (p - (0, 0, height / 2))
    assert len(np.unique(np.sign(p - (0, 0, height / 2)), axis=0)) == 8
    assert np.allclose(np.ptp(corner, axis=0), [178, 162, 118], atol=1e-3)
    assert np.allclose(corner.max(axis=0), [length / 2, width / 2, height / 2])


def test_every_casting_has_a_dark_aperture_in_each_outer_face():
    mesh = build_container("40HC")
    x, y, z = 12192 / 2, 2438 / 2, 2896 / 2
    for sx in (-1, 1):
        for sy in (-1, 1):
            for sz in (-1, 1):
                hole = np.array([sx * (x - 101.5), sy * (y - 89), z + sz * (z - 59)])
                rim = np.array([sx * (x - 12), sy * (y - 12), z + sz * (z - 12)])
                for face in (
                    "door" if sx > 0 else "no_door",
                    "back" if sy > 0 else "front",
                    "roof" if sz > 0 else "underside",
                ):
                    triangle, depth = depths(mesh, face, np.array([hole, rim]))
                    materials = [mesh.charts[i].material for i in chart_of(mesh, triangle)]
                    assert materials == ["rubber", "casting"]
                    assert depth == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("profiles", [WallProfiles(), DEEP], ids=["usual", "deep"])
@pytest.mark.parametrize("face", WALLS)
def test_corrugation_has_the_pitch_and_depth_of_its_profile(face, profiles):
    mesh = build_container("20", profiles)
    wave = {"no_door": profiles.end, "roof": profiles.roof}.get(face, profiles.side)
    axis, half = (1, 1219) if face == "no_door" else (0, 3029)
    stations = np.arange(-half + 200, half - 200, 0.5)
    points = np.zeros((len(stations), 3))
    points[:, axis] = stations
    points[:, 2] = 1300
    if face == "roof":
        points[:, 1] = 100
    triangle, depth = depths(mesh, face, points)
    assert (chart_of(mesh, triangle) == mesh.chart_index(face)).all()
    assert np.ptp(depth) == pytest.approx(wave.depth_mm, abs=0.01)
    sinking = np.flatnonzero(np.diff((depth > depth.min() + wave.depth_mm / 2).astype(int)) == 1)
    assert len(sinking) > 5
    assert np.abs(np.diff(stations[sinking]) - wave.pitch_mm).max() <= 0.5
    middle = slice(sinking[0], sinking[-1])
    assert (depth[middle] < depth.min() + 0.1).mean() == pytest.approx(
        wave.outer_mm / wave.pitch_mm, abs=0.01
    )
    assert (depth[middle] > depth.max() - 0.1).mean() == pytest.approx(
        wave.inner_mm / wave.pitch_mm, abs=0.01
    )


@pytest.mark.parametrize(
    ("kind", "profiles"),
    [("20", WallProfiles()), ("40", WallProfiles()), ("45HC", WallProfiles()), ("20", DEEP)],
)
def test_no_ray_from_outside_hits_a_back_face_or_passes_through(kind, profiles):
    mesh = build_container(kind, profiles)
    rng = np.random.default_rng(5)
    origins = around(rng, mesh, 150_000)
    # the core excludes the fork pockets, which are open from side to side
    low = mesh.positions_mm.min(axis=0) + np.array([60, 60, 180])
    high = mesh.positions_mm.max(axis=0) - (60, 60, 60)
    core = np.clip(rng.uniform(low - 300, high + 300, origins.shape), low, high)
    triangle, _ = first_hits(mesh, origins, core - origins)
    assert (triangle >= 0).all()
    anywhere = rng.uniform(low - (60, 60, 180), high + 60, origins.shape)
    for target in (core, anywhere):
        direction = target - origins
        triangle, _ = first_hits(mesh, origins, direction)
        hit = triangle >= 0
        facing = np.einsum("ij,ij->i", winding_normals(mesh)[triangle[hit]], direction[hit])
        assert (facing <= 0).all()


@pytest.mark.parametrize("kind", ["20", "40HC"])
def test_a_group_is_visible_only_from_in_front_of_its_face(kind):
    mesh = build_container(kind)
    rng = np.random.default_rng(6)
    group = np.full(len(mesh.triangles), "frame", "U10")
    for name, where in mesh.groups.items():
        group[where] = name
    low, high = mesh.positions_mm.min(axis=0), mesh.positions_mm.max(axis=0)
    origins = around(rng, mesh, 150_000)
    # half of the origins lie just behind the plane of a face, where an error shows first
    near = np.arange(0, len(origins), 2)
    axis, upper = rng.integers(0, 3, near.size), rng.integers(0, 2, near.size)
    inward = GROUP_SLACK_MM + 10 ** rng.uniform(-2, 3, near.size)
    origins[near, axis] = np.where(upper, high[axis] - inward, low[axis] + inward)
    origins = origins[((origins < low) | (origins > high)).any(axis=1)]
    aims = rng.integers(0, len(mesh.triangles), len(origins))
    weights = rng.dirichlet((1, 1, 1), len(origins))
    targets = np.einsum("kc,kcd->kd", weights, mesh.positions_mm[mesh.triangles[aims]])
    triangle, _ = first_hits(mesh, origins, targets - origins)
    for face in FACES:
        out = np.array(OUT[face], float)
        plane = (mesh.positions_mm @ out).max() - GROUP_SLACK_MM
        seen = (triangle >= 0) & (group[triangle] == face)
        assert seen.sum() > 200
        assert (origins[seen] @ out > plane).all()


@pytest.mark.parametrize("kind", ISO_668)
def test_each_triangle_is_in_one_group_and_the_frame_group_is_small(kind):
    mesh = build_container(kind)
    assert set(mesh.groups) == {*FACES, "frame"}
    covered = np.concatenate([np.arange(s.start, s.stop) for s in mesh.groups.values()])
    assert np.array_equal(np.sort(covered), np.arange(len(mesh.triangles)))
    frame = mesh.groups["frame"]
    assert frame.stop - frame.start < 0.15 * len(mesh.triangles)


@pytest.mark.parametrize("kind", ISO_668)
def test_triangles_are_not_degenerate_and_are_wound_like_their_normals(kind):
    mesh = build_container(kind)
    a, b, c = mesh.positions_mm[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1.0
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
    for corner in range(3):
        stored = mesh.normals[mesh.triangles[:, corner]]
        assert np.einsum("ij,ij->i", stored, winding_normals(mesh)).min() > 1 - 1e-4
    assert np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.positions_mm)))
    charts = mesh.chart[mesh.triangles]
    assert (charts == charts[:, :1]).all()


def test_fork_pockets_pass_through_a_20_and_not_a_40():
    ray = np.array([[-1025.0, -3000, 80], [1025.0, -3000, 80]])
    ahead = np.tile([0.0, 1, 0], (2, 1))
    assert (first_hits(build_container("20"), ray, ahead)[0] == -1).all()
    assert (first_hits(build_container("40"), ray, ahead)[0] >= 0).all()
    _, depth = depths(build_container("20"), "front", ray + np.array([0, 0, 78]))
    assert (depth < 12).all()


@pytest.mark.parametrize("kind", ISO_668)
def test_four_round_bars_lie_in_front_of_the_door_leaves(kind):
    mesh = build_container(kind)
    y = np.arange(-1000, 1000, 1.0)
    points = np.column_stack([np.zeros(len(y)), y, np.full(len(y), 700.0)])
    triangle, depth = depths(mesh, "door", points)
    names = np.array([c.name for c in mesh.charts])[chart_of(mesh, triangle)]
    bar = np.char.startswith(names, "door.bar.")
    starts = np.flatnonzero(np.diff(bar.astype(int)) == 1)
    assert len(starts) == 4
    assert bar.sum() / 4 == pytest.approx(32, abs=3)
    # in front of the leaf, but behind the castings' plane
    assert depth[bar].min() > 0
    assert depth[names == "door"].min() - depth[bar].max() > 10


def test_a_recessed_rubber_seal_surrounds_the_door_leaves():
    mesh = build_container("40HC")
    gaps = [(0, 1300), (0, 2000), (-1100, 1400), (1100, 700), (-600, 126), (600, 2769)]
    points = np.array([[0, y, z] for y, z in gaps], float)
    triangle, depth = depths(mesh, "door", points)
    materials = [mesh.charts[i].material for i in chart_of(mesh, triangle)]
    assert materials == ["rubber"] * len(gaps)
    leaf, leaf_depth = depths(mesh, "door", np.array([[0, 40.0, 1300]]))
    assert mesh.charts[chart_of(mesh, leaf)[0]].name == "door"
    assert (depth > leaf_depth + 8).all()


def test_the_floor_is_a_plane_between_the_rails():
    mesh = build_container("40")
    x = np.arange(-5500, 5500, 1.0)
    points = np.column_stack([x, np.full(len(x), 300.0), np.zeros(len(x))])
    triangle, depth = depths(mesh, "underside", points)
    assert (chart_of(mesh, triangle) == mesh.chart_index("underside")).all()
    assert depth == pytest.approx(145, abs=0.01)


@pytest.mark.parametrize(
    ("kind", "limit"), [("20", 27_000), ("40", 43_000), ("40HC", 45_000), ("45HC", 49_500)]
)
def test_triangle_count_stays_within_its_budget(kind, limit):
    assert len(build_container(kind).triangles) < limit


@pytest.mark.parametrize("kind", ["20", "45HC"])
def test_the_outline_is_the_same_surface_with_fewer_triangles(kind):
    fine, outline = build_container(kind), container_outline(kind)
    assert len(outline.triangles) < 0.4 * len(fine.triangles)
    rng = np.random.default_rng(2)
    toward = rng.normal(size=(4000, 3))
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    low, high = fine.bounds_mm
    eyes = rng.uniform(low, high, (4000, 3)) - 20_000 * toward
    (hit, far), (as_well, as_far) = (first_hits(mesh, eyes, toward) for mesh in (fine, outline))
    both = (hit >= 0) & (as_well >= 0)
    assert both.mean() > 0.9
    # at an edge a ray may miss one of the two meshes
    assert (both == ((hit >= 0) | (as_well >= 0))).mean() > 0.999
    assert np.isclose(far[both], as_far[both], rtol=0, atol=0.05).mean() > 0.999


def test_meshes_are_read_only():
    mesh = build_container("20")
    with pytest.raises(ValueError, match="read-only"):
        mesh.positions_mm[0] = 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: build_container("41"), "41"),
        (lambda: build_container("20", max_edge_mm=0.0), "max_edge_mm"),
        (lambda: Wave(278, 36, 72, 68, 71), "pitch_mm"),
        (lambda: check_fields(Wave(278, 500, 72, 68, 70), Wave, "wave"), "depth_mm"),
        (lambda: check_fields(Wave(278, 36, 142, 68, 0), Wave, "wave"), "inner_mm"),
        (lambda: check_fields(Wave(20, 5, 5, 5, 5), Wave, "wave"), "pitch_mm"),
        (lambda: build_container("20").sheet_to_surface("lid", [[0, 0]]), "lid"),
    ],
)
def test_bad_input_is_named_in_one_line(make, message):
    with pytest.raises(ConfigError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
