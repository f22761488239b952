"""Indirect light on a spreader, compared with rays and sums."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config, Generator
from fastgen.classes import SPREADER_ID
from fastgen.geometry.container import build_container, container_outline
from fastgen.geometry.mesh import MATERIALS
from fastgen.geometry.solids import without_cables
from fastgen.geometry.spreader import build_spreader
from fastgen.light import indirect_light as interreflection
from fastgen.light.directional_lights import DirectionalLight
from fastgen.light.environment import Ambient, prefilter_environment
from fastgen.light.indirect_light import Cells, form_factors
from fastgen.light.sky_visibility import Sky, sky_directions
from fastgen.render.gl import open_context
from fastgen.render.sky_visibility_probe import LitMesh, SkyVisibilityProbe, probe_points

KIND = "20"
ROOF, BEAM = np.array([0.8, 0.4, 0.2]), np.array([0.1, 0.2, 0.3])
TO_SUN, SUN = np.array([0.48, -0.36, 0.8]), np.array([4.0, 3.0, 2.0])


@pytest.fixture(scope="module")
def world():
    """Container, spreader, probe points of the spreader, and an Embree ray caster for each body."""
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
    """Return the first hits of rays on a body and the normals there, [K, 3], NaN for misses."""
    places = np.full(start.shape, np.nan)
    normals = np.full(start.shape, np.nan)
    where, ray, triangle = caster.intersects_location(start, toward, multiple_hits=False)
    places[ray], normals[ray] = where, caster.mesh.face_normals[triangle]
    return places, normals


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
    """Vertices outside both bodies, out of 500 random ones: no ray from them hits a back face."""
    _, _, points, casters = world
    chosen = np.random.default_rng(1).choice(len(points), 500, replace=False)
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


def evenly(count):
    """Return unit vectors [count, 3] spread evenly over the sphere."""
    step = np.arange(count)
    height = 1 - (2 * step + 1) / count
    turn = step * 2.399963  # the golden angle
    flat = np.sqrt(1 - height**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)


def by_rays(world, glow, of):
    """Return irradiance / pi [K, 3] at spreader vertices `of`, by 800 rays to glowing bodies.

    `glow` maps body number (0 container, 1 spreader), places [N, 3] and normals [N, 3] to radiance
    [N, 3].
    """
    _, spreader, points, casters = world
    directions = evenly(1600)
    found = []
    for vertex in of:
        facing = directions[directions @ spreader.normals[vertex] > 0]
        weight = facing @ spreader.normals[vertex]
        start = np.tile(points[vertex], (len(facing), 1))
        hits_of = [hits(caster, start, facing) for caster in casters]
        away = np.array([np.linalg.norm(place - start, axis=1) for place, _ in hits_of])
        first = np.where(np.isnan(away), 1e9, away).argmin(axis=0)
        light = np.zeros((len(facing), 3))
        for number, (place, normal) in enumerate(hits_of):
            mine = (first == number) & np.isfinite(away[number])
            light[mine] = glow(number, place[mine], normal[mine])
        found.append(weight @ light / weight.sum())
    return np.array(found)


def pattern(places):
    """Return a radiance [K, 3] that varies along, across and up the container."""
    x, y, z = np.asarray(places).T
    return np.stack([1 + x / 6000, 1 + y / 3000, z / 3000], axis=1)


def test_light_from_the_container_matches_rays(world, factors, outside):
    container, spreader, _, _ = world
    cells = Cells.of(container, container_outline(KIND)).mean(pattern(container.positions_mm))
    none = np.zeros((len(spreader.positions_mm), 3))
    found = factors.light(none, none, cells, none)[outside]
    expected = by_rays(world, lambda body, place, _: pattern(place) * (body == 0), outside)
    assert len(outside) > 200
    assert expected.mean() > 0.1
    assert np.abs(found - expected).mean() < 0.03
    assert np.abs((found - expected).mean(axis=0)).max() < 0.006


def test_light_from_the_spreader_itself_matches_rays(world, factors, outside):
    """Upper, lower and side faces glow in one channel each, too dimly for a second bounce."""
    _, spreader, _, _ = world

    def glow(normals):
        up = normals[:, 2:]
        return np.concatenate([up > 0.5, up < -0.5, np.abs(up) < 0.5], axis=1).astype(float)

    glowing = glow(spreader.normals)
    dim = 1e-4
    dark = np.zeros((1000, 3))
    paint = np.full(glowing.shape, dim)
    found = (factors.light(0 * glowing, glowing, dark, paint) / dim)[outside]
    expected = by_rays(world, lambda body, _, normal: glow(normal) * (body == 1), outside)
    assert expected.mean() > 0.03
    assert np.abs(found - expected).mean() < 0.03
    assert np.abs((found - expected).mean(axis=0)).max() < 0.006


def test_light_comes_from_the_face_that_a_ray_hits(world, factors, outside):
    """Each plane has its own brightness, so taking a parallel face nearby would be an error."""
    _, spreader, _, _ = world

    def glow(places, normals):
        plane_mm = (places * normals).sum(axis=1, keepdims=True)
        return np.tile(1 + np.sin(plane_mm * (2 * np.pi / 70)), 3)

    glowing = glow(spreader.positions_mm, spreader.normals)
    dim = 1e-4
    found = factors.light(0 * glowing, glowing, np.zeros((1000, 3)), np.full(glowing.shape, dim))
    expected = by_rays(world, lambda body, *hit: glow(*hit) * (body == 1), outside)
    off = np.abs(found[outside] / dim - expected)[:, 0]
    assert expected.mean() > 0.03
    assert off.mean() < 0.04
    assert np.quantile(off, 0.99) < 0.3


def test_two_bounces_are_a_geometric_sum(factors, world):
    """Twice the paint gives twice the first bounce and four times the second."""
    _, spreader, _, _ = world
    sun = np.ones((len(spreader.positions_mm), 3))
    dark = np.zeros((1000, 3))
    once, twice, thrice = (factors.light(0 * sun, sun, dark, k * sun) for k in (0.1, 0.2, 0.3))
    assert once.max() > 0.02
    second = (twice - 2 * once) / 2  # for paint of 0.1
    np.testing.assert_allclose(thrice, 3 * (once - second) + 9 * second, atol=1e-5)
    assert second.max() > 0.002


def test_energy_is_conserved(factors, outside):
    """Sky and surfaces together fill the hemisphere of a vertex, unless it is inside a body."""
    assert factors.known.max() < 1 + 1e-5
    assert np.median(factors.known[outside]) > 0.999
    assert np.quantile(factors.known[outside], 0.05) > 0.95


def by_sky_and_sun(world, points, normals):
    """Return irradiance / pi [K, 3] from a uniform sky of radiance 1 (200 rays) and the sun."""
    casters = world[3]
    toward, start = evenly(200), points + 3 * normals
    cosine = np.maximum(normals @ toward.T, 0)
    far, rays = np.repeat(start, len(toward), axis=0), np.tile(toward, (len(points), 1))
    hidden = np.logical_or(*(caster.intersects_any(far, rays) for caster in casters))
    open_to = (cosine * ~hidden.reshape(cosine.shape)).sum(axis=1) / cosine.sum(axis=1)
    rays = np.tile(TO_SUN, (len(points), 1))
    shaded = np.logical_or(*(caster.intersects_any(start, rays) for caster in casters))
    return open_to[:, None] + (np.maximum(normals @ TO_SUN, 0) * ~shaded)[:, None] * SUN


@pytest.fixture(scope="module")
def lit(world, tmp_path_factory):
    """Function that returns the probe's light on the spreader under a uniform sky of radiance 1.

    Its arguments are the sun's light, the albedo of the container's sheets, that of the spreader,
    and optionally the light on the container. Any other material would be far too bright.
    """
    container, spreader, _, _ = world
    ambient = Ambient.of(prefilter_environment("even", np.ones((64, 128, 3), np.float32)))
    outline, held = build_spreader(KIND, cut_mm=np.inf), container_outline(KIND)
    with pytest.MonkeyPatch.context() as patch, open_context() as gl:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        probe = SkyVisibilityProbe(gl.ctx)

        def found(sun, roof, beam, below=None):
            sky = Sky(
                replace(ambient, lights=(DirectionalLight(tuple(TO_SUN), tuple(sun), 0.005),)), 0.0
            )
            used = {"paint_sheet": roof, **{chart.material: beam for chart in spreader.charts}}
            paints = tuple(tuple(used.get(material, 50 * ROOF)) for material in MATERIALS)
            below = below or probe.container_light(container, held, spreader, sky)
            return probe.spreader_light(spreader, outline, held, below, sky, paints)

        yield found
        probe.release()


BLACK, WHITE = np.zeros(3), np.ones(3)


def stored(values):
    """Return the light [V, 3] that the shader decodes, for a uniform sky of irradiance 1."""
    values = values.astype(float)
    return values[:, 4:7] / 127 * (1 + values[:, 7:8] / 4)


def test_all_light_on_a_spreader_matches_rays(world, outside, lit):
    """Test light from sky and sun: direct, off the container, and off the spreader itself."""
    _, spreader, points, _ = world
    chosen = outside[::3]
    dark, roof, beam = lit(SUN, BLACK, BLACK), lit(SUN, ROOF, BLACK), lit(SUN, BLACK, BEAM)
    arriving = by_sky_and_sun(world, points[chosen], spreader.normals[chosen])
    for found in (dark, roof, beam):
        with_sun = found.irradiance - stored(found.values)
        np.testing.assert_allclose(with_sun, dark.irradiance - stored(dark.values), atol=0.02)
    assert np.abs((dark.irradiance[chosen] - arriving).mean(axis=0)).max() < 0.03 * arriving.mean()
    for body, (some, paint) in enumerate(((roof, ROOF), (beam, BEAM))):
        expected = by_rays(
            world,
            lambda number, place, normal, body=body, paint=paint: (
                paint * by_sky_and_sun(world, place, normal) * (number == body)
            ),
            chosen,
        )
        found = (stored(some.values) - stored(dark.values))[chosen]
        ratio = found.mean(axis=0) / expected.mean(axis=0)
        assert (np.abs(ratio - 1.1) < 0.15).all()  # coarse cells are too bright below the beams
        assert np.corrcoef(found.ravel(), expected.ravel())[0, 1] > 0.85


def test_in_a_white_furnace_a_spreader_is_as_bright_as_the_sky(world, lit, monkeypatch):
    """This includes vertices inside a body, whose rays see only part of the surroundings."""
    monkeypatch.setattr(interreflection, "_BOUNCES", 100)
    container, spreader, _, _ = world
    count = len(container.positions_mm)
    glowing = LitMesh(
        container, np.zeros((count, 0), np.uint8), *[np.ones((count, 3), np.float32)] * 2
    )
    light = lit(BLACK, WHITE, WHITE, glowing).irradiance
    locks = [".locks." in chart.name for chart in spreader.charts]
    assert light.max() < 1 + 1e-4
    assert np.quantile(light[~np.array(locks)[spreader.chart]], 0.1) > 0.99


def test_other_hidden_directions_give_other_form_factors(world, tmp_path, monkeypatch):
    """The disk cache must not confuse two inputs that differ only in the hidden directions."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    _, spreader, points, _ = world
    toward = sky_directions()
    body, held = without_cables(build_spreader(KIND, cut_mm=np.inf)), container_outline(KIND)
    all_hidden = np.ones((len(points), len(toward)), bool)
    upper_hidden = all_hidden & (toward[:, 2] > 0)
    cells = np.ones((1000, 3))
    dark = np.zeros((len(points), 3))
    found = [
        form_factors(spreader, body, held, points, toward, hidden).light(dark, dark, cells, dark)
        for hidden in (all_hidden, upper_hidden)
    ]
    assert found[0].mean() > 0.1
    # the container is below the spreader, except that it is beside the flippers
    assert found[1].mean() < 0.1 * found[0].mean()


def test_the_paint_of_the_roof_tints_the_spreader_above_it():
    """Compare a red and a blue roof under the same grey beams."""
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
    assert np.abs(np.median(difference)) < 5  # faces that do not see the roof


def test_a_hit_is_represented_by_the_best_of_all_vertices():
    """Compared by brute force, on random points of the triangles."""
    spreader = build_spreader(KIND)
    rng = np.random.default_rng(3)
    triangle = rng.integers(len(spreader.triangles), size=400)
    corners = spreader.positions_mm[spreader.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    shares = rng.dirichlet((1, 1, 1), len(triangle))[..., None]
    places = (shares * corners[triangle]).sum(axis=1)
    found = interreflection._representatives(places, normals, triangle, spreader)
    away = places[:, None] - spreader.positions_mm
    normal = normals[triangle][:, None]
    turned = 1000 / 2**0.5 * (normal - spreader.normals)
    off = 20 * (away * normal).sum(axis=-1)
    apart = (away**2).sum(axis=-1) + (turned**2).sum(axis=-1) + off**2
    rows = np.arange(len(places))
    np.testing.assert_allclose(apart[rows, found], apart.min(axis=1), rtol=1e-3, atol=1e-3)
