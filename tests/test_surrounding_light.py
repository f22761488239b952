"""Light between containers, and between them and the ground, compared with rays."""

import numpy as np
import pytest

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
from fastgen.light.sky_visibility import (
    DIRECTIONS,
    Sky,
    SkyVisibility,
    open_sky,
    sky_directions,
    visible_share,
)
from fastgen.light.surrounding_change import lattice
from fastgen.light.surrounding_light import Paving, surrounding_light
from fastgen.scene import Pose
from fastgen.scene.boxes import container_box
from tests.test_several_containers import entered


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


def test_a_roof_under_another_container_mirrors_no_sky():
    even = Ambient.of(prefilter_environment("even", np.ones((64, 128, 3), np.float32)))
    mesh = ShapeLibrary().container("20")
    boxes = [container_box("20", Pose((0.0, 0.0, z))) for z in (0.0, 2640.0)]
    (found, above) = surrounding_light(
        boxes, 2 * [(0.0, 0.0, 0.0)], 2 * [mesh.bounds_mm], even, 0.0, None
    )
    light, sky = np.ones_like(mesh.normals), Sky(even, 0.0)
    open_ = open_sky(mesh.normals)
    bits = np.full((len(open_), DIRECTIONS // 8), 255, np.uint8)
    visibility = SkyVisibility.of(mesh.normals, bits, open_[:, :3])
    lower, upper = (
        visible_share(each.applied(visibility, sky, open_, light, mesh)) for each in (found, above)
    )
    roof = (mesh.normals[:, 2] > 0.99) & (mesh.positions_mm[:, 2] > 2500)
    assert lower[roof].mean() < 0.2
    assert lower[roof].max() < 0.4  # beside the edge of the roof
    assert upper[roof].min() > 0.98


def each_enters(points, rays, box):
    """Return whether the ray [N, 3] from each point [N, 3] meets a box."""
    start, along = (points - box.center_mm) @ box.rotation, rays @ box.rotation
    with np.errstate(divide="ignore"):
        ends = np.sort([(-box.half_mm - start) / along, (box.half_mm - start) / along], axis=0)
    near, far = ends[0].max(axis=1), ends[1].min(axis=1)
    return (near < far) & (far > 1e-3)
