"""Several containers in a scene: images and labels against rays, order, and light."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.classes import DAMAGE_VALUES
from fastgen.geometry.shape_library import ShapeLibrary
from fastgen.light.environment import (
    Ambient,
    load_environment,
    lower_irradiance,
    prefilter_environment,
    sky_irradiance,
    to_map_frame,
)
from fastgen.light.hdri import bundled_hdris
from fastgen.light.octahedral import octahedral_encode
from fastgen.light.sky_visibility import open_sky, sky_directions
from fastgen.light.surrounding_change import lattice
from fastgen.light.surrounding_light import Paving, surrounding_light
from fastgen.scene import Camera, EnvironmentView, Neighbour, Pose, Spreader
from fastgen.scene.boxes import back_to_front, container_box, overlap
from tests import oracle, oracle_scene

SIZE = (320, 240)
THRESHOLD_MM = 5.0
CONFIG = Config.from_values(
    {
        "container": {"kinds": {"20": 1}},
        "damage": {"probability": 1, "count": [2, 4]},
        "seals": {"probability": 0},
    }
)
POSES = (
    Pose((0.0, 3000.0, 0.0), 180.0),
    Pose((6300.0, 100.0, 0.0), 2.5),
    Pose((0.0, 0.0, 2616.0), 0.0),
)
CAMERAS = (
    Camera("left", (-6000.0, -8000.0, 4500.0), (500.0, 0.0, 1500.0), 24.0),
    Camera("right", (9000.0, 9000.0, 6000.0), (500.0, 1000.0, 1500.0), 24.0),
    Camera("end", (-9000.0, 1500.0, 2500.0), (0.0, 1500.0, 2000.0), 30.0),
    Camera("gap", (3100.0, -2500.0, 900.0), (3300.0, 2500.0, 1500.0), 18.0),
    Camera("above", (2000.0, -2500.0, 14000.0), (2100.0, 1500.0, 0.0), 30.0),
)


@pytest.fixture(scope="module")
def generator():
    with Generator(CONFIG, seed=6, size=SIZE, quality="draft") as made:
        yield made


@pytest.fixture(scope="module")
def scene(generator):
    """Four containers, each sampled like the first container of another scene."""
    first, *others = (generator.scene(i) for i in range(4))
    return replace(first, spreader=Spreader(), neighbours=neighbours_of(others, POSES))


def neighbours_of(scenes, poses):
    return tuple(
        Neighbour(pose, s.container, s.surface, s.decals, s.damages, s.seals)
        for s, pose in zip(scenes, poses, strict=True)
    )


def turned(camera, pose):
    """Return a camera in the frame of a pose."""
    angle = np.deg2rad(-pose.yaw_deg)
    c, s = np.cos(angle), np.sin(angle)

    def moved(point):
        x, y, z = np.subtract(point, pose.position_mm)
        return (float(c * x - s * y), float(s * x + c * y), float(z))

    return replace(camera, position_mm=moved(camera.position_mm), target_mm=moved(camera.target_mm))


def expected(scene, camera):
    return oracle_scene.truth(scene, view_of(camera, SIZE), THRESHOLD_MM)


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.name)
def test_pixels_equal_the_nearest_hit_of_rays_at_each_container(generator, scene, camera):
    sample = generator.render(scene=scene, camera=camera)
    found = expected(scene, camera)
    for drawn, wanted in ((sample.ids, found.ids), (sample.damage, found.damage)):
        wrong = drawn != wanted
        assert wrong.mean() < 4e-4
        assert not (wrong & ~oracle.near_edge(wanted) & ~oracle.near_edge(found.owner)).any()
    both = np.isfinite(found.depth_m) & (sample.ids > 0)
    assert both.mean() > 0.1
    assert np.quantile(np.abs(sample.depth[both] / found.depth_m[both] - 1), 0.995) < 1e-5


def test_an_undamaged_scene_differs_only_in_its_damages(generator, scene):
    whole = scene.undamaged()
    damaged, undamaged = (
        generator.render(scene=each, camera=CAMERAS[0]) for each in (scene, whole)
    )
    damages = np.isin(damaged.damage, DAMAGE_VALUES)
    assert damages.any()
    assert not np.isin(undamaged.damage, DAMAGE_VALUES).any()
    ray = expected(whole, CAMERAS[0])
    assert not ((undamaged.ids != ray.ids) & ~oracle.near_edge(ray.ids)).any()
    changed = (damaged.image != undamaged.image).any(axis=-1)
    near = cv2.dilate(damages.astype(np.uint8), np.ones((61, 61))).astype(bool)
    assert changed[damages].mean() > 0.5
    assert changed[~near].mean() < 0.01
    for part in ("decals", "surface", "container", "seals"):
        assert getattr(whole, part) == getattr(scene, part)
        for before, after in zip(scene.neighbours, whole.neighbours, strict=True):
            assert getattr(before, part) == getattr(after, part)


def own_values(objects, container):
    """Return the values in the damage target of a container and its damages."""
    yield 100 + container.instance
    for item in objects:
        if item.container == container.container and 200 <= item.id < 600:
            yield item.id


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.name)
def test_labels_follow_from_the_pixels_and_from_each_container_alone(generator, scene, camera):
    sample = generator.render(scene=scene, camera=camera)
    objects = [item for item in sample.objects if not item.background]
    assert len({item.id for item in objects}) == len(objects)
    classes = {}
    for item in objects:
        classes.setdefault(item.class_name, []).append(item.instance)
        shown = (sample.damage if 200 <= item.id < 600 else sample.ids) == item.id
        if item.class_name == "container":
            shown = np.isin(sample.damage, list(own_values(objects, item)))
        assert item.bbox == oracle.box_of(shown)
        assert item.area == shown.sum()
    for found in classes.values():
        assert sorted(found) == list(range(1, len(found) + 1))
    for number, (own, pose) in enumerate(oracle_scene.alone(scene)):
        single = generator.render(scene=own, camera=turned(camera, pose)).objects
        single = [item for item in single if not item.background]
        mine = [item for item in objects if item.container == number]
        assert [i.class_name for i in mine] == [i.class_name for i in single]
        for item, other in zip(mine, single, strict=True):
            assert item.text == other.text
            np.testing.assert_allclose(item.polygon, other.polygon, atol=0.02)
            assert item.area <= other.area + 2
            if item.class_name == "container" and other.area:
                whole = other.area / other.visible_fraction
                assert item.visible_fraction == pytest.approx(item.area / whole, abs=0.03)


@pytest.mark.parametrize("camera", CAMERAS[:3], ids=lambda camera: camera.name)
def test_castings_behind_another_container_are_hidden(generator, scene, camera):
    sample = generator.render(scene=scene, camera=camera)
    objects = [item for item in sample.objects if item.class_name == "container"]
    objects = [item for item in objects if not item.background]
    flags = []
    for item in objects:
        for x, y, flag in item.keypoints:
            # a visible corner lies beside pixels of its container
            rows, columns = (slice(max(int(v) - 3, 0), int(v) + 4) for v in (y, x))
            own = list(own_values(sample.objects, item))
            assert flag != 2 or np.isin(sample.damage[rows, columns], own).any()
            flags.append(flag)
    assert {1, 2} <= set(flags)


@pytest.mark.parametrize("quality", ["draft", "balanced", "fine"])
def test_labels_do_not_depend_on_the_quality_and_edges_between_containers_are_opaque(
    generators, scene, quality
):
    generator = generators(CONFIG, seed=6, size=SIZE, quality=quality)
    drawn = generator.render(scene=scene, camera=CAMERAS[1])
    assert (drawn.ids != expected(scene, CAMERAS[1]).ids).mean() < 4e-4
    seen = np.isfinite(drawn.depth)
    assert (drawn.cover[seen & ~oracle.near_edge(seen)] == 255).mean() > 0.995


def test_order_of_boxes_agrees_with_rays():
    rng = np.random.default_rng(4)
    tried = 0
    while tried < 60:
        boxes = [
            container_box("20", Pose((float(x), float(y), 2600.0 * level), float(yaw)))
            for x, y, level, yaw in zip(
                rng.uniform(-9e3, 9e3, 4),
                rng.uniform(-9e3, 9e3, 4),
                rng.integers(0, 2, 4),
                rng.uniform(0, 360, 4),
                strict=True,
            )
        ]
        eye = rng.uniform((-2e4, -2e4, 500), (2e4, 2e4, 9e3))
        if any(overlap(a, b) for i, a in enumerate(boxes) for b in boxes[:i]):
            continue
        if any(entered(eye, np.array([[0.0, 0.0, 1.0]]), box)[0] <= 0 for box in boxes):
            continue
        tried += 1
        rays = np.concatenate([box.corners_mm for box in boxes]) - eye
        rays = np.concatenate([rays, rays + rng.normal(0, 400, rays.shape)])
        away = np.array([entered(eye, rays, box) for box in boxes])
        order = back_to_front(boxes, eye)
        assert sorted(order) == [0, 1, 2, 3]
        for place, number in enumerate(order):
            for later in order[place + 1 :]:
                both = np.isfinite(away[number]) & np.isfinite(away[later])
                assert (away[later][both] <= away[number][both] + 1e-6).all()


def entered(eye, rays, box):
    """Return the distance [N] at which rays from an eye enter a box, inf if they miss it."""
    start, along = (eye - box.center_mm) @ box.rotation, rays @ box.rotation
    with np.errstate(divide="ignore"):
        ends = np.sort([(-box.half_mm - start) / along, (box.half_mm - start) / along], axis=0)
    near, far = ends[0].max(axis=1), ends[1].min(axis=1)
    return np.where((near < far) & (far > 0), near, np.inf)


def test_a_neighbour_takes_light_where_it_stands_and_nowhere_else(generators, scene):
    generator = generators(CONFIG, seed=6, size=SIZE, quality="draft")
    overcast = EnvironmentView("port_overcast", 0.0)
    bare = replace(scene, environment=overcast, neighbours=(), damages=(), decals=(), seals=())
    beside = Neighbour(Pose((0.0, -4200.0, 0.0)), bare.container, bare.surface)
    cameras = {
        "near": Camera("near", (-1500.0, -2600.0, 1300.0), (1500.0, -1219.0, 1300.0), 24.0),
        "far": Camera("far", (0.0, 9000.0, 1300.0), (0.0, 0.0, 1300.0), 24.0),
    }
    ratio = {}
    for name, camera in cameras.items():
        scenes = (bare, replace(bare, neighbours=(beside,)))
        before, after = (generator.render(scene=each, camera=camera) for each in scenes)
        first, second = (generator.exposure(each, camera) for each in scenes)
        assert first == second
        same = (before.ids == 1) & (after.ids == 1)
        wall = same & ~oracle.near_edge(same)
        dark, bright = (np.median(each.image[wall]) for each in (after, before))
        ratio[name] = dark / bright
    assert ratio["near"] < 0.85
    assert ratio["far"] == pytest.approx(1.0, abs=0.02)


def test_light_between_boxes_equals_a_monte_carlo_integral():
    light = load_environment(bundled_hdris()["port_overcast"])
    boxes = [
        container_box("20", pose)
        for pose in (Pose(), Pose((300.0, 3400.0, 0.0), 3.0), Pose((0.0, 100.0, 2620.0)))
    ]
    low, high = boxes[0].corners_mm.min(axis=0), boxes[0].corners_mm.max(axis=0)
    black = 3 * [(0.0, 0.0, 0.0)]
    (found, *_) = surrounding_light(boxes, black, 3 * [(low, high)], light, 40.0, None)
    points, normals = lattice(boxes[0].half_mm)
    rng = np.random.default_rng(1)
    for number in rng.choice(len(points), 25, replace=False):
        # directions with a density proportional to the cosine
        around = rng.normal(size=(40_000, 3))
        toward = normals[number] + around / np.linalg.norm(around, axis=1, keepdims=True)
        start = points[number] + boxes[0].center_mm
        met = [np.isfinite(entered(start, toward, box)) for box in boxes[1:]]
        np.testing.assert_allclose(found.sky[number], 1 - np.any(met, axis=0).mean(), atol=0.06)
        met = [np.isfinite(entered(start, sky_directions(), box)) for box in boxes[1:]]
        bits = np.unpackbits(found.open_bits[number]).astype(bool)
        np.testing.assert_array_equal(bits, ~np.any(met, axis=0))


def radiance_toward(light, directions, yaw_deg):
    """Return the radiance [K, 3] of the map cell in each world direction, without the sun."""
    side = len(light.sky)
    uv = octahedral_encode(to_map_frame(directions, yaw_deg))
    column, row = np.clip((uv * side).astype(int), 0, side - 1).T
    return light.sky[row, column]


@pytest.mark.parametrize("gap_mm", [None, 900.0], ids=["alone", "row"])
def test_light_off_the_ground_equals_a_monte_carlo_integral(gap_mm):
    light = load_environment(bundled_hdris()["port_noon"])
    albedo, yaw_deg = np.array([0.3, 0.25, 0.2]), 70.0
    poses = [Pose()] if gap_mm is None else [Pose(), Pose((0.0, 2438.0 + gap_mm, 0.0))]
    boxes = [container_box("20", pose) for pose in poses]
    black = len(boxes) * [(0.0, 0.0, 0.0)]
    low, high = boxes[0].corners_mm.min(axis=0), boxes[0].corners_mm.max(axis=0)
    paving = Paving(0.0, tuple(albedo))
    (found, *_) = surrounding_light(
        boxes, black, len(boxes) * [(low, high)], light, yaw_deg, paving
    )
    points, normals = lattice(boxes[0].half_mm)
    points = points + boxes[0].center_mm
    walls = np.flatnonzero((normals[:, 2] == 0) & (points[:, 2] > 20))
    sun = to_map_frame(light.lights[0].direction, -yaw_deg)
    rng = np.random.default_rng(1)
    around = rng.normal(size=(3000, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    apart = []
    for number in walls[::3]:
        toward, start = normals[number] + around, points[number]
        met = np.min([entered(start, toward, box) for box in boxes], axis=0)
        down = np.where(toward[:, 2] < 0, -start[2] / toward[:, 2], np.inf)
        ground = down < met
        at = start + down[ground, None] * toward[ground]
        # rays up from the ground, with a density proportional to the cosine
        up = np.array([0.0, 0.0, 1.0]) + around[rng.permutation(len(around))[: len(at)]]
        shut = np.any([each_enters(at, up, box) for box in boxes], axis=0)
        shade = np.any([each_enters(at, np.tile(sun, (len(at), 1)), box) for box in boxes], axis=0)
        lit = radiance_toward(light, up, yaw_deg) * ~shut[:, None]
        lit += np.array(light.lights[0].light) * sun[2] * ~shade[:, None]
        each = normals[number : number + 1]
        whole = sky_irradiance(light, each, yaw_deg)[0]
        upper = whole - lower_irradiance(light, each, yaw_deg)[0]
        open_ = np.isinf(met) & (toward[:, 2] >= 0)
        above = (radiance_toward(light, toward, yaw_deg) * open_[:, None]).mean(axis=0)
        expected = (above + albedo * lit.sum(axis=0) / len(around)) / whole
        apart.append((found.sky[number] * upper + found.added[number]) / whole - expected)
    assert np.abs(apart).mean() < 0.05
    assert np.abs(apart).max() < 0.2


def test_light_of_ground_and_sky_on_turned_facets_equals_a_monte_carlo_integral():
    """Facets of a shaded wall face different parts of the sky, and about the same ground."""
    light, yaw_deg = load_environment(bundled_hdris()["sky"]), 230.0
    mesh, box, albedo = ShapeLibrary().container("20"), container_box("20", Pose()), 0.3
    (found,) = surrounding_light(
        [box], [(0.0, 0.0, 0.0)], [mesh.bounds_mm], light, yaw_deg, Paving(0.0, 3 * (albedo,))
    )
    rng = np.random.default_rng(2)
    around = rng.normal(size=(4000, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    whole = sky_irradiance(light, mesh.normals, yaw_deg)
    lit = found.vertex_light(open_sky(mesh.normals), whole, mesh)
    sun = to_map_frame(light.lights[0].direction, -yaw_deg)
    up = np.array([0.0, 0.0, 1.0])
    middle = np.abs(mesh.positions_mm[:, 0]) < 2000
    apart = []
    for side in (-1.0, 1.0):
        outward = np.array([0.0, side, 0.0])
        turned = (np.abs(mesh.normals[:, 0]) > 0.3) & (mesh.normals @ outward > 0.7)
        for vertex in rng.choice(np.flatnonzero(turned & middle), 12):
            normal, place = mesh.normals[vertex], mesh.positions_mm[vertex].astype(float)
            toward = normal + around
            sky = radiance_toward(light, toward, yaw_deg) * (toward[:, 2:] > 0)
            down = toward[(toward @ outward > 0) & (toward[:, 2] < 0)]
            at = place * (1, 1, 0) + down * (-place[2] / down[:, 2:]) * (1, 1, 0)
            rays = up + around[rng.integers(len(around), size=len(at))]
            ground = radiance_toward(light, rays, yaw_deg) * ~each_enters(at, rays, box)[:, None]
            shade = each_enters(at, np.tile(sun, (len(at), 1)), box)
            ground += np.array(light.lights[0].light) * sun[2] * ~shade[:, None]
            # half of the hemisphere about a level normal is below the horizon
            expected = sky.mean(axis=0) + albedo * ground.mean(axis=0) / 2
            apart.append(lit[vertex] / expected - 1)
    assert np.abs(apart).mean() < 0.06
    assert np.abs(apart).max() < 0.15


def test_light_between_white_boxes_in_an_even_sky_is_as_bright_as_the_sky():
    """A white furnace: only the third bounce, of light that is hidden three times, is missing."""
    even = Ambient.of(prefilter_environment("even", np.ones((64, 128, 3), np.float32)))
    boxes = [container_box("20", Pose((0.0, y, 0.0))) for y in (0.0, 3400.0)]
    low, high = boxes[0].corners_mm.min(axis=0), boxes[0].corners_mm.max(axis=0)
    white = 2 * [(1.0, 1.0, 1.0)]
    (found, _) = surrounding_light(boxes, white, 2 * [(low, high)], even, 0.0, None)
    hidden = 1 - found.sky.min()
    assert hidden > 0.4
    assert (found.sky + found.added).min() > 1 - 1.1 * hidden**3
    assert (found.sky + found.added).max() < 1.01


def test_the_top_of_a_lower_rail_is_in_the_shade_of_a_neighbour():
    """Its normal is that of the roof, which is in the open."""
    even = Ambient.of(prefilter_environment("even", np.ones((64, 128, 3), np.float32)))
    mesh = ShapeLibrary().container("20")
    boxes = [container_box("20", Pose((0.0, y, 0.0))) for y in (0.0, 2438.0 + 700.0)]
    black = (0.0, 0.0, 0.0)
    (found, _) = surrounding_light(
        boxes, 2 * [black], 2 * [mesh.bounds_mm], even, 0.0, Paving(0.0, black)
    )
    share = found.vertex_light(open_sky(mesh.normals), np.ones_like(mesh.normals), mesh)[:, 0]
    along, across, height = mesh.positions_mm.T
    rail = (mesh.normals[:, 2] > 0.7) & (height < 400) & (np.abs(along) < 2500)
    roof = (mesh.normals[:, 2] > 0.99) & (height > 2500) & (np.abs(across) < 500)
    rng = np.random.default_rng(3)
    around = rng.normal(size=(4000, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    for vertex in rng.choice(np.flatnonzero(rail & (across > 1100)), 12):
        toward = mesh.normals[vertex] + around
        start = np.tile(mesh.positions_mm[vertex].astype(float), (len(toward), 1))
        beside_wall = toward[:, 1] > 0
        seen = 1 - each_enters(start, toward, boxes[1])[beside_wall].mean()
        assert seen / 4 < share[vertex] < 1.5 * seen
    assert np.abs(share[roof] - 1).max() < 0.02


def each_enters(points, rays, box):
    """Return whether the ray [N, 3] from each point [N, 3] meets a box."""
    start, along = (points - box.center_mm) @ box.rotation, rays @ box.rotation
    with np.errstate(divide="ignore"):
        ends = np.sort([(-box.half_mm - start) / along, (box.half_mm - start) / along], axis=0)
    near, far = ends[0].max(axis=1), ends[1].min(axis=1)
    return (near < far) & (far > 1e-3)


def test_a_container_that_passes_the_camera_is_not_ignored(generator, scene):
    """Beside the camera its projection has no end, so nearly all of it is outside the image."""
    camera = Camera("beside", (0.0, -2600.0, 1500.0), (2000.0, -1219.0, 1200.0), 24.0)
    sample = generator.render(scene=scene, camera=camera)
    first = sample.objects[0]
    assert first.class_name == "container"
    assert first.area > 0.3 * SIZE[0] * SIZE[1]
    assert first.visible_fraction < 0.05
    assert not first.ignored
