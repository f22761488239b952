"""Distorted cameras compared with OpenCV, with rays through pixels and with dense points."""

import dataclasses
import json
import re
from itertools import combinations, product

import cv2
import numpy as np
import pytest
import trimesh

from fastgen.camera.lens import Distortion
from fastgen.camera.projection import View, view_of
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.formats.scene_file import view_values
from fastgen.generator import Generator
from fastgen.geometry import damage_law
from fastgen.geometry.container import build_container
from fastgen.geometry.divided_mesh import divided
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.spreader import build_spreader
from fastgen.labels.objects import labelled_decals
from fastgen.render.gl import open_context
from fastgen.render.regions import region_of
from fastgen.scene import Camera, Scene
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.optics import Lens
from tests import oracle
from tests.glsl import blocks, run
from tests.mesh_probe import caster
from tests.test_coverage import all_hits, dense

SIZE = (320, 240)
LENSES = {
    "wide fisheye": (Lens("fisheye", (-0.02, 0.003, -0.001, 0.0002)), 20.0),
    "barrel": (Lens("brown_conrady", (-0.22, 0.07, 0.0007, -0.0009, -0.008)), 24.0),
    "pincushion": (Lens("brown_conrady", (0.12, 0.02, -0.001, 0.0005, 0.0)), 28.0),
}


def camera(lens, focal_mm, **changes):
    values = dict(name="T", position_mm=(900, -5600, 1900), target_mm=(0, 0, 1300), roll_deg=4.0)
    return Camera(**{**values, **changes}, focal_mm=focal_mm, lens=lens)


def opencv(view, points_mm):
    """Return the pixels [N, 2] of world points [N, 3] as OpenCV projects them."""
    turn, _ = cv2.Rodrigues(view.rotation)
    lens = view.distortion.lens
    points = np.asarray(points_mm, np.float64).reshape(-1, 1, 3)
    coefficients = np.array(lens.coefficients)
    pose = (turn, view.translation_mm.reshape(3, 1), view.intrinsics)
    if lens.model == "fisheye":
        pixels, _ = cv2.fisheye.projectPoints(points, *pose, coefficients)
    else:
        pixels, _ = cv2.projectPoints(points, *pose, coefficients)
    return pixels.reshape(-1, 2)


def samples(lens, focal_mm):
    config = Config.from_values({"damage": {"probability": 1.0}})
    with Generator(config, seed=5, size=SIZE) as generator:
        for index in (1, 2):
            scene = generator.scene(index)
            sample = generator.render(scene=scene, camera=camera(lens, focal_mm))
            yield sample, PreparedScene(scene).container


@pytest.fixture(scope="module", params=LENSES, ids=lambda name: name.replace(" ", "_"))
def seen(request):
    return list(samples(*LENSES[request.param]))


@pytest.mark.parametrize("name", LENSES)
def test_points_in_the_image_project_as_in_opencv(name):
    view = view_of(camera(*LENSES[name]), SIZE)
    points = np.random.default_rng(3).uniform((-9e3, -1500, -3e3), (9e3, 1500, 6e3), (4000, 3))
    pixels, depth = view.project(points)
    inside = (depth > 0.3) & ((pixels > 0) & (pixels < SIZE)).all(axis=1)
    assert inside.sum() > 300
    np.testing.assert_allclose(pixels[inside], opencv(view, points[inside]), atol=1e-6)


@pytest.mark.parametrize("name", LENSES)
def test_pixel_rays_project_back_to_their_pixels(name):
    view = view_of(camera(*LENSES[name]), SIZE)
    origin, rays = view.rays()
    pixels, _ = view.project(origin + 7000 * rays)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    np.testing.assert_allclose(pixels, np.stack([x, y], axis=-1), atol=1e-6)


@pytest.mark.parametrize("name", LENSES)
def test_distorted_radius_grows_with_undistorted_radius(name):
    # the bare polynomial would fold distant points back into the image
    distortion = view_of(camera(*LENSES[name]), SIZE).distortion
    radius = np.linspace(0, 40, 4001)
    for angle in np.linspace(0, 2 * np.pi, 7):
        ideal = radius[:, None] * [np.cos(angle), np.sin(angle)]
        assert (np.diff(np.linalg.norm(distortion.apply(ideal), axis=1)) > 0).all()


