"""The ground and its props against rays, algebra and Monte Carlo integrals."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.light.environment import Ambient, load_environment, sky_irradiance, to_map_frame
from fastgen.light.ground_light import LOW_GAP_M, form_factors, ground_light
from fastgen.light.hdri import bundled_hdris
from fastgen.light.octahedral import octahedral_encode
from fastgen.render.gl import open_context
from fastgen.scene import (
    Camera,
    EnvironmentView,
    Ground,
    Lens,
    Neighbour,
    Pose,
    Prop,
    Spreader,
)
from fastgen.scene.boxes import container_box, prop_box
from fastgen.scene.optics import Weather
from tests import glsl, oracle

SIZE = (320, 240)
YAW_DEG = 35.0
SUNNY = "port_noon"
BENT = Lens("brown_conrady", (-0.2, 0.05, 0.0, 0.0, 0.0))
CAMERAS = (
    Camera("side", (9000.0, -8000.0, 4500.0), (1000.0, 0.0, 0.0), 26.0, roll_deg=8.0),
    Camera("low", (-9000.0, 7000.0, 300.0), (0.0, 0.0, 300.0), 24.0),
    Camera("down", (500.0, 6000.0, 9000.0), (500.0, 1500.0, 0.0), 30.0),
    Camera("bent", (9000.0, 8000.0, 3000.0), (0.0, 0.0, 0.0), 18.0, lens=BENT),
)
GROUND = Ground("asphalt", -1200.0, wear=0.0, reach_mm=30000.0)
PROPS = (
    Prop("box", Pose((0.0, -300.0, -250.0), 20.0), (5000.0, 300.0, 400.0), (0.1, 0.1, 0.1)),
    Prop("cylinder", Pose((1500.0, -1100.0, -700.0), -15.0), (1000.0, 350.0, 1000.0), (0.1,) * 3),
    Prop("cylinder", Pose((-1500.0, 900.0, -950.0), 80.0), (500.0, 900.0, 500.0), (0.1,) * 3),
    Prop("box", Pose((4500.0, -3000.0, -700.0)), (300.0, 300.0, 1000.0), (0.5, 0.4, 0.1)),
)


@pytest.fixture(scope="module")
def generator():
    with Generator(Config.preset("gate"), seed=3, size=SIZE, quality="draft") as made:
        yield made


@pytest.fixture(scope="module")
def ambient():
    return Ambient.of(load_environment(bundled_hdris()[SUNNY]))


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


@pytest.fixture(scope="module")
def scene(generator):
    plain = replace(generator.scene(0), neighbours=(), spreader=Spreader(), weather=Weather())
    return replace(
        plain,
        environment=EnvironmentView(SUNNY, YAW_DEG),
        ground=GROUND,
        props=(),
        cameras=CAMERAS,
    )


def without_container(scene):
    return replace(
        scene,
        container=replace(scene.container, present=False),
        decals=(),
        damages=(),
        seals=(),
    )


def rays_of(camera):
    """Return the eye [3] and rays [H, W, 3] with a depth of 1 mm, in mm."""
    view = view_of(camera, SIZE)
    eye, rays = view.rays()
    return eye, rays / (rays @ view.rotation[2])[..., None]


def plane_depth_mm(camera, ground):
    """Return the depth [H, W] of the plane within its reach, else inf."""
    eye, rays = rays_of(camera)
    with np.errstate(divide="ignore"):
        depth = (ground.height_mm - eye[2]) / rays[..., 2]
    at = eye + np.where(depth > 0, depth, 0)[..., None] * rays
    inside = (depth > 0) & (np.hypot(at[..., 0], at[..., 1]) < ground.reach_mm)
    return np.where(inside, depth, np.inf)


def prop_depth_mm(camera, prop):
    """Return the depth [H, W] at which rays enter a prop, else inf."""
    eye, rays = rays_of(camera)
    turn = prop_box(prop).rotation
    o, d = (eye - np.array(prop.pose.position_mm)) @ turn, rays @ turn
    half = np.array(prop.size_mm) / 2
    if prop.shape == "box":
        spans = [(-half[k] - o[k], half[k] - o[k], d[..., k]) for k in range(3)]
        intervals = [np.sort([a / s, b / s], axis=0) for a, b, s in spans]
    else:
        a = d[..., 0] ** 2 + d[..., 2] ** 2
        b = o[0] * d[..., 0] + o[2] * d[..., 2]
        root = np.sqrt(np.maximum(b * b - a * (o[0] ** 2 + o[2] ** 2 - half[0] ** 2), 0))
        root = np.where(root > 0, root, -np.inf)
        sides = np.sort([(-half[1] - o[1]) / d[..., 1], (half[1] - o[1]) / d[..., 1]], axis=0)
        intervals = [np.array([(-b - root) / a, (-b + root) / a]), sides]
    near = np.max([i[0] for i in intervals], axis=0)
    far = np.min([i[1] for i in intervals], axis=0)
    return np.where((near < far) & (near > 0), near, np.inf)


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.name)
def test_depth_of_plane_and_props_equals_algebra(generator, scene, camera):
    open_place = EnvironmentView("city", YAW_DEG)  # it has no container map
    bare = without_container(replace(scene, props=PROPS, environment=open_place))
    depths = [plane_depth_mm(camera, GROUND), *(prop_depth_mm(camera, prop) for prop in PROPS)]
    seen, expected = np.argmin(depths, axis=0), np.min(depths, axis=0) / 1e3
    for quality in ("draft", "balanced"):
        with_quality = Generator(Config.preset("gate"), size=SIZE, quality=quality)
        with with_quality as drawn:
            depth = drawn.render(camera=camera.name, scene=bare).depth
        clear = ~oracle.near_edge(np.where(np.isinf(expected), -1, seen))
        found = np.isfinite(depth)
        assert (found == np.isfinite(expected))[clear].all()
        both = clear & found
        assert both.mean() > 0.2
        # shaders undo distortion within hundredths of a pixel, which matters at grazing angles
        within = 1e-3 if camera.lens else 1e-4
        np.testing.assert_allclose(depth[both], expected[both], rtol=within)
    assert len(np.unique(seen[clear])) >= 4


def test_a_ground_has_no_labels_and_containers_keep_theirs(generator, scene):
    camera = CAMERAS[0]
    plain = generator.render(camera=camera.name, scene=replace(scene, ground=None))
    sample = generator.render(camera=camera.name, scene=replace(scene, props=PROPS))
    np.testing.assert_array_equal(sample.ids, plain.ids)
    np.testing.assert_array_equal(sample.damage, plain.damage)
    covered = sample.ids > 0
    np.testing.assert_array_equal(sample.depth[covered], plain.depth[covered])


def test_scenes_without_ground_and_repeated_scenes_are_bit_identical(generator, scene):
    camera = CAMERAS[0].name
    plain, grounded = replace(scene, ground=None), replace(scene, props=PROPS)
    first = [generator.render(camera=camera, scene=each) for each in (plain, grounded)]
    other = replace(scene, ground=replace(GROUND, kind="paving", wetness=0.5))
    generator.render(camera=CAMERAS[2].name, scene=other)
    again = [generator.render(camera=camera, scene=each) for each in (plain, grounded)]
    for one, two in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.image, two.image)
        np.testing.assert_array_equal(one.depth, two.depth)
    with Generator(Config.preset("gate"), seed=3, size=SIZE, quality="draft") as fresh:
        alone = fresh.render(camera=camera, scene=plain)
    np.testing.assert_array_equal(alone.image, first[0].image)


@pytest.mark.parametrize("count", [2, 4])
def test_containers_behind_the_camera_hardly_change_the_ground(generator, scene, count):
    far = tuple(
        Neighbour(Pose((0.0, -20000.0 - 3000.0 * i, -1200.0)), scene.container, scene.surface)
        for i in range(count)
    )
    alone, among = (
        generator.render(camera="side", scene=replace(scene, neighbours=each)) for each in ((), far)
    )
    plane = (alone.ids == 0) & np.isfinite(alone.depth)
    apart = np.abs(alone.image.astype(float) - among.image)[plane]
    assert apart.mean() < 3


def test_sunlight_on_the_plane_equals_ray_casts(generator, scene, ambient):
    camera = CAMERAS[2]
    box = container_box(scene.container.kind, Pose())
    body = trimesh.creation.box(2 * box.half_mm / 1e3)
    body.apply_translation(box.center_mm / 1e3)
    eye, rays = rays_of(camera)
    depth = plane_depth_mm(camera, GROUND)
    points = (eye + np.where(np.isinf(depth), 1, depth)[..., None] * rays).reshape(-1, 3) / 1e3
    sun = to_map_frame(ambient.lights[0].direction, -YAW_DEG)
    hidden = RayMeshIntersector(body).intersects_any(points, np.tile(sun, (len(points), 1)))
    hidden = hidden.reshape(depth.shape)
    lit = generator.render(camera=camera.name, scene=scene)
    clear = np.isfinite(depth) & (lit.ids == 0)
    for _ in range(2):
        clear &= ~oracle.near_edge(hidden)
    light = lit.image.astype(float).mean(axis=-1)
    shade, sunny = light[clear & hidden], light[clear & ~hidden]
    assert len(shade) > 1000
    assert len(sunny) > 5000
    threshold = (np.median(shade) + np.median(sunny)) / 2
    assert np.median(shade) < 0.75 * np.median(sunny)
    assert (shade < threshold).mean() > 0.99
    assert (sunny > threshold).mean() > 0.99


def test_penumbra_equals_a_monte_carlo_integral_over_the_disc(gl):
    rng = np.random.default_rng(5)
    box = container_box("20", Pose((300.0, -200.0, 0.0), 25.0))
    sun = np.array([0.35, 0.5, 0.6])
    sun /= np.linalg.norm(sun)
    radius = 0.04
    pole = np.linalg.qr(np.column_stack([sun, np.eye(3)[:, :2]]))[0][:, 1:]
    spread = np.sqrt(rng.random(1500)) * np.exp(2j * np.pi * rng.random(1500))
    disc = sun + radius * np.column_stack([spread.real, spread.imag]) @ pole.T
    points = np.column_stack([rng.uniform((-9, -9), (5, 3), (2000, 2)), np.zeros(2000)])
    o = (points - box.center_mm / 1e3) @ box.rotation
    d = disc @ box.rotation
    one, other = ((s * box.half_mm / 1e3 - o[:, None]) / d for s in (-1, 1))
    expected = (np.minimum(one, other).max(axis=-1) < np.maximum(one, other).min(axis=-1)).mean(
        axis=1
    )
    center = (*box.center_mm / 1e3, box.rotation[0, 0])
    kept = glsl.blocks(gl, body_center=center, body_half=(*box.half_mm / 1e3, box.rotation[1, 0]))
    body = (
        '#include "ground_bodies.glsl"\n'
        f"vec4 f(vec4 x) {{ return vec4(body_cover(x.xyz, vec3{tuple(sun.tolist())}, 0,"
        f" {radius}, 1e-4)); }}"
    )
    found = glsl.run(gl, body, np.column_stack([points, np.zeros(len(points))]))[:, 0]
    assert kept
    assert 20 < ((expected > 0.02) & (expected < 0.98)).sum() < 300
    error = np.abs(found - expected)
    assert error.mean() < 0.006
    assert np.quantile(error, 0.98) < 0.06  # corners of the silhouette count as edges


def test_form_factors_equal_those_of_a_parallel_disc():
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    for radius, height in ((0.5, 1.0), (3.0, 0.7)):
        # a disc above, clockwise as seen from below
        disc = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(400, height)])
        x, y, z = form_factors(disc[..., None])[:, 0]
        assert abs(z) == pytest.approx(radius**2 / (radius**2 + height**2), rel=1e-3)
        assert abs(x) < 1e-9
        assert abs(y) < 1e-9
        assert z > 0


@pytest.mark.parametrize(
    ("poses", "height_mm", "tolerance"),
    [
        ([Pose((0.0, 0.0, 0.0), 10.0)], 0.0, 0.01),
        ([Pose()], -1200.0, 0.01),
        ([Pose(), Pose((0.0, 0.0, 2591.0))], 0.0, 0.02),
        ([Pose(), Pose((0.0, 2900.0, 0.0)), Pose((500.0, -7000.0, 0.0), 20.0)], 0.0, 0.05),
    ],
)
def test_sky_share_equals_a_monte_carlo_integral(ambient, poses, height_mm, tolerance):
    rng = np.random.default_rng(2)
    boxes = [container_box("20", pose) for pose in poses]
    light = ground_light(boxes, np.full((len(boxes), 4, 3), 0.2), ambient, YAW_DEG, height_mm)
    count = 6000
    u, v = rng.random((2, count))
    rays = np.column_stack(
        [np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), np.sqrt(1 - u)]
    )
    errors = []
    rows, columns = light.texels.shape[:2]
    for _ in range(60):
        row, column = rng.integers(rows), rng.integers(columns)
        at = np.array([*(light.low_m + light.step_m * (column, row)) * 1e3, height_mm])
        hidden, below = np.zeros(count, bool), False
        for box in boxes:
            o, d = (at - box.center_mm) @ box.rotation, rays @ box.rotation
            one, other = ((s * box.half_mm - o) / d for s in (-1, 1))
            near = np.minimum(one, other).max(axis=1)
            hidden |= (near < np.maximum(one, other).min(axis=1)) & (near > 0)
            below |= bool((np.abs(o[:2]) < box.half_mm[:2]).all())
        if not below or -height_mm > 1e3 * LOW_GAP_M:
            errors.append(light.texels[row, column, 3] - (1 - hidden.mean()))
    assert len(errors) > 20
    assert np.abs(errors).max() < tolerance + 4 * 0.5 / np.sqrt(count)
    assert abs(np.mean(errors)) < 0.01


@pytest.mark.parametrize("name", ["venice", "sky"])
def test_what_boxes_hide_of_a_sky_has_its_color_there(name):
    """Beside a container the mean color of the rest of the sky is not that of the whole sky."""
    ambient = Ambient.of(load_environment(bundled_hdris()[name]))
    box = container_box("40", Pose())
    light = ground_light([box], np.zeros((1, 4, 3)), ambient, YAW_DEG, 0.0)
    (whole,) = sky_irradiance(ambient, [[0.0, 0.0, 1.0]], YAW_DEG)
    rng = np.random.default_rng(3)
    rays = rng.normal(size=(40_000, 3))
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) + (0.0, 0.0, 1.0)
    uv = octahedral_encode(to_map_frame(rays, YAW_DEG))
    side = len(ambient.sky)
    column, row = np.clip((uv * side).astype(int), 0, side - 1).T
    radiance = ambient.sky[row, column]
    np.testing.assert_allclose(radiance.mean(axis=0), whole, rtol=0.03)
    errors, of_whole = [], []
    for x, y in ((0.0, -2.0), (3.0, 3.5), (-7.5, 0.5), (0.0, 5.0), (7.0, -3.0), (-4.0, -2.5)):
        start = np.array([1e3 * x, 1e3 * y, 1.0])
        enters, leaves = box.crossed(start, rays)
        seen = ~((enters < leaves) & (leaves > 0))
        expected = (radiance * seen[:, None]).mean(axis=0)
        errors.append(light.at(np.array([[x, y]]))[0, :3] / expected - 1)
        of_whole.append(whole * seen.mean() / expected - 1)
    assert np.abs(errors).mean() < 0.5 * np.abs(of_whole).mean()
    assert np.abs(errors).max() < 0.15


def test_light_on_open_ground_is_that_of_the_sky_and_paint_colors_its_foot(ambient):
    sky = sky_irradiance(ambient, [[0.0, 0.0, 1.0]], YAW_DEG)[0]
    alone = ground_light([], [], ambient, YAW_DEG, 0.0)
    np.testing.assert_allclose(alone.texels[..., :3], np.broadcast_to(sky, (32, 64, 3)), rtol=1e-3)
    box = [container_box("40", Pose())]
    red, black = (
        ground_light(box, np.tile(color, (1, 4, 1)), ambient, YAW_DEG, 0.0).texels
        for color in ((0.6, 0.0, 0.0), (0.0, 0.0, 0.0))
    )
    added = red - black
    assert added[..., 0].max() > 0.05 * sky[0]
    assert np.abs(added[..., 1:]).max() < 1e-6
    corner, foot = red[0, 0], red[16, 32]  # the foot is below the box, moved out to its edge
    assert corner[3] > 0.97
    assert 0.4 < foot[3] < 0.6


def test_the_plane_fades_into_the_panorama(generator, scene):
    camera = CAMERAS[1]
    bare = without_container(scene)
    faded = generator.render(camera=camera.name, scene=bare)
    plain = generator.render(camera=camera.name, scene=replace(bare, ground=None))
    depth = plane_depth_mm(camera, GROUND)
    beyond = np.isinf(depth) & ~oracle.near_edge(np.isinf(depth))
    # the background is interpolated without ground, and found by rays beside one
    apart = np.abs(faded.image.astype(int) - plain.image)[beyond].max(axis=-1)
    assert (apart > 1).mean() < 0.002
    assert apart.max() <= 4
    assert np.isinf(faded.depth[beyond]).all()
    change = np.abs(faded.image.astype(float) - plain.image).mean(axis=-1)
    eye, rays = rays_of(camera)
    at = eye + np.where(np.isinf(depth), 0, depth)[..., None] * rays
    share = np.where(np.isinf(depth), 9.0, np.hypot(at[..., 0], at[..., 1]) / GROUND.reach_mm)
    assert change[(share > 0.97) & (share < 1)].mean() < 0.2 * change[share < 0.5].mean()
    assert change[share < 0.5].mean() > 5


def test_wet_ground_mirrors_containers(generator, scene):
    camera = Camera("wall", (0.0, -9000.0, 1500.0), (0.0, 0.0, 200.0), 35.0)
    difference = []
    for wetness in (0.0, 1.0):
        colors = []
        for paint in ((0.5, 0.02, 0.02), (0.02, 0.02, 0.5)):
            surface = replace(scene.surface, paint=replace(scene.surface.paint, albedo=paint))
            ground = replace(GROUND, height_mm=0.0, wetness=wetness)
            drawn = generator.render(
                camera=camera,
                scene=replace(
                    scene,
                    surface=surface,
                    ground=ground,
                    environment=EnvironmentView("port_overcast", YAW_DEG),
                ),
            )
            depth = plane_depth_mm(camera, ground)
            seen = np.isfinite(depth) & (drawn.ids == 0)
            columns = np.abs(np.arange(SIZE[0]) - SIZE[0] / 2) < 60
            part = seen & columns & (np.arange(SIZE[1]) < 160)[:, None]
            colors.append(drawn.image[part].astype(float).mean(axis=0))
        difference.append((colors[0] - colors[1])[0] - (colors[0] - colors[1])[2])
    assert difference[1] > 2 * difference[0]
    assert difference[1] > 10


def test_drafts_show_the_same_ground(scene):
    images = []
    for quality in ("draft", "balanced"):
        with Generator(Config.preset("gate"), size=SIZE, quality=quality) as drawn:
            images.append(
                drawn.render(camera=CAMERAS[0].name, scene=without_container(scene)).image
            )
    difference = np.abs(images[0].astype(float) - images[1])
    assert difference.mean() < 3
