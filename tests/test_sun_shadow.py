"""Shadows of an environment's suns, against rays and algebra."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config, Generator
from fastgen.classes import CONTAINER_ID, SPREADER_ID
from fastgen.container import KINDS, build_container, container_outline
from fastgen.damage import deform
from fastgen.environment import load_environment
from fastgen.gl import open_context
from fastgen.occluders import without_cables
from fastgen.programs import link
from fastgen.scene import Camera, Damage, EnvironmentView, Spreader
from fastgen.sensor.light import light_of
from fastgen.sky_probe import probe_points
from fastgen.spreader import CABLE_TIER, build_spreader, tier_of_vertices
from fastgen.sun_shadow import ShadowMap
from tests.mesh_probe import behind_the_middle
from tests.plain import EVEN_PAINT
from tests.sky_samples import lamps_at_night, one_light
from tests.test_environment import write_exr


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


def depth_in(shadow):
    """Its texture, [rows, columns]."""
    across = shadow.depth.size[::-1]
    return np.frombuffer(shadow.depth.read(alignment=1), np.float32).reshape(across)


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
    depth = depth_in(shadow)
    eye_m = np.array([3.0, -9.0, 2.0])
    for toward, matrix in zip(ways, shadow.from_ray(eye_m), strict=True):
        check_against_rays(container, spreader, toward, depth, matrix, eye_m)
    shadow.release()


def test_the_outline_throws_the_shadow_of_the_whole_mesh(gl):
    """But for charts that a damage reaches, which it lacks the vertices to follow."""
    toward = np.array([[-0.7, -0.6, 0.4]]) / np.linalg.norm([-0.7, -0.6, 0.4])
    dent = Damage(
        "concave", "front", (0.0, -KINDS["20"].size_mm[1] / 2, 1300.0), (1.0, 0.0, 0.0),
        (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (900.0, 1400.0), 230.0,
    )  # fmt: skip
    whole, outline = build_container("20"), container_outline("20")
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
    depths = []
    for damages, lesser in (((dent,), None), ((dent,), outline), ((), outline)):
        shadow.cast(whole, None, toward, damages, lesser)
        columns, rows = (shadow.tiles[0, 2:] * shadow.depth.size).astype(int)  # of the first tile
        depths.append(depth_in(shadow)[:rows, :columns].copy())
    spans_mm = 2 / np.linalg.norm(shadow.from_ray(np.zeros(3))[0, 2, :3]) * 500
    apart = np.abs(depths[1] - depths[0]) * spans_mm
    assert (apart > 5).mean() < 2e-4  # along the edges of facets
    assert (np.abs(depths[2] - depths[0]) * spans_mm > 20).mean() > 0.01
    shadow.release()


def check_against_rays(container, spreader, toward, depth, matrix, eye_m):
    lit = np.flatnonzero(container.normals @ toward > 0.1)
    picked = np.random.default_rng(0).choice(lit, 3000, replace=False)
    at = (probe_points(container)[picked] / 1000 - eye_m) @ matrix[:3, :3].T + matrix[:3, 3]
    assert agreement(container, spreader, toward, depth, picked, at, 10) > 0.98


def agreement(container, spreader, toward, depth, picked, at, texel_mm):
    """How often rays to the sun from vertices `picked` say what the map does, looked up `at` places
    [K, 3], away from a shadow's border."""
    points = probe_points(container)[picked]
    column, row = (at[:, :2] * depth.shape[::-1]).astype(int).T
    found = at[:, 2] <= depth[row, column]

    # around each point too: within a texel of a shadow's border the map may say either
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
    # what lies within another part is seen by nobody
    body = trimesh.Trimesh(container.positions_mm, container.triangles.astype(np.int64))
    buried = RayMeshIntersector(body).intersects_any(points, container.normals[picked])
    clear = (free == free[0]).all(axis=0) & ~buried
    assert 0.05 < free[0, clear].mean() < 0.95
    return (found == free[0])[clear].mean()


@pytest.mark.parametrize(
    "toward", [(0.75, -0.6, 0.2), (0.3, 0.4, 0.8), (0.9, 0.3, 0.3), (-0.6, -0.75, 0.25)]
)
def test_shadows_on_an_end_are_those_of_rays(gl, toward):
    """To four millimetres, in the tile that the end has for itself."""
    toward = np.array(toward) / np.linalg.norm(toward)
    container, spreader = build_container("40"), build_spreader("40")
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
    shadow.cast(container, without_cables(spreader), toward[None])
    depth = depth_in(shadow)
    eye_m = np.array([9.0, 1.0, 2.0])
    (matrix,) = shadow.from_ray(eye_m)
    end = shadow.end.side * container.positions_mm[:, 0] > shadow.end.from_mm
    picked = np.flatnonzero(end & (container.normals @ toward > 0.1))
    at = (probe_points(container)[picked] / 1000 - eye_m) @ matrix[:3, :3].T + matrix[:3, 3]
    fine = at.copy()
    fine[:, :2] = at[:, :2] * shadow.end.to_tile[:2] + shadow.end.to_tile[2:]
    assert ((fine[:, :2] > shadow.end.inner[:2]) & (fine[:, :2] < shadow.end.inner[2:])).all()
    found = agreement(container, spreader, toward, depth, picked, fine, 4)
    assert found > 0.98
    shadow.release()


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
    shadow.release()


