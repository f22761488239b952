"""Amodal boxes and visible fractions compared with rays through a larger image."""

import dataclasses
from functools import lru_cache

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen.camera.projection import View, view_of
from fastgen.classes import DAMAGE_CLASSES
from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.geometry import damage_law
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.spreader import build_spreader
from fastgen.labels.coverage import covered
from fastgen.labels.objects import labelled_decals
from fastgen.scene import Camera, Lens, Spreader
from tests import oracle

SIZE = (200, 150)
PAD = 160
LENSES = (
    Lens("brown_conrady", (-0.25, 0.06, 0.001, 0.0, 0.0)),
    Lens("brown_conrady", (0.15, 0.02, 0.0, -0.002, 0.0)),
    Lens("fisheye", (-0.05, 0.01, 0.0, 0.0)),
)


def unbounded(view):
    """Return the same view with PAD more pixels on each side."""
    return View(
        view.rotation, view.position_m, view.focal_px, (SIZE[0] + 2 * PAD, SIZE[1] + 2 * PAD)
    )


@lru_cache(12)  # the cameras of a scene follow each other in `samples`
def body_of(scene, chart):
    """Return the corners [T, 3, 3] of a container's triangles, and their Embree scene.

    Args:
        scene: The container's scene.
        chart: Name of the chart whose triangles count; None for the whole container.

    Returns:
        Corners before damage and after it in mm, on the atlas in mm, and the ray caster.
    """
    mesh = PreparedScene(scene).container
    part = mesh.triangles
    if chart is not None:
        part = part[mesh.chart[part[:, 0]] == mesh.chart_index(chart)]
    rest = mesh.positions_mm.astype(np.float64)
    moved = damage_law.deform(scene.damages, rest)
    body = RayMeshIntersector(trimesh.Trimesh(moved * 1e-3, part, process=False))
    return rest[part], moved[part], mesh.atlas_mm[part].astype(np.float64), body


def all_hits(scene, chart, view):
    """Return ray index, rest point and atlas point of every hit of pixel rays with a chart."""
    rest, moved, atlas, body = body_of(scene, chart)
    start, rays = view.rays()
    rays = rays.reshape(-1, 3)
    starts = np.broadcast_to(start * 1e-3, rays.shape)
    found, ray = body.intersects_id(starts, rays, multiple_hits=True, max_hits=60)
    _, b, c, _ = oracle._meet(moved[found], start, rays[ray])
    return ray, oracle._between(rest[found], b, c), oracle._between(atlas[found], b, c)


