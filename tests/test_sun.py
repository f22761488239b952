"""The sun taken out of an environment, and its shadow, against integrals and rays."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config, Generator
from fastgen.container import KINDS, build_container
from fastgen.damage import deform
from fastgen.environment import irradiance_at, load_environment, prefilter_environment
from fastgen.gl import open_context
from fastgen.occluders import without_cables
from fastgen.programs import link
from fastgen.scene import Camera, Damage, EnvironmentView, Spreader
from fastgen.sensor.light import light_of
from fastgen.sky_probe import probe_points
from fastgen.spreader import CABLE_TIER, build_spreader, tier_of_vertices
from fastgen.sun import MOST_SUNS, split_suns
from fastgen.sun_shadow import MAP_SIZE, ShadowMap
from tests.mesh_probe import behind_the_middle
from tests.plain import EVEN_PAINT
from tests.sky_samples import even_directions, one_light, texel_grid
from tests.test_environment import write_exr

TOWARD = np.array([0.6, -0.64, 0.48])
RADIUS = np.deg2rad(0.9)
DISC = np.array([9000.0, 8000.0, 6000.0])


def sunny(height=512):
    """A sky that brightens upward and to the sun, and a disc of constant radiance."""
    direction, solid_angle = texel_grid(height)
    sky = 1.0 + 0.5 * direction[..., 2:] + np.exp((direction @ TOWARD - 1)[..., None] / 0.01)
    sky = sky * np.array([0.5, 0.7, 1.0])
    disc = np.arccos(np.clip(direction @ TOWARD, -1, 1)) < RADIUS
    return (sky + disc[..., None] * DISC).astype(np.float32), direction, solid_angle, disc


def test_direction_light_and_radius_of_a_known_sun_are_found():
    radiance, _, solid_angle, disc = sunny()
    (sun,), rest = split_suns(radiance)
    assert np.degrees(np.arccos(sun.direction @ TOWARD)) < 0.05
    np.testing.assert_allclose(sun.light, DISC * solid_angle[disc].sum() / np.pi, rtol=0.01)
    assert sun.radius == pytest.approx(RADIUS, rel=0.05)
    assert rest.max() < 5


def test_sun_and_rest_together_light_surfaces_as_the_whole_does():
    radiance, direction, solid_angle, _ = sunny()
    light = prefilter_environment("sunny", radiance)
    assert len(light.suns) == 1
    normals = even_directions(40)
    cosine = np.maximum(direction.reshape(-1, 3) @ normals.T, 0) * solid_angle.reshape(-1, 1)
    expected = cosine.T @ radiance.reshape(-1, 3) / np.pi
    np.testing.assert_allclose(irradiance_at(light, normals), expected, rtol=0.02)


def test_an_even_sky_and_a_broad_lamp_have_no_sun():
    direction, _ = texel_grid(256)
    lamp = 50 * np.exp((direction @ TOWARD - 1)[..., None] / 0.02) * np.ones(3)
    for radiance in (np.ones_like(lamp), np.zeros_like(lamp), 0.1 + lamp):
        suns, rest = split_suns(radiance.astype(np.float32))
        assert suns == ()
        np.testing.assert_array_equal(rest, radiance.astype(np.float32))


LAMPS = np.array([[0.9, 0.3, 0.3], [-0.5, 0.8, 0.2], [0.2, -0.9, 0.4]])
LAMPS /= np.linalg.norm(LAMPS, axis=1, keepdims=True)


def night(toward, lights, height=512):
    """A dim sky with discs about directions [K, 3] that give lights [K, 3], irradiance / pi."""
    direction, solid_angle = texel_grid(height)
    sky = np.full((height, 2 * height, 3), 0.02)
    for way, light in zip(toward, lights, strict=True):
        disc = np.arccos(np.clip(direction @ way, -1, 1)) < RADIUS
        sky[disc] += np.pi * np.asarray(light) / solid_angle[disc].sum()
    return sky.astype(np.float32)


def test_lamps_of_a_night_are_found_brightest_first():
    lights = np.array([[0.2, 0.15, 0.1], [0.5, 0.5, 0.5], [0.1, 0.12, 0.2]])
    suns, rest = split_suns(night(LAMPS, lights))
    for sun, k in zip(suns, (1, 0, 2), strict=True):
        assert np.degrees(np.arccos(sun.direction @ LAMPS[k])) < 0.1
        np.testing.assert_allclose(sun.light, lights[k], rtol=0.02)
    np.testing.assert_allclose(rest, 0.02, rtol=1e-3)


def test_of_many_lamps_those_count_that_light_a_side_alone():
    """Five strong ones stand side by side, a faint one opposite; all light is kept."""
    turn = np.deg2rad([-40, -20, 0, 20, 40, 180])
    toward = np.stack([np.cos(turn), np.sin(turn), 0.2 + 0 * turn], axis=-1) / np.hypot(1, 0.2)
    strength = np.array([1.0, 1.1, 1.2, 1.3, 1.4, 0.2])[:, None] * np.ones(3)
    radiance = night(toward, strength)
    light = prefilter_environment("night", radiance)
    assert len(light.suns) == MOST_SUNS
    assert light.suns[-1].direction @ toward[-1] > 0.9999
    direction, solid_angle = texel_grid(512)
    normals = even_directions(40)
    cosine = np.maximum(direction.reshape(-1, 3) @ normals.T, 0) * solid_angle.reshape(-1, 1)
    expected = cosine.T @ radiance.reshape(-1, 3) / np.pi
    np.testing.assert_allclose(irradiance_at(light, normals), expected, rtol=0.02, atol=0.03)


@pytest.mark.parametrize("radiance", [sunny(128)[0], night(LAMPS, np.ones((3, 3)), 256)])
def test_suns_come_back_from_the_cache(tmp_path, radiance):
    file = write_exr(tmp_path / "sunny.exr", radiance)
    first = load_environment(file, tmp_path / "cache")
    assert first.suns
    assert load_environment(file, tmp_path / "cache").suns == first.suns


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


@pytest.mark.parametrize("suns", [1, 2, 3, 4])
def test_shadows_of_the_spreader_are_those_of_rays(gl, suns):
    """On all sheets that face a sun, high or low, by itself or one of several: the map says what
    Embree says."""
    ways = [(0.8, -0.58, 0.14), (0.55, -0.6, 0.58), (-0.7, 0.3, 0.4), (0.1, 0.9, 0.2)][:suns]
    ways = np.array(ways) / np.linalg.norm(ways, axis=1, keepdims=True)
    container, spreader = build_container("20"), build_spreader("20")
    program = link(gl.ctx, "occluder.vert", "occluder.frag", {})
    shadow = ShadowMap(gl.ctx, program)
    shadow.cast(container, without_cables(spreader), ways)
    depth = np.frombuffer(shadow.depth.read(alignment=1), np.float32).reshape(MAP_SIZE[::-1])
    eye_m = np.array([3.0, -9.0, 2.0])
    for toward, matrix in zip(ways, shadow.from_ray(eye_m), strict=True):
        check_against_rays(container, spreader, toward, depth, matrix, eye_m)
    shadow.release()


def check_against_rays(container, spreader, toward, depth, matrix, eye_m):
    lit = np.flatnonzero(container.normals @ toward > 0.1)
    picked = np.random.default_rng(0).choice(lit, 3000, replace=False)
    points = probe_points(container)[picked]
    at = (points / 1000 - eye_m) @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (at[:, :2] * MAP_SIZE).astype(int).T
    found = at[:, 2] <= depth[row, column]

    # around each point too: within a texel of a shadow's border the map may say either
    aside = np.cross(container.normals[picked], toward)
    steps = (aside, np.cross(container.normals[picked], aside))
    around = [np.zeros(3), *(sign * 10 * step for sign in (-1, 1) for step in steps)]
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
    # what lies within another part is seen by nobody
    body = trimesh.Trimesh(container.positions_mm, container.triangles.astype(np.int64))
    buried = RayMeshIntersector(body).intersects_any(points, container.normals[picked])
    clear = (free == free[0]).all(axis=0) & ~buried
    assert 0.05 < free[0, clear].mean() < 0.95
    assert (found == free[0])[clear].mean() > 0.98


def test_a_dent_shades_itself_as_rays_say(gl):
    """Under a raking sun, half of a deep dent lies in the shade of the other."""
    toward = np.array([0.93, -0.3, 0.2]) / np.linalg.norm([0.93, -0.3, 0.2])
    container = build_container("20")
    half_width = KINDS["20"].size_mm[1] / 2
    dent = Damage(
        "concave", "front", (0.0, -half_width, 1300.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0),
        (0.0, 1.0, 0.0), (900.0, 1400.0), 230.0,
    )  # fmt: skip
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
    shadow.cast(container, None, toward[None], (dent,))
    depth = np.frombuffer(shadow.depth.read(alignment=1), np.float32).reshape(MAP_SIZE[::-1])

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
    column, row = (uvd[:, :2] * MAP_SIZE).astype(int).T
    found = uvd[:, 2] <= depth[row, column]
    assert (found == around[1])[clear].mean() > 0.97
    shadow.release()


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_sun_along_an_axis_lights_what_is_outermost(gl, axis):
    container = build_container("20")
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
    shadow.cast(container, None, np.array([axis]))
    depth = np.frombuffer(shadow.depth.read(alignment=1), np.float32).reshape(MAP_SIZE[::-1])
    height = container.positions_mm @ axis
    outermost = (container.normals @ axis > 0.9) & (height > height.max() - 1)
    (matrix,) = shadow.from_ray(np.zeros(3))
    at = container.positions_mm[outermost] / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (at[:, :2] * MAP_SIZE).astype(int).T
    assert outermost.sum() > 10
    assert (at[:, 2] <= depth[row, column]).mean() > 0.9
    shadow.release()


@pytest.mark.parametrize("toward", [(0.95, 0.25, 0.12), (0.35, 0.9, 0.25), (-0.3, -0.8, 0.5)])
def test_what_has_the_container_before_the_sun_lies_in_its_shade(gl, toward):
    """A millimetre off the surface too, in every crease of rails, posts and walls."""
    toward = np.array(toward) / np.linalg.norm(toward)
    container = build_container("20")
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
    shadow.cast(container, None, toward[None])
    depth = np.frombuffer(shadow.depth.read(alignment=1), np.float32).reshape(MAP_SIZE[::-1])
    facing = container.normals @ toward > 0.05
    points = container.positions_mm[facing].astype(float) + container.normals[facing]
    behind = behind_the_middle(container, points, toward)
    (matrix,) = shadow.from_ray(np.zeros(3))
    at = points[behind] / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (at[:, :2] * MAP_SIZE).astype(int).T
    assert behind.sum() > 500
    assert (at[:, 2] > depth[row, column]).all()
    shadow.release()


def test_no_sunlight_leaks_through_a_wall(tmp_path):
    """The grooves of a wall that is turned away lie centimetres behind what the map holds."""
    toward = np.array([0.95, 0.25, 0.12])
    sky = np.full((512, 1024, 3), 0.2, np.float32)
    write_exr(tmp_path / "behind.exr", sky + one_light(toward, 3e5, 512))
    with Generator(seed=1, size=(640, 640), hdri_dir=tmp_path) as generator:
        scene = generator.scene(0)
        assert load_environment(tmp_path / "behind.exr").suns
        scene = replace(
            scene, environment=EnvironmentView("behind", 0.0), decals=(), damages=(),
            container=replace(scene.container, kind="20"), spreader=Spreader(),
        )  # fmt: skip
        half_length, _, height = np.array(KINDS["20"].size_mm) / 2
        width = KINDS["20"].size_mm[1]
        camera = Camera("near", (0, -9000, height), (0, 0, height), 45.0)
        sample = generator.render(scene=scene, camera=camera)
    corners = np.array([[x, -width / 2, z] for x in (-0.9, 0.9) for z in (0.3, 1.7)])
    corners *= (half_length, 1.0, height)
    (left, top), (right, bottom) = np.array(
        [f(sample.view.project(corners)[0], axis=0) for f in (np.min, np.max)]
    ).astype(int)
    wall = sample.image[top:bottom, left:right].astype(float).mean(axis=-1)
    assert (sample.ids[top:bottom, left:right] == 1).all()
    assert wall.max() < 2 * np.median(wall)


@pytest.mark.parametrize("quality", ["balanced", "high"])
def test_shadows_fall_where_they_do_without_antialiasing(quality):
    """Away from edges; looked up beside their place they would move by up to half the image."""
    config = Config.from_values(
        {
            "environment": {"names": ["park"]},
            "damage": {"probability": 0},
            "surface": {"rust_coverage": 0.0},
        }
    )
    soft = []
    for name in ("draft", quality):
        with Generator(config, 5, (320, 240), quality=name) as generator:
            sample = generator.render(0, "A")
        soft.append(cv2.GaussianBlur(sample.image.astype(np.float32), (0, 0), 2))
    inside = cv2.erode((sample.ids == 1).astype(np.uint8), np.ones((7, 7))) > 0
    assert inside.sum() > 5000
    apart = np.abs(soft[0] - soft[1]).max(axis=2)[inside]
    assert (apart > 20).mean() < 0.002


def test_edges_of_shadows_have_no_teeth(tmp_path):
    """A flipper's straight edge throws a straight one on the end beam, at 2 mm a pixel."""
    toward = np.array([0.3, -0.75, 0.6]) / np.linalg.norm([0.3, -0.75, 0.6])
    sky = np.full((512, 1024, 3), 0.2, np.float32)
    write_exr(tmp_path / "flat.exr", sky + one_light(toward, 1e5, 512))
    config = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
    half_length, height = KINDS["20"].size_mm[0] / 2, KINDS["20"].size_mm[2]
    target = (half_length - 12.0, -600.0, height + 15 + 260.0)
    place = (target[0] + 6000.0, *target[1:])
    camera = Camera("straight", place, target, 6000 / (2.0 * 400) * 36.0)
    with Generator(config, 1, (400, 160), "auto", tmp_path, "draft") as generator:
        scene = replace(
            generator.scene(0),
            environment=EnvironmentView("flat", 0.0),
            decals=(),
            container=replace(generator.scene(0).container, kind="20"),
            spreader=Spreader(True, (0.5, 0.5, 0.5), (False, False), 15.0),
        )
        image = generator.render(scene=scene, camera=camera).image
    strip = image[60:155, 100:180].astype(float).sum(axis=2)
    shade, light = strip[:, :20].mean(axis=1), strip[:, -20:].mean(axis=1)
    assert (light > 1.3 * shade).all()
    # how many columns of each row lie in the shade
    ends = ((light[:, None] - strip) / (light - shade)[:, None]).sum(axis=1)
    rows = np.arange(len(ends))
    apart = ends - np.polyval(np.polyfit(rows, ends, 1), rows)
    assert apart.std() < 0.33


