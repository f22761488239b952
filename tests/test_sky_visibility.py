"""Sky visibility compared with ray casts and integrals."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config
from fastgen.classes import SPREADER_ID
from fastgen.geometry.container import build_container, container_outline
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.spreader import build_spreader
from fastgen.light.directional_lights import DirectionalLight
from fastgen.light.environment import Ambient, prefilter_environment, sky_irradiance
from fastgen.light.sky_visibility import (
    Sky,
    SkyVisibility,
    encoded_cones,
    lobe_masks,
    open_sky,
    sky_directions,
)
from fastgen.render import settings
from fastgen.render.gl import open_context
from fastgen.render.sky_visibility_probe import SkyVisibilityProbe, probe_points
from fastgen.render.visibility_buffer import VisibilityBuffer
from tests.backends import needs_osmesa
from tests.mesh_probe import behind_the_middle


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def decoded(values):
    """Return the bent normals [V, 3] and visible shares [V] stored in `values`, uint8 [V, 3+]."""
    cone = (values[:, :3].astype(float) - 128) / 127
    length = np.linalg.norm(cone, axis=1)
    return cone / length[:, None], 1 - np.clip(2 - 2 * length, 0, 1) ** 2


def sphere():
    """Return directions [H, 2H, 3] and solid angles [H, 1] of an equirectangular map around +x."""
    height = 256
    polar = np.pi * (np.arange(height) + 0.5)[:, None] / height
    around = np.pi - np.pi * (np.arange(2 * height) + 0.5) / height
    flat = np.sin(polar)
    toward = [flat * np.cos(around), flat * np.sin(around), np.cos(polar) + 0 * around]
    return np.stack(toward, axis=-1), flat * (np.pi / height) ** 2


def light_of(radiance):
    """Return the Ambient of `radiance`, a function from directions to radiance, both [..., 3]."""
    return Ambient.of(prefilter_environment("made", radiance(sphere()[0]).astype(np.float32)))


def even(d):
    return np.ones(d.shape)


def sunset(d):
    """Radiance of a dim blue sky with a warm glow on one side, above dark ground."""
    glow = np.exp(4 * (d @ np.array([0.6, 0.75, 0.28]) - 1))[..., None] * [6.0, 3.0, 1.0]
    return np.where(d[..., 2:] > 0, [0.15, 0.3, 0.6] + glow, 0.08)


@pytest.fixture(scope="module")
def even_sky():
    return Sky(light_of(even), 0.0)


def rays_open(meshes, points, directions):
    """Return bool [K]: True if the ray from a point [K, 3] misses all meshes."""
    free = np.ones(len(points), bool)
    for mesh in meshes:
        body = trimesh.Trimesh(mesh.positions_mm, mesh.triangles.astype(np.int64), process=False)
        free &= ~RayMeshIntersector(body).intersects_any(points, directions)
    return free


def test_an_open_sky_is_fully_visible_with_the_normal_as_bent_normal():
    normals = np.random.default_rng(0).normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for values in (encoded_cones(normals, np.ones((1, 1), bool)), open_sky(normals)):
        direction, share = decoded(values)
        assert (share > 0.999).all()
        np.testing.assert_allclose(direction, normals, atol=0.01)


def test_a_wall_halves_sky_visibility_and_tilts_the_bent_normal():
    """Only +x is open: half the light, with mean direction (2/3, 0, pi/3) by integration."""
    open_to = (sky_directions()[:, 0] > 0)[None]
    direction, share = decoded(encoded_cones(np.array([[0.0, 0.0, 1.0]]), open_to))
    assert share[0] == pytest.approx(0.5, abs=0.03)
    expected = np.array([2 / 3, 0, np.pi / 3])
    np.testing.assert_allclose(direction[0], expected / np.linalg.norm(expected), atol=0.05)


def half_open(normals, side):
    """Return the sky visibility of surfaces that see only the half sphere around `side` [3]."""
    open_to = np.tile(sky_directions() @ side > 0, (len(normals), 1))
    return SkyVisibility.of(normals, np.packbits(open_to, axis=1), encoded_cones(normals, open_to))


def facing(count):
    """Return random unit normals, float32 [count, 3]."""
    normals = np.random.default_rng(2).normal(size=(count, 3)).astype(np.float32)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("yaw_deg", [0.0, 200.0])
@pytest.mark.parametrize("radiance", [even, sunset])
def test_light_beside_a_wall_is_the_integral_over_the_visible_sky(radiance, yaw_deg):
    normals = facing(60)
    side = np.array([0.36, -0.48, 0.8])
    values = half_open(normals, side).vertex_bytes(Sky(light_of(radiance), yaw_deg))
    d, solid_angle = sphere()
    cos, sin = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
    world = d @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    light = radiance(d) * solid_angle[..., None]

    def integral(about, where=True):
        weight = np.where(where, np.maximum(world @ about, 0), 0)
        return np.tensordot(weight, light, 2)

    off = []
    for normal, direction, steps in zip(normals, decoded(values)[0], values[:, 4:7], strict=True):
        expected = integral(normal, world @ side > 0)
        found = steps / 127 * integral(direction)  # decoded as in the shader
        off.append((found - expected) / integral(normal))
    # the sum has 96 directions, each either fully visible or fully hidden
    assert (np.sqrt(np.mean(np.square(off), axis=0)) < 0.04).all()
    assert (np.abs(np.mean(off, axis=0)) < 0.02).all()


def test_equal_vertices_are_lit_as_when_alone():
    """Light is computed once per distinct vertex; order and batching must not change it."""
    rng = np.random.default_rng(11)
    normals = facing(12)
    open_to = rng.random((12, 96)) < rng.random((12, 1))
    bits, cones = np.packbits(open_to, axis=1), encoded_cones(normals, open_to)
    lights = (
        DirectionalLight((0.6, 0.0, 0.8), (3.0, 2.0, 1.0), 0.005),
        DirectionalLight((0.0, 0.8, 0.6), (9, 9, 9), 0.01),
    )
    sky = Sky(replace(light_of(sunset), lights=lights), 40.0)
    alone = [SkyVisibility.of(*(part[[i]] for part in (normals, bits, cones))) for i in range(12)]
    mixed = rng.integers(0, 12, 500)
    together = SkyVisibility.of(normals[mixed], bits[mixed], cones[mixed])
    np.testing.assert_array_equal(together.visible, open_to[mixed])
    light, sun = together.irradiance(sky), together.directional_irradiance(sky)
    for found, of_one in ((light, "irradiance"), (sun, "directional_irradiance")):
        expected = np.concatenate([getattr(one, of_one)(sky) for one in alone])
        np.testing.assert_allclose(found, expected[mixed], rtol=1e-5, atol=1e-6)
    values = np.concatenate([one.vertex_bytes(sky) for one in alone])[mixed].astype(int)
    assert (
        np.abs(together.vertex_bytes(sky) - values).max() <= 1
    )  # one-row products round differently
    for found, expected in zip(
        together.lit(sky), (together.vertex_bytes(sky, light), light + sun, light), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


def test_a_fully_visible_sky_gives_full_light():
    normals = facing(100)
    bits = np.full((100, 12), 255, np.uint8)
    whole = SkyVisibility.of(normals, bits, open_sky(normals)[:, :3])
    for radiance in (even, sunset):
        assert (whole.vertex_bytes(Sky(light_of(radiance), 30.0)) == open_sky(normals)).all()


def test_light_may_be_much_brighter_than_the_sky_around_the_bent_normal():
    """Sunlit roofs above dark ground need this. Beyond a ratio of 130 only the colour is kept."""
    normals = facing(2000)
    visibility = half_open(normals, np.array([0.0, 0.0, 1.0]))
    sky = Sky(light_of(sunset), 70.0)
    about = decoded(visibility.vertex_bytes(sky))[0]
    whole = sky_irradiance(sky.light, about.astype(np.float32), sky.yaw_deg)
    ratio = 10 ** np.random.default_rng(7).uniform(-2, 2, (2000, 3))
    values = visibility.vertex_bytes(sky, whole * ratio).astype(float)
    found = values[:, 4:7] / 127 * (1 + values[:, 7:8] / 4)  # decoded as in the shader
    brightest = np.maximum(ratio.max(axis=1, keepdims=True), 1)
    assert (np.abs(found - ratio) / brightest).max() < 0.005
    values = visibility.vertex_bytes(sky, whole * [3000.0, 1500.0, 300.0]).astype(int)
    assert (values[:, 7] == 255).all()
    np.testing.assert_allclose(values[:, 4:7], np.tile([[255, 127.5, 25.5]], (2000, 1)), atol=1)


def test_under_an_even_sky_light_equals_sky_visibility(even_sky):
    values = half_open(facing(200), np.array([0.6, 0.0, 0.8])).vertex_bytes(even_sky)
    # the stored cone length has steps of 1/127, which change a small share by up to 4/127
    for channel in values[:, 4:7].T:
        np.testing.assert_allclose(channel / 127, decoded(values)[1], atol=0.04)


@pytest.mark.parametrize("yaw_deg", [0.0, 130.0])
def test_sunlight_reaches_surfaces_that_see_the_sun(yaw_deg):
    ambient = replace(
        light_of(even), lights=(DirectionalLight((0.6, 0.0, 0.8), (3.0, 2.0, 1.0), 0.005),)
    )
    yaw = np.deg2rad(yaw_deg)
    sun = np.array([0.6 * np.cos(yaw), 0.6 * np.sin(yaw), 0.8])
    normals = facing(50)
    cosine = np.maximum(normals @ sun, 0)[:, None]
    for side, share in ((sun, 1.0), (-sun, 0.0)):
        found = half_open(normals, side).directional_irradiance(Sky(ambient, yaw_deg))
        np.testing.assert_allclose(found, share * cosine * [3.0, 2.0, 1.0], atol=1e-5)
    edge = half_open(normals, np.cross(sun, [0.0, 0.0, 1.0])).directional_irradiance(
        Sky(ambient, yaw_deg)
    )
    partly = edge[cosine[:, 0] > 0.1, 0] / (3 * cosine[cosine[:, 0] > 0.1, 0])
    assert (partly > 0.2).all()
    assert (partly < 0.8).all()
    assert not half_open(normals, sun).directional_irradiance(Sky(light_of(even), yaw_deg)).any()


def test_sunlight_of_several_suns_adds_up():
    lamps = (
        DirectionalLight((0.6, 0.0, 0.8), (3.0, 2.0, 1.0), 0.005),
        DirectionalLight((0.0, 0.8, 0.6), (0.5, 1.0, 2.0), 0.005),
        DirectionalLight((0.0, -0.28, 0.96), (0.1, 0.1, 0.4), 0.005),
    )
    visibility = half_open(facing(50), np.array([0.6, 0.64, 0.48]))

    def lit_by(lights):
        return visibility.directional_irradiance(Sky(replace(light_of(even), lights=lights), 20.0))

    each = [lit_by((lamp,)) for lamp in lamps]
    assert all(found.max() > 0.05 for found in each)
    np.testing.assert_allclose(lit_by(lamps), sum(each), atol=1e-6)


def test_a_black_sky_gives_defined_light():
    normals = facing(50)
    black = Sky(light_of(lambda d: np.zeros(d.shape)), 0.0)
    values = half_open(normals, np.array([0.0, 0.0, 1.0])).vertex_bytes(black)
    assert values[:, 4:7].max() <= 128


@pytest.mark.parametrize("kind", ["20", "45HC"])
@pytest.mark.parametrize("held", [False, True])
def test_sky_visibility_equals_ray_casts(gl, even_sky, kind, held):
    container = build_container(kind)
    spreader = build_spreader(kind) if held else None
    probe = SkyVisibilityProbe(gl.ctx)
    outline = container_outline(kind)
    found = probe.container_light(container, outline, spreader, even_sky).values
    share = found[:, 4] / 127
    probe.release()
    sheets = [i for i, c in enumerate(container.charts) if c.face != "underside"]
    rng = np.random.default_rng(1)
    chosen = rng.choice(np.flatnonzero(np.isin(container.chart, sheets)), 800, replace=False)
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosine = np.maximum(container.normals[chosen] @ directions.T, 0)
    points = np.repeat(probe_points(container)[chosen], len(directions), axis=0)
    meshes = [container] if spreader is None else [container, spreader]
    free = rays_open(meshes, points, np.tile(directions, (len(chosen), 1)))
    expected = (cosine * free.reshape(cosine.shape)).sum(1) / cosine.sum(1)
    # rays from vertices buried in another part see nothing, but interpolation needs them bright
    error = (share[chosen] - expected)[expected > 0.02]
    assert len(error) > 600
    assert np.quantile(np.abs(error), 0.9) < 0.1
    assert abs(error.mean()) < 0.02


def test_no_vertex_sees_the_sky_through_the_container(gl, even_sky):
    """Creases are at risk: there a depth map holds only a thin sheet of the wall."""
    container, outline = build_container("20"), container_outline("20")
    probe = SkyVisibilityProbe(gl.ctx)
    bits = probe.container_light(container, outline, None, even_sky).values[:, 8:]
    probe.release()
    open_to = np.unpackbits(bits, axis=1).astype(bool)
    points = probe_points(container)
    found = 0
    for toward, seen in zip(sky_directions(), open_to.T, strict=True):
        behind = behind_the_middle(container, points, toward)
        found += behind.sum()
        assert not seen[behind].any()
    assert found > 100_000


def test_lobe_masks_contain_the_nearest_directions_and_the_hemisphere():
    cells = 16
    masks = np.unpackbits(lobe_masks(cells)[..., :3].view(np.uint8), axis=-1).astype(bool)
    directions = sky_directions()
    for row, column in np.random.default_rng(4).integers(0, cells, (40, 2)):
        x, y = (2 * (column + 0.5) / cells - 1, 2 * (row + 0.5) / cells - 1)
        z = 1 - abs(x) - abs(y)
        if z < 0:  # the corners of the octahedral square are the lower hemisphere
            x, y = (1 - abs(y)) * np.sign(x), (1 - abs(x)) * np.sign(y)
        toward = np.array([x, y, z])
        order = np.argsort(-directions @ toward)
        np.testing.assert_array_equal(np.sort(order[:8]), np.flatnonzero(masks[row, column]))
        below = masks[cells + row, column]
        np.testing.assert_array_equal(below, directions @ toward > 0)


def test_the_disk_cache_returns_the_computed_values(gl, even_sky, monkeypatch):
    meshes = build_container("20"), container_outline("20"), build_spreader("20")
    first = SkyVisibilityProbe(gl.ctx).container_light(*meshes, even_sky).values

    def never(*_: object) -> None:
        raise AssertionError("cached sky visibility was computed again")

    monkeypatch.setattr(SkyVisibilityProbe, "_visible", never)
    again = SkyVisibilityProbe(gl.ctx).container_light(*meshes, even_sky).values
    np.testing.assert_array_equal(again, first)


@needs_osmesa
def test_backends_compute_the_same_sky_visibility(even_sky):
    meshes = build_container("20"), container_outline("20"), None
    found = []
    for backend in ("egl", "osmesa"):
        with open_context(backend) as context:
            probe = SkyVisibilityProbe(context.ctx)
            found.append(probe.container_light(*meshes, even_sky).values)
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(("camera", "index"), [("A", 2), ("Cl", 5), ("Cr", 3)])
def test_sky_visibility_of_reflections_is_close_to_ray_casts(
    generators, camera, index, monkeypatch
):
    """Rays from visible points are spread by about 17 degrees around the mirror direction."""
    size = (96, 72)
    monkeypatch.setattr(settings.Quality, "samples_for", lambda *_: (1, 1))
    drawn = []
    monkeypatch.setattr(VisibilityBuffer, "end", lambda buffer: drawn.append(buffer.textures))
    undamaged = Config.from_values({"damage": {"probability": 0.0}})
    g = generators(undamaged, 8, size, quality="draft")
    scene = g.scene(index)
    sample = g.render(scene=scene, camera=camera, normals=True)
    g.gpu.renderer()  # makes its context current
    stored = np.frombuffer(drawn[-1]["sky_visibility_cones"].read(), np.uint8)
    stored = stored.reshape(*size[::-1], 4)
    found = stored[..., 3] / 255
    mesh = PreparedScene(scene).container
    start, rays = sample.view.rays()
    seen = (sample.ids > 0) & (sample.ids < SPREADER_ID)
    rays = rays[seen] / np.linalg.norm(rays[seen], axis=1, keepdims=True)
    normals = sample.normals[seen] @ sample.view.rotation
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    away = sample.depth[seen] / (rays @ sample.view.rotation[2])
    points = start + 1000 * away[:, None] * rays + 3 * normals
    mirrored = rays - 2 * (rays * normals).sum(1)[:, None] * normals
    spread = mirrored[:, None] + np.random.default_rng(5).normal(0, 0.29, (len(rays), 40, 3))
    ahead = (spread * normals[:, None]).sum(-1) > 0
    spreader = PreparedScene(scene).spreader.mesh
    meshes = [mesh] if spreader is None else [mesh, spreader]
    free = rays_open(meshes, np.repeat(points, 40, axis=0), spread.reshape(-1, 3))
    expected = (free.reshape(ahead.shape) & ahead).sum(1) / ahead.sum(1)
    error = found[seen] - expected
    assert np.abs(error).mean() < 0.1
    assert np.corrcoef(found[seen], expected)[0, 1] > 0.75