@lru_cache(64)
def dense(scene, item_id):
    """Return world points all over a decal after damage, mostly along its edge."""
    decal = labelled_decals(scene)[item_id]
    mesh = PreparedScene(scene).container
    coarse, fine = np.linspace(-0.5, 0.5, 41), np.linspace(-0.5, 0.5, 6001)
    points = [np.stack(np.meshgrid(coarse, coarse), axis=-1).reshape(-1, 2)]
    for side in (-0.5, 0.5):
        points += [np.stack(p, axis=1) for p in ((fine, 0 * fine + side), (0 * fine + side, fine))]
        points += [np.stack([fine, side - np.sign(side) * np.abs(fine)], axis=1)]
    points = np.concatenate(points) * (1 - 1e-9) * decal.size_mm
    angle = np.deg2rad(decal.rotation_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    sheet = points @ turn.T + np.array(decal.center_mm)
    sheet = sheet[oracle.inside(decal, sheet)]
    return damage_law.deform(scene.damages, mesh.sheet_to_surface(decal.face, sheet)[0])


def near(count, truth):
    """Return whether counts agree, except for pixel centres on an edge."""
    return abs(count - truth) <= max(2, 0.004 * truth)


@pytest.fixture(scope="module")
def generator():
    config = Config.from_values({"damage": {"probability": 1.0}})
    with Generator(config, seed=31, size=SIZE) as made:
        yield made


@pytest.fixture(scope="module")
def samples(generator):
    """Images from the rig's cameras and from close cameras whose images cut objects off."""
    return list(views(generator))


def views(generator):
    """Yield the images of `samples`."""
    for index in range(3):
        scene = generator.scene(index)
        if index == 1:
            scene = dataclasses.replace(scene, damages=())
        close = Camera("near", (2500, -2600, 1900), (1500, -1000, 1300), 24.0)
        for camera in (*scene.cameras, close):
            yield generator.render(scene=scene, camera=camera)
        mesh = PreparedScene(scene).container
        for decal in [d for d in scene.decals if d.class_name and d.face == "front"][:3]:
            (x, y, z), *_ = mesh.sheet_to_surface("front", decal.center_mm)[0]
            # at 4 m the image is 3.6 m wide, so its border crosses the decal
            cut = Camera("cut", (x + 1800, y - 4000, z), (x + 1800, y, z), 40.0)
            yield generator.render(scene=scene, camera=cut)


def test_decal_coverage_matches_rays(samples):
    seen = cut = 0
    for sample in samples:
        mesh = PreparedScene(sample.scene).container
        view = unbounded(sample.view)
        hits = {}
        for item in (o for o in sample.objects if o.class_name == "text" or o.class_name[0] == "C"):
            decal = labelled_decals(sample.scene)[item.id]
            number = mesh.chart_index(decal.face)
            if number not in hits:
                hits[number] = all_hits(sample.scene, decal.face, view)
            ray, _, atlas = hits[number]
            on = oracle.inside(decal, atlas - mesh.charts[number].rect_mm[:2])
            covered = np.zeros(view.size[::-1], bool)
            covered.ravel()[ray[on]] = True
            x0, y0, x1, y1 = item.amodal_bbox or (0, 0, 0, 0)
            if min(x0, y0) < -PAD or x1 > SIZE[0] + PAD or y1 > SIZE[1] + PAD:
                continue
            if item.area:
                assert near(round(item.area / item.visible_fraction), covered.sum())
                outside = covered.copy()
                outside[PAD:-PAD, PAD:-PAD] = False
                assert item.truncated == (outside.sum() > 0) or outside.sum() < 3
                hidden = covered.sum() - outside.sum() - item.area
                assert item.occluded == (hidden > 2) or hidden < 0.02 * item.area
                seen += 1
                cut += item.truncated
            if item.amodal_bbox:
                points = dense(sample.scene, item.id)
                pixels, depth = sample.view.project(points)
                if depth.min() > 0.2:
                    truth = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
                    # triangles are drawn flat, but the damage field also bends between vertices
                    limit = 2.0 if sample.scene.damages else 0.05
                    assert np.abs(truth - [x0, y0, x1, y1]).max() < limit
    assert seen > 60
    assert cut > 3


def test_damage_coverage_matches_rays(generator, samples):
    seen = 0
    threshold = generator.config.damage.mask_threshold_mm
    for sample in samples:
        view = unbounded(sample.view)
        ray, rest, _ = all_hits(sample.scene, None, view)
        hurt = [item for item in sample.objects if item.class_name in DAMAGE_CLASSES]
        for item, damage in zip(hurt, sample.scene.damages, strict=True):
            assert item.class_name == damage.kind
            if not item.area:
                continue
            part = np.abs(damage_law.amount_mm(damage, rest)) > threshold
            part |= damage_law.in_hole(damage, rest)
            covered = np.zeros(view.size[::-1], bool)
            covered.ravel()[ray[part]] = True
            box = np.array(oracle.box_of(covered)) - PAD
            if box.min() <= -PAD or (box[2:] >= np.array(SIZE) + PAD).any():
                continue
            assert near(round(item.area / item.visible_fraction), covered.sum())
            assert np.abs(box - np.array(item.amodal_bbox)).max() <= 1
            seen += 1
    assert seen > 8


def test_coarse_sampling_outside_a_large_image_keeps_damage_boxes_and_fractions(monkeypatch):
    """The expected labels are from a small image, where all sampling is fine."""
    damage = {"probability": 1.0, "kinds": ["concave"], "faces": ["door"], "count": [2, 2]}
    config = Config.from_values({"damage": damage, "spreader": {"probability": 0.0}})
    with (
        Generator(config, seed=3, size=(96, 72)) as small,
        Generator(config, seed=3, size=(288, 216)) as large,
    ):
        scene = small.scene(0)
        first, second = scene.damages
        along = np.array(first.along)
        beside = tuple((np.array(first.origin_mm) + 300 * along).tolist())
        second = dataclasses.replace(second, origin_mm=beside)
        scene = dataclasses.replace(scene, damages=(first, second))
        target = np.array(first.origin_mm) + 700 * along
        camera = scene.camera("Cr")
        camera = dataclasses.replace(camera, target_mm=tuple(target.tolist()), focal_mm=120.0)
        wanted = small.render(scene=scene, camera=camera).objects
        monkeypatch.setattr("fastgen.labels.surface_points._MOST_POINTS", 40_000)
        found = large.render(scene=scene, camera=camera).objects
    pairs = [(a, b) for a, b in zip(wanted, found, strict=True) if a.class_name == "concave"]
    assert len(pairs) == 2
    for a, b in pairs:
        assert a.truncated
        assert b.truncated
        assert b.visible_fraction == pytest.approx(a.visible_fraction, rel=0.05)
        assert np.abs(np.array(b.amodal_bbox) - 3 * np.array(a.amodal_bbox)).max() <= 12


def test_container_coverage_matches_its_silhouette(samples):
    cut = 0
    for sample in samples:
        mesh = PreparedScene(sample.scene).container
        bare = dataclasses.replace(sample.scene, spreader=Spreader())
        whole = oracle.cast(mesh, unbounded(sample.view), bare).hit
        container = sample.objects[0]
        box = np.array(oracle.box_of(whole)) - PAD
        if box.min() <= -PAD or (box[2:] >= np.array(SIZE) + PAD).any():
            continue
        assert near(round(container.area / container.visible_fraction), whole.sum())
        assert np.abs(box - np.array(container.amodal_bbox)).max() < 1.01
        cut += container.truncated
    assert cut


def test_spreader_coverage_matches_rays(samples):
    seen = hidden = 0
    for sample in samples:
        held = sample.scene.spreader
        if not held.present:
            assert all(item.class_name != "spreader" for item in sample.objects)
            continue
        mesh = build_spreader(sample.scene.container.kind, held.flippers_down, held.gap_mm)
        whole = oracle.cast(mesh, unbounded(sample.view)).hit
        item = next(item for item in sample.objects if item.class_name == "spreader")
        assert item.area == (sample.ids == item.id).sum()
        assert item.bbox == oracle.box_of(sample.ids == item.id)
        if item.area and not (whole[0].any() or whole[:, 0].any() or whole[:, -1].any()):
            assert near(round(item.area / item.visible_fraction), whole.sum())
            seen += 1
            hidden += item.occluded
            behind = whole[PAD:-PAD, PAD:-PAD].sum() - item.area  # pixels that show the container
            assert item.occluded == (behind > 2) or abs(behind) < 0.02 * item.area
    assert seen > 1
    assert hidden


def test_casting_keypoint_visibility_matches_rays(samples):
    flags = set()
    for sample in samples:
        mesh = PreparedScene(sample.scene).container
        low, high = mesh.bounds_mm
        _, body = oracle.body_of(mesh, sample.scene.damages)
        eye = sample.view.position_m
        held = sample.scene.spreader
        if held.present:
            mesh_of = build_spreader(sample.scene.container.kind, held.flippers_down, held.gap_mm)
            _, held = oracle.body_of(mesh_of, ())
        else:
            held = None
        for number, (x, y, flag) in enumerate(sample.objects[0].keypoints):
            corner = [(low, high)[number >> 2 & 1][0], (low, high)[number >> 1 & 1][1]]
            corner = np.array([*corner, (low, high)[number & 1][2]], np.float64)
            corner = damage_law.deform(sample.scene.damages, corner)
            pixel, depth = sample.view.project(corner)
            inside = depth > 0 and (pixel >= 0).all() and (pixel < SIZE).all()
            assert (flag > 0) == inside
            if not inside:
                continue
            assert np.abs(pixel - (x, y)).max() < 1.0
            # a point just outside the corner is visible if nothing is in the way
            point = corner * 1e-3 + 2e-3 * np.sign(corner - (0, 0, high[2] / 2))
            ray = point - eye
            reach = np.linalg.norm(ray)
            where, _, _ = body.intersects_location([eye], [ray / reach])
            others, _, _ = held.intersects_location([eye], [ray / reach]) if held else ([],) * 3
            meets = [np.linalg.norm(at - eye) for at in (*where, *others)]
            free = min(meets, default=np.inf) > reach
            assert (flag == 2) == free
            flags.add(flag)
    assert flags == {1, 2}


def test_pixels_of_abutting_polygons_are_counted_exactly_once():
    rng = np.random.default_rng(3)
    corners = rng.uniform(-20, 60, (50, 3, 2))
    owner = np.repeat(np.arange(5), 10)
    found = covered(corners, owner, 5, (50, 40))
    lower = covered(corners, owner, 5, (50, 40), (3, 10, 47, 40))
    image = np.zeros((40, 50), bool)
    image[10:, :] = True
    hidden = found.area - found.shown(image)
    (pixel, whose), (lower_pixel, lower_whose) = found.pixels(), lower.pixels()
    assert (lower.shown(image) == lower.area).all()
    columns, rows = np.meshgrid(np.arange(-30, 80) + 0.5, np.arange(-30, 80) + 0.5)
    for number in range(5):
        truth = np.zeros(columns.shape, bool)
        for a, b, c in corners[owner == number]:
            sides = [
                (q[0] - p[0]) * (rows - p[1]) - (q[1] - p[1]) * (columns - p[0])
                for p, q in ((a, b), (b, c), (c, a))
            ]
            truth |= np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)
        within = truth[30:70, 30:80]
        assert found.beyond[number] == lower.beyond[number] == truth.sum() - within.sum()
        assert hidden[number] == within[:10].sum()
        assert found.area[number] == within.sum()
        assert (pixel[whose == number] == np.flatnonzero(within)).all()
        within[:10] = within[:, :3] = within[:, 47:] = False
        assert (lower_pixel[lower_whose == number] == np.flatnonzero(within)).all()