@pytest.mark.parametrize(
    ("lens", "focal_mm"),
    [*LENSES.values(), (Lens("brown_conrady", (-0.15, 0.03, 0.02, -0.015, 0.0)), 24.0)],
)
def test_the_shader_removes_the_distortion(lens, focal_mm):
    view = view_of(camera(lens, focal_mm), SIZE)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    seen = np.stack([x, y], axis=-1).reshape(-1, 2)
    body = '#include "lens.glsl"\nvec4 f(vec4 x) { return vec4(undistorted(x.xy), 0.0, 0.0); }'
    with open_context() as gl:
        kept = blocks(
            gl,
            lens_center=view.center_px,
            lens_focal=view.focals_px,
            **view.distortion.shader_values,
        )
        # no texture is wide enough for all pixels in one row
        rows = np.pad(seen, ((0, 0), (0, 2))).reshape(SIZE[1], SIZE[0], 4)
        ideal = np.concatenate([run(gl, body, row, lens=True) for row in rows[::8]])[:, :2]
        del kept
    there = view.distortion.apply((ideal - view.center_px) / view.focal_px) * view.focal_px
    expected = seen.reshape(SIZE[1], SIZE[0], 2)[::8].reshape(-1, 2)
    np.testing.assert_allclose(there + view.center_px, expected, atol=0.05)


def test_ids_and_depth_equal_ray_casts_through_pixels(seen):
    for sample, mesh in seen:
        hits = oracle.cast(mesh, sample.view, sample.scene)
        ids = oracle.object_ids(sample.scene, mesh, hits)
        wrong = ids != sample.ids
        assert wrong.sum() <= 2e-4 * wrong.size
        threshold = Config.preset().damage.mask_threshold_mm
        damage = oracle.damage_values(sample.scene, hits, threshold)
        damage[hits.spreader] = 0
        assert (damage != sample.damage).sum() <= 3e-4 * wrong.size
        both = ~wrong & np.isfinite(hits.depth_m) & np.isfinite(sample.depth)
        apart = np.abs(hits.depth_m[both] - sample.depth[both])
        assert np.quantile(apart, 0.99) < 3e-3
        assert ids.max() > 1


def test_amodal_boxes_bound_dense_points_to_a_tenth_of_a_pixel(seen):
    compared = 0
    for sample, mesh in seen:
        damages = sample.scene.damages
        for item in sample.objects:
            if item.background:
                continue
            if item.class_name == "container":
                edges = mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
                share = np.linspace(0, 1, 5)[:, None, None]
                a, b = np.moveaxis(mesh.positions_mm[edges].astype(np.float64), 1, 0)
                # damage moves a triangle's corners, its edges stay straight
                a, b = (damage_law.deform(damages, end) for end in (a, b))
                points = (a + share * (b - a)).reshape(-1, 3)
            elif item.text or item.class_name[1:2].isdigit():
                points = dense(sample.scene, item.id)
            else:
                continue
            pixels, depth = sample.view.project(points)
            if depth.min() < 0.2:
                continue
            low, high = pixels.min(axis=0), pixels.max(axis=0)
            near = low.min() > -SIZE[0] and high.max() < 2 * SIZE[0]
            # damage moves every dense point of a decal, but only the corners of a triangle
            slack = 0.6 if damages and item.class_name != "container" else 0.1
            if near:
                np.testing.assert_allclose(item.amodal_bbox, (*low, *high), atol=slack)
                compared += 1
    assert compared > 10


def test_visible_fractions_equal_ray_casts_over_a_larger_image(seen):
    compared = 0
    pad = 100
    for sample, mesh in seen:
        larger = (SIZE[0] + 2 * pad, SIZE[1] + 2 * pad)
        whole = dataclasses.replace(sample.view, size=larger)
        hits = {}
        for item in sample.objects:
            if item.area < 60 or not (item.text or item.class_name[1:2].isdigit()):
                continue
            x0, y0, x1, y1 = item.amodal_bbox
            if min(x0, y0) < -pad or x1 > SIZE[0] + pad or y1 > SIZE[1] + pad:
                continue
            decal = labelled_decals(sample.scene)[item.id]
            number = mesh.chart_index(decal.face)
            if number not in hits:
                hits[number] = all_hits(sample.scene, decal.face, whole)
            ray, _, atlas = hits[number]
            on = oracle.inside(decal, atlas - mesh.charts[number].rect_mm[:2])
            fraction = item.area / len(np.unique(ray[on]))
            assert item.visible_fraction == pytest.approx(fraction, abs=0.02)
            compared += 1
    assert compared > 2


def test_casting_keypoints_equal_opencv_projections_of_the_corners(generators):
    (sample, _), *_ = samples(*LENSES["wide fisheye"])
    scene = dataclasses.replace(sample.scene, damages=())
    kind = KINDS[scene.container.kind]
    generator = generators(seed=5, size=SIZE)
    thing = generator.render(scene=scene, camera=sample.camera).objects[0]
    ends = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)])
    corners = ends * (kind.length_mm / 2, kind.width_mm / 2, kind.height_mm)
    found = np.array(thing.keypoints)
    shown = found[:, 2] > 0
    assert shown.sum() >= 4
    expected = opencv(sample.view, corners[shown])
    np.testing.assert_allclose(found[shown, :2], expected, atol=2e-3)


