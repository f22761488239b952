"""Several containers in a scene: images and labels against rays, and order."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.classes import BUNDLED_DAMAGE_CLASSES, DAMAGE_VALUES
from fastgen.render import shadows
from fastgen.render.depth_map import DepthMap
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
ROW = tuple(Pose((0.0, 3000.0 * k, 0.0)) for k in (1, 2, 3))
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


def test_pixels_equal_the_nearest_hit_of_rays_for_every_kind_of_damage(generators):
    damage = {"probability": 1, "count": [6, 8], "kinds": list(BUNDLED_DAMAGE_CLASSES)}
    config = Config.from_values({"damage": damage, "seals": {"probability": 0}})
    generator = generators(config, seed=6, size=SIZE, quality="draft")
    first, *others = (generator.scene(i) for i in range(4))
    several = replace(first, spreader=Spreader(), neighbours=neighbours_of(others, ROW))
    kinds = {each.kind for part in (several, *several.neighbours) for each in part.damages}
    assert kinds == set(BUNDLED_DAMAGE_CLASSES)
    for camera in CAMERAS[:2]:
        sample = generator.render(scene=several, camera=camera)
        found = expected(several, camera)
        for drawn, wanted in ((sample.ids, found.ids), (sample.damage, found.damage)):
            wrong = drawn != wanted
            assert wrong.mean() < 4e-4
            assert (oracle.near_edge(found.damage) | oracle.near_edge(found.ids))[wrong].all()


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


def test_sharing_shadow_maps_does_not_change_the_image(generators, scene, monkeypatch):
    lit = replace(scene, environment=EnvironmentView("port_noon", 0.0))
    generator = generators(CONFIG, seed=6, size=SIZE, quality="draft")
    wanted = [generator.render(scene=lit, camera=each).image for each in CAMERAS[:2]]
    drawn, draw = [], DepthMap.draw

    def counted(depth_map, views):
        drawn.append(depth_map)
        draw(depth_map, views)

    monkeypatch.setattr(DepthMap, "draw", counted)
    monkeypatch.setattr(shadows, "_MAPS", 2)
    counts = []
    with Generator(CONFIG, seed=6, size=SIZE, quality="draft") as sharing:
        for camera, image in zip(CAMERAS[:2], wanted, strict=True):
            drawn.clear()
            np.testing.assert_array_equal(sharing.render(scene=lit, camera=camera).image, image)
            counts.append((len(drawn), len(set(drawn))))
    # the second image keeps the map of the first container
    assert counts == [(4, 2), (3, 1)]


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


def test_a_container_that_passes_the_camera_is_not_ignored(generator, scene):
    """Beside the camera its projection has no end, so nearly all of it is outside the image."""
    camera = Camera("beside", (0.0, -2600.0, 1500.0), (2000.0, -1219.0, 1200.0), 24.0)
    sample = generator.render(scene=scene, camera=camera)
    first = sample.objects[0]
    assert first.class_name == "container"
    assert first.area > 0.3 * SIZE[0] * SIZE[1]
    assert first.visible_fraction < 0.05
    assert not first.ignored