def test_huge_objects_are_counted_to_within_a_thousandth():
    square = np.array([[[-9e5, -8e5], [7e5, -8e5], [7e5, 9e5], [-9e5, 9e5]]])
    found = covered(square, np.zeros(1, np.int64), 1, (64, 48))
    assert (found.pixels()[0] == np.arange(64 * 48)).all()
    assert found.beyond == pytest.approx(16e5 * 17e5, rel=1e-3)


@pytest.mark.parametrize("lens", LENSES)
def test_vertices_at_the_rim_bound_the_container_in_images_with_lens_distortion(lens):
    """Labels use these vertices. The expected box is that of all vertices of the mesh."""
    config = Config.from_values({"damage": {"probability": 0.7}, "spreader": {"probability": 0}})
    generator = Generator(config, seed=8)
    rng = np.random.default_rng(4)
    compared = 0
    for index in range(12):
        scene = generator.scene(index)
        prepared = PreparedScene(scene)
        every = damage_law.deform(scene.damages, prepared.container.points_mm)
        for _ in range(6):
            eye = rng.uniform((-14000, -9000, -3000), (14000, 9000, 9000))
            target = rng.uniform((-6000, -1200, 0), (6000, 1200, 2600))
            view = view_of(Camera("a", tuple(eye), tuple(target), 28.0, lens=lens), SIZE)
            pixels, depth = view.project(every)
            if depth.min() < 0.1:
                continue
            rim, _ = view.project(prepared.rim_points_mm)
            np.testing.assert_allclose(rim.min(axis=0), pixels.min(axis=0), atol=0.01)
            np.testing.assert_allclose(rim.max(axis=0), pixels.max(axis=0), atol=0.01)
            compared += 1
    assert compared > 20


def test_a_container_of_many_rows_is_counted_to_a_thousandth():
    view = view_of(Camera("a", (0.0, -3500.0, 1300.0), (0.0, 0.0, 1300.0), 24.0), SIZE)
    for times in (1.0, 20.0, 300.0):
        polygon = times * np.array(
            [[[-60.0, -30.0], [210.0, 20.0], [190.0, 170.0], [-40.0, 120.0]]]
        )
        found = covered(polygon, np.zeros(1, np.int64), 1, view.size)
        x, y = polygon[0].T
        area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
        whole = int(found.area[0] + found.beyond[0])
        assert whole == pytest.approx(area, rel=1e-2 if times == 1 else 1e-3)