def test_light_of_several_lamps_adds_up(tmp_path):
    """What an image shows under all of them is the sum of what each shows by itself."""
    toward = np.array([[0.9, 0.3, 0.3], [0.7, 0.6, 0.2], [0.6, -0.7, 0.4]])  # before the door
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    lights = np.array([[1.0, 1.0, 1.0], [0.6, 0.6, 0.6], [0.8, 0.8, 0.8]])
    for name, on in {"all": [0, 1, 2], "0": [0], "1": [1], "2": [2]}.items():
        write_exr(tmp_path / f"{name}.exr", night(toward[on], lights[on]) - np.float32(0.0199))
    surface = {**EVEN_PAINT, "colors": {"grey": "#808080"}}
    config = Config.from_values({"surface": surface, "damage": {"probability": 0}})
    light, inside = {}, np.ones((240, 240), bool)
    with Generator(config, 1, (240, 240), "auto", tmp_path, "draft") as generator:
        for name in ("all", "0", "1", "2"):
            scene = replace(generator.scene(0), environment=EnvironmentView(name, 0.0), decals=())
            camera = replace(scene.camera("Cr"), exposure_ev=-4.0)
            sample = generator.render(scene=scene, camera=camera)
            light[name] = light_of(sample.image).mean(axis=2) / generator.exposure(scene, camera)
            inside &= (sample.ids == 1) & (sample.image.max(axis=2) < 230)
    together, apart = light["all"][inside], sum(light[str(k)][inside] for k in range(3))
    assert inside.sum() > 5000
    assert all((light[str(k)][inside] > 0.02).mean() > 0.05 for k in range(3))
    # shadows' edges apart: one sun's is filtered, several suns' are not
    assert np.percentile(np.abs(together - apart), 80) < 0.03 * apart.mean()
    assert abs(together.mean() / apart.mean() - 1) < 0.01