@pytest.mark.parametrize(("across_mm", "depth_mm"), [(1200.0, 260.0), (20000.0, 900.0)])
def test_a_door_pushed_in_deep_is_lit(gl, across_mm, depth_mm):
    """Deeper than front faces are sunk, or the whole end: nothing stands before what is left."""
    container = build_container("20")
    half_length = KINDS["20"].size_mm[0] / 2
    dent = Damage(
        "concave", "door", (half_length, 0.0, 1300.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0),
        (-1.0, 0.0, 0.0), (across_mm, across_mm), depth_mm,
    )  # fmt: skip
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
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
    shadow.release()


def test_the_tile_of_an_end_is_for_suns_before_it(gl):
    container = build_container("20")
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
    for x, there in ((0.6, True), (0.0, False), (-0.6, True)):
        shadow.cast(container, None, np.array([[x, -0.8, 0.6]]) / np.hypot(x, 1.0))
        assert (shadow.end.inner[:2] < shadow.end.inner[2:]).all() == there
        assert shadow.end.side == np.sign(x) or not there
    shadow.release()


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_sun_along_an_axis_lights_what_is_outermost(gl, axis):
    container = build_container("20")
    shadow = ShadowMap(gl.ctx, link(gl.ctx, "occluder.vert", "occluder.frag", {}))
    shadow.cast(container, None, np.array([axis]))
    depth = depth_in(shadow)
    height = container.positions_mm @ axis
    outermost = (container.normals @ axis > 0.9) & (height > height.max() - 1)
    (matrix,) = shadow.from_ray(np.zeros(3))
    at = container.positions_mm[outermost] / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (at[:, :2] * depth.shape[::-1]).astype(int).T
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
    depth = depth_in(shadow)
    facing = container.normals @ toward > 0.05
    points = container.positions_mm[facing].astype(float) + container.normals[facing]
    behind = behind_the_middle(container, points, toward)
    (matrix,) = shadow.from_ray(np.zeros(3))
    at = points[behind] / 1000 @ matrix[:3, :3].T + matrix[:3, 3]
    column, row = (at[:, :2] * depth.shape[::-1]).astype(int).T
    assert behind.sum() > 500
    assert (at[:, 2] > depth[row, column]).all()
    shadow.release()


@pytest.mark.parametrize(("camera", "x"), [("Cr", 0.75), ("Cl", -0.75)])
def test_pictures_of_an_end_ask_its_own_tile(tmp_path, camera, x):
    """Shadows of bars and ribs have finer edges there, and lie where the other tile has them."""
    toward = np.array([x, -0.6, 0.2])
    sky = np.full((512, 1024, 3), 0.2, np.float32)
    write_exr(tmp_path / "low.exr", sky + one_light(toward / np.linalg.norm(toward), 3e5, 512))
    config = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
    with Generator(config, 1, (480, 480), "auto", tmp_path, "draft") as generator:
        scene = generator.scene(0)
        scene = replace(scene, environment=EnvironmentView("low", 0.0), decals=())
        fine = generator.render(scene=scene, camera=camera)
        shadow = generator._gpu.renderer()._sun_shadow
        shadow.end = replace(shadow.end, inner=np.array([1.0, 1.0, 0.0, 0.0]))
        coarse = generator.render(scene=scene, camera=camera)
    apart = np.abs(fine.image.astype(int) - coarse.image).max(axis=2)[fine.ids > 0]
    assert 0.002 < (apart > 8).mean() < 0.1


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


@pytest.mark.parametrize("side", [-1, 1])
def test_no_sunlight_leaks_along_a_post(tmp_path, side):
    """Nothing of the end that faces away from a low sun, almost along the axis, is in its light;
    flanks of its posts would be but for what is thick behind them. Deep dents in both sides."""
    toward = np.array([-0.982, side * 0.053, 0.183])
    sky = np.full((512, 1024, 3), 0.2, np.float32)
    write_exr(tmp_path / "low.exr", sky + one_light(toward, 3e5, 512))
    length, width, height = KINDS["20"].size_mm
    dents = tuple(
        Damage("concave", "back" if y > 0 else "front", (700.0, y * width / 2, 1300.0),
               (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -y, 0.0), (2000.0, 1500.0), 230.0)
        for y in (-1.0, 1.0)
    )  # fmt: skip
    camera = Camera("end", (length / 2 + 6000, 0, height / 2), (0, 0, height / 2), 50.0)
    config = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
    with Generator(config, 1, (900, 900), "auto", tmp_path, "draft") as generator:
        scene = generator.scene(0)
        assert load_environment(tmp_path / "low.exr").suns
        scene = replace(
            scene, environment=EnvironmentView("low", 0.0), decals=(), damages=dents,
            container=replace(scene.container, kind="20"), spreader=Spreader(),
        )  # fmt: skip
        sample = generator.render(scene=scene, camera=camera)
    end = cv2.erode((sample.ids == CONTAINER_ID).astype(np.uint8), np.ones((9, 9))) > 0
    shade = sample.image[end].astype(float).mean(axis=-1)
    assert end.sum() > 1e5
    assert np.percentile(shade, 99.99) < 2 * np.median(shade)


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