def test_a_lens_changes_nothing_else_in_a_scene_and_survives_json():
    plain = Config.preset()
    rig = {name: {"face": c.face} for name, c in plain.cameras.items()}
    rig["A"]["lens"] = {"model": "fisheye", "k1": [-0.03, 0.01], "k2": 0.002}
    rig["A"]["focal_mm"] = 20
    with_lens = Generator(Config.from_values({"cameras": rig}), seed=3).scene(8)
    without = Generator(plain, seed=3).scene(8)
    lens = with_lens.camera("A").lens
    assert lens.model == "fisheye"
    assert -0.03 <= lens.coefficients[0] <= 0.01
    assert lens.coefficients[1:] == (0.002, 0, 0)
    assert Scene.from_json(with_lens.to_json()) == with_lens
    cameras = (
        dataclasses.replace(with_lens.camera("A"), lens=None, focal_mm=14.5),
        *with_lens.cameras[1:],
    )
    assert dataclasses.replace(with_lens, cameras=cameras) == without


def test_scene_files_hold_everything_opencv_needs():
    lens, focal_mm = LENSES["barrel"]
    view = view_of(camera(lens, focal_mm), SIZE)
    values = json.loads(json.dumps(view_values(view)))
    turn, _ = cv2.Rodrigues(np.array(values["rotation"]))
    points = np.array([[0, -1200.0, 300], [800, -1200, 2000]])
    pose = (turn, np.array(values["translation_mm"]), np.array(values["intrinsics"]))
    pixels, _ = cv2.projectPoints(points, *pose, np.array(values["distortion"]))
    np.testing.assert_allclose(view.project(points)[0], pixels.reshape(-1, 2), atol=1e-6)


def test_a_divided_mesh_is_the_same_surface_with_short_edges():
    mesh = build_spreader("40", (True, False), 20.0)
    fine = divided(mesh, 200.0)
    corners = fine.positions_mm[fine.triangles].astype(np.float64)
    edges = np.roll(corners, 1, axis=1) - corners
    assert np.linalg.norm(edges, axis=2).max() <= 200.001

    def area(m):
        a, b, c = m.positions_mm[m.triangles].astype(np.float64).transpose(1, 0, 2)
        return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2

    assert area(fine) == pytest.approx(area(mesh), rel=1e-5)
    # every edge belongs to two triangles or more, matched by position: no neighbour skips a corner
    points, index = np.unique(fine.positions_mm.round(2), axis=0, return_inverse=True)
    whole = index.reshape(-1)[fine.triangles]
    before = np.unique(mesh.positions_mm.round(2), axis=0, return_inverse=True)[1]
    old = before.reshape(-1)[mesh.triangles]

    def alone(triangles):
        pairs = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        return np.unique(pairs, axis=0, return_counts=True)[1]

    assert (alone(old) >= 2).all()
    assert (alone(whole) >= 2).all()
    assert len(points) > len(mesh.positions_mm)


@pytest.mark.parametrize(
    ("lens", "words"),
    [
        (
            {"model": "fisheeye"},
            r"cameras.A.lens.model: 'fisheeye' is unknown \(did you mean fisheye",
        ),
        ({"model": "fisheye", "p1": 0.01}, r"cameras.A.lens.p1: fisheye has no p1"),
        ({"k4": 0.1}, r"cameras.A.lens.k4: brown_conrady has no k4"),
        ({"k1": [0.2, 0.1]}, r"cameras.A.lens.k1: the lowest value"),
    ],
)
def test_bad_lenses_are_named(lens, words):
    with pytest.raises(ConfigError, match=words):
        Config.from_values({"cameras": {"A": {"lens": lens}}})


@pytest.mark.parametrize(
    ("lens", "focal_mm", "words"),
    [
        (Lens("brown_conrady", (-0.9, 0, 0, 0, 0)), 20.0, "cameras.T.lens: its distortion folds"),
        (Lens("brown_conrady", (-0.25, 0.03, 0, -0.1, 0)), 20.0, "tangential distortion folds"),
        (Lens("fisheye", (0, 0, 0, 0)), 10.0, "look 90 degrees off the axis|look .* degrees off"),
    ],
)
def test_lenses_that_cannot_be_drawn_are_refused(lens, focal_mm, words):
    with pytest.raises(ConfigError, match=words):
        view_of(camera(lens, focal_mm), SIZE)


