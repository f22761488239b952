"""Light that surfaces throw on a spreader, against rays and sums."""

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config, Generator
from fastgen.classes import SPREADER_ID
from fastgen.container import build_container, container_outline
from fastgen.interreflection import Cells, form_factors
from fastgen.occluders import without_cables
from fastgen.openness import sky_directions
from fastgen.sky_probe import probe_points
from fastgen.spreader import build_spreader

KIND = "20"


@pytest.fixture(scope="module")
def world():
    """Container, spreader and where that sees from; Embree's rays against either."""
    container, spreader = build_container(KIND), build_spreader(KIND)
    solids = [container, without_cables(spreader)]
    casters = [
        RayMeshIntersector(
            trimesh.Trimesh(s.positions_mm, s.triangles.astype(np.int64), process=False)
        )
        for s in solids
    ]
    return container, spreader, probe_points(spreader, np.inf), casters


def hits(caster, start, toward):
    """Where rays [K] first meet a body, [K, 3] and its normals there; nowhere is nan."""
    met = np.full(start.shape, np.nan)
    normals = np.full(start.shape, np.nan)
    where, ray, triangle = caster.intersects_location(start, toward, multiple_hits=False)
    met[ray], normals[ray] = where, caster.mesh.face_normals[triangle]
    return met, normals


@pytest.fixture(scope="module")
def factors(world, tmp_path_factory):
    _, spreader, points, casters = world
    toward = sky_directions()
    start = np.repeat(points, len(toward), axis=0)
    rays = np.tile(toward, (len(points), 1))
    hidden = np.logical_or(*(caster.intersects_any(start, rays) for caster in casters))
    body = without_cables(build_spreader(KIND, cut_mm=np.inf))
    held = container_outline(KIND)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        return form_factors(
            spreader, body, held, points, toward, hidden.reshape(len(points), len(toward))
        )


@pytest.fixture(scope="module")
def outside(world):
    """Of 500 vertices those that are not within a body: no ray from them meets one from behind.
    Twist locks stand in the castings, within the container's box."""
    _, spreader, points, casters = world
    locks = [".locks." in chart.name for chart in spreader.charts]
    free = np.flatnonzero(~np.array(locks)[spreader.chart])
    chosen = np.random.default_rng(1).choice(free, 500, replace=False)
    toward = sky_directions()
    return [
        vertex
        for vertex in chosen
        if not any(
            ((normal * toward).sum(axis=1) > 0).any()
            for caster in casters
            for _, normal in [hits(caster, np.tile(points[vertex], (len(toward), 1)), toward)]
        )
    ]


def by_rays(world, glow, of):
    """Irradiance / pi [K, 3] of vertices of the spreader, by 800 rays each, off bodies that glow:
    radiance [N, 3] of a body's number, of places and of normals."""
    _, spreader, points, casters = world
    step = np.arange(1600)
    height = 1 - (2 * step + 1) / 1600
    turn = step * 2.399963  # the golden angle
    flat = np.sqrt(1 - height**2)
    directions = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
    found = []
    for vertex in of:
        facing = directions[directions @ spreader.normals[vertex] > 0]
        weight = facing @ spreader.normals[vertex]
        start = np.tile(points[vertex], (len(facing), 1))
        met = [hits(caster, start, facing) for caster in casters]
        away = np.array([np.linalg.norm(place - start, axis=1) for place, _ in met])
        first = np.where(np.isnan(away), 1e9, away).argmin(axis=0)
        light = np.zeros((len(facing), 3))
        for number, (place, normal) in enumerate(met):
            mine = (first == number) & np.isfinite(away[number])
            light[mine] = glow(number, place[mine], normal[mine])
        found.append((weight[:, None] * light).sum(axis=0) / weight.sum())
    return np.array(found)


def pattern(places):
    """A radiance [K, 3] that changes along the container, across it and upward."""
    x, y, z = np.asarray(places).T
    return np.stack([1 + x / 6000, 1 + y / 3000, z / 3000], axis=1)


def test_light_off_the_container_is_what_rays_bring(world, factors, outside):
    container, spreader, _, _ = world
    cells = Cells.of(container, container_outline(KIND)).mean(pattern(container.positions_mm))
    none = np.zeros((len(spreader.positions_mm), 3))
    found = factors.thrown(none, cells, none)[outside]
    expected = by_rays(world, lambda body, place, _: pattern(place) * (body == 0), outside)
    assert len(outside) > 200
    assert expected.mean() > 0.1
    assert np.abs(found - expected).mean() < 0.03
    assert np.abs((found - expected).mean(axis=0)).max() < 0.006


def test_light_off_the_spreader_itself_is_what_rays_bring(world, factors, outside):
    """Off its upper and its lower faces, unlike; so dim that what bounces again does not count."""
    _, spreader, _, _ = world

    def glow(normals):
        up = normals[:, 2:]
        return np.concatenate([up > 0.5, up < -0.5, np.abs(up) < 0.5], axis=1).astype(float)

    lit = glow(spreader.normals)
    dim = 1e-4
    found = (factors.thrown(lit, np.zeros((1000, 3)), np.full(lit.shape, dim)) / dim)[outside]
    expected = by_rays(world, lambda body, _, normal: glow(normal) * (body == 1), outside)
    assert expected.mean() > 0.03
    assert np.abs(found - expected).mean() < 0.03
    assert np.abs((found - expected).mean(axis=0)).max() < 0.006


def test_two_bounces_are_a_geometric_sum(factors, world):
    """Twice the paint gives twice the first bounce and four times the second."""
    _, spreader, _, _ = world
    lit = np.ones((len(spreader.positions_mm), 3))
    dark = np.zeros((1000, 3))
    once, twice, thrice = (factors.thrown(lit, dark, k * lit) for k in (0.1, 0.2, 0.3))
    assert once.max() > 0.02
    second = (twice - 2 * once) / 2  # of 0.1
    np.testing.assert_allclose(thrice, 3 * (once - second) + 9 * second, atol=1e-5)
    assert second.max() > 0.002


def test_light_is_neither_lost_nor_made(factors, outside):
    """Sky and surfaces make up a vertex's hemisphere, but for what is within a body."""
    assert factors.known.max() < 1 + 1e-5
    assert np.median(factors.known[outside]) > 0.999
    assert np.quantile(factors.known[outside], 0.05) > 0.95


def test_the_roofs_paint_shows_below_the_spreader():
    """A red roof and a blue one; the beams are the same grey."""
    reddish = []
    for color in ("#c01010", "#1010c0"):
        config = Config.from_values(
            {
                "surface": {"colors": {"paint": color}, "rust_coverage": 0.0},
                "spreader": {"probability": 1.0, "colors": ["#808080"]},
                "environment": {"names": ["port_overcast"]},
                "damage": {"probability": 0.0},
                "cameras": {"low": {"face": "no_door", "focal_mm": 45, "distance_mm": 6000}},
            }
        )
        with Generator(config, seed=4, size=(160, 160)) as generator:
            sample = generator.render(index=0)
        seen = sample.image[sample.ids == SPREADER_ID].astype(float)
        reddish.append(seen[:, 0] - seen[:, 2])
    difference = reddish[0] - reddish[1]
    assert np.quantile(difference, 0.99) > 20
    assert np.abs(np.median(difference)) < 5  # what faces outward