@pytest.mark.parametrize("others", [0, 1, 3])
def test_edges_of_shadows_have_no_teeth(tmp_path, others):
    """A flipper's straight edge throws a straight one on the end beam, at 2 mm a pixel, and so it
    does where fainter lamps stand behind the container."""
    toward = np.array([[0.3, -0.75, 0.6], [-0.9, 0.3, 0.1], [-0.9, -0.3, 0.3], [-0.5, 0.8, 0.2]])
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    sky = np.full((512, 1024, 3), 0.2, np.float32)
    lights = [one_light(way, 1e5 if k == 0 else 5e3, 512) for k, way in enumerate(toward)]
    write_exr(tmp_path / "flat.exr", sum(lights[: 1 + others], sky))
    assert len(load_environment(tmp_path / "flat.exr").suns) == 1 + others
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


LAMPS = np.array([[0.9, 0.3, 0.3], [0.7, 0.6, 0.2], [0.6, -0.7, 0.4], [0.5, 0.2, 0.8]])
LAMPS /= np.linalg.norm(LAMPS, axis=1, keepdims=True)
LIGHTS = np.array([1.0, 0.6, 0.8, 0.7])[:, None] * np.ones(3)


@pytest.fixture
def by_night(tmp_path):
    """(generator, function of the names of lamps of LAMPS): the scene under these alone."""
    surface = {**EVEN_PAINT, "colors": {"grey": "#808080"}, "roughness": 0.9}
    config = Config.from_values({"surface": surface, "damage": {"probability": 0}})
    for name in ("0", "1", "2", "3", "012", "0123"):
        on = [int(digit) for digit in name]
        sky = lamps_at_night(LAMPS[on], LIGHTS[on]) - np.float32(0.0199)
        write_exr(tmp_path / f"{name}.exr", sky)
    with Generator(config, 1, (240, 240), "auto", tmp_path, "draft") as generator:
        scene = replace(
            generator.scene(0),
            decals=(),
            spreader=Spreader(True, (0.5, 0.5, 0.5), (True, True), 15.0),
        )
        yield generator, lambda name: replace(scene, environment=EnvironmentView(name, 0.0))


def above_the_spreader(container):
    """A camera that looks at the hoist cables, which reach over the map."""
    top = KINDS[container.kind].size_mm[2]
    return Camera("cables", (9000.0, -9000.0, top + 7000.0), (0.0, 0.0, top + 6500.0), 60.0)


@pytest.mark.parametrize("view", ["Cr", "cables"])
def test_light_of_several_lamps_adds_up(by_night, view):
    """What an image shows under all of them is the sum of what each shows by itself."""
    generator, scene_under = by_night
    light, inside, edges = {}, np.ones((240, 240), bool), np.zeros((240, 240), bool)
    for name in ("0123", "0", "1", "2", "3"):
        scene = scene_under(name)
        camera = scene.camera("Cr") if view == "Cr" else above_the_spreader(scene.container)
        camera = replace(camera, exposure_ev=-4.0)
        sample = generator.render(scene=scene, camera=camera)
        light[name] = light_of(sample.image).mean(axis=2) / generator.exposure(scene, camera)
        inside &= (sample.ids == (CONTAINER_ID if view == "Cr" else SPREADER_ID)) & (
            sample.image.max(axis=2) < 230
        )
        if name != "0123":
            # the brightest sun's shadow is filtered, others' are not
            around = [f(light[name], np.ones((3, 3))) for f in (cv2.dilate, cv2.erode)]
            edges |= around[0] - around[1] > 0.1
    if view == "Cr":
        inside &= ~edges
    together, apart = light["0123"][inside], sum(light[name][inside] for name in "0123")
    assert inside.sum() > (5000 if view == "Cr" else 1000)
    assert all((light[name][inside] > 0.02).mean() > 0.1 for name in "0123")
    # in steps of 255, of which the sum has four times as many
    assert np.percentile(np.abs(together - apart), 90) < 0.015 * apart.mean()
    assert abs(together.mean() / apart.mean() - 1) < 0.003


def test_images_do_not_depend_on_the_lamps_of_the_one_before(by_night):
    generator, scene_under = by_night
    camera = above_the_spreader(scene_under("0").container)
    shown = {}
    for name in ("012", "0123", "012", "0", "012"):
        image = generator.render(scene=scene_under(name), camera=camera).image
        np.testing.assert_array_equal(image, shown.setdefault(name, image))