@pytest.mark.parametrize("p", [(0.0, -0.01), (0.02, 0.02), (0.05, 0.0)])
def test_strong_tangential_distortion_is_undone(p):
    distortion = Distortion(Lens("brown_conrady", (-0.2, 0.05, *p, 0.0)), (0.48, 0.36))
    ideal = np.random.default_rng(2).uniform(-0.4, 0.4, (500, 2))
    np.testing.assert_allclose(distortion.remove(distortion.apply(ideal)), ideal, atol=1e-9)


@pytest.mark.parametrize(
    ("position", "off_px"),
    [((300, -6800, 1400), 0.1), ((300, 200, -5600), 1 / 3), ((300, 200, 8400), 1 / 3)],
)
def test_mesh_edges_are_short_enough_for_lens_distortion(position, off_px):
    """Drawn triangles have straight edges between distorted corners.

    Each ray's hit point is compared with its exact projection through the lens.
    """
    box = build_container("40HC")
    target = (300, 200, 1300)
    wide = camera(LENSES["wide fisheye"][0], 22.0, position_mm=position, target_mm=target)
    view = view_of(wide, (640, 640))
    start, rays = view.rays()
    rays = rays.reshape(-1, 3)[::7]
    at, _, triangle = caster(box).intersects_location(
        np.tile(start, (len(rays), 1)), rays, multiple_hits=False
    )
    corners = box.positions_mm[box.triangles[triangle]].astype(float)
    weight = trimesh.triangles.points_to_barycentric(corners, at)
    pixels, depth = view.project(corners)
    weight = weight * depth
    drawn = (weight[..., None] * pixels).sum(axis=1) / weight.sum(axis=1)[:, None]
    off = np.linalg.norm(drawn - view.project(at)[0], axis=1)
    assert len(off) > 5000
    assert np.quantile(off, 0.99) < off_px


def test_a_lens_that_folds_only_outside_the_image_is_accepted():
    Distortion(Lens("brown_conrady", (-0.25, 0.03, 0.012, 0, 0)), (0.64, 0.48))
    with pytest.raises(ConfigError, match="folds"):
        Distortion(Lens("brown_conrady", (-0.25, 0.03, 0.02, 0, 0)), (0.64, 0.48))


def test_a_lens_without_distortion_is_a_pinhole():
    plain = view_of(camera(None, 28.0), SIZE)
    lens = view_of(camera(Lens("brown_conrady", (0.0,) * 5), 28.0), SIZE)
    points = np.random.default_rng(0).uniform(-1500, 1500, (50, 3))
    np.testing.assert_allclose(lens.project(points)[0], plain.project(points)[0], atol=1e-9)
    assert isinstance(plain, View)
    assert lens.half_angle_deg == pytest.approx(plain.half_angle_deg)


def test_a_rig_that_cannot_be_drawn_is_refused_with_the_focal_length_that_can():
    lens = {"model": "fisheye", "k1": [-0.1, 0.2]}

    def opened(focal_mm, size=SIZE):
        Generator(
            Config.from_values({"cameras": {"A": {"focal_mm": focal_mm, "lens": lens}}}), 0, size
        )

    for size in (SIZE, (96, 192)):  # a tall image sees more above and below
        words = (
            r"^cameras\.A\.focal_mm: 4 mm is too short for this lens at .*; use at least (.*) mm,"
        )
        with pytest.raises(ConfigError, match=words) as caught:
            opened(4, size)
        least_mm = float(re.match(words, str(caught.value))[1])
        opened(least_mm, size)
        with pytest.raises(ConfigError, match=f"use at least {least_mm:g} mm"):
            opened(least_mm - 0.1, size)


def test_the_shaded_region_contains_edges_bowed_by_a_fisheye():
    """Dense points on a box's edges are checked in large images through the widest fisheye."""
    size = 4096
    focal_mm = 18 * 2**0.5 / np.deg2rad(77)
    corners = np.array(list(product((-6096.0, 6096.0), (-1219.0, 1219.0), (0.0, 2896.0))))
    pairs = [(a, b) for a, b in combinations(corners, 2) if (a != b).sum() == 1]
    along = np.linspace(0, 1, 4001)[:, None]
    edges = np.concatenate([a + along * (b - a) for a, b in pairs])
    rng = np.random.default_rng(0)
    for _ in range(20):
        place = rng.uniform((-3000, -6000, -1500), (3000, -3000, 5000))
        lens = Lens("fisheye", (0.0, 0.0, 0.0, 0.0))
        camera = Camera("wide", tuple(place.tolist()), (0, 0, 1400), focal_mm, lens=lens)
        view = view_of(camera, (size, size))
        x, y, width, height = region_of(view, corners)
        pixels, depth = view.project(edges)
        seen = pixels[(depth > 0.1) & ((pixels > 0) & (pixels < size)).all(axis=1)]
        assert (seen >= (x, y)).all()
        assert (seen <= (x + width, y + height)).all()
