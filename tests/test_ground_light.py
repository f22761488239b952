"""Light on the ground between containers against Monte Carlo integrals, and its mean albedo."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.light.environment import load_environment, sky_irradiance, to_map_frame
from fastgen.light.ground_light import ground_light, mean_albedo
from fastgen.light.hdri import bundled_hdris
from fastgen.light.octahedral import octahedral_encode
from fastgen.light.surrounding_change import FACES, lattice
from fastgen.light.surrounding_light import surrounding_light
from fastgen.scene import REC_709, Ground, Pose
from fastgen.scene.boxes import container_box

ALBEDO = 0.3
AISLE_MM = 3000.0
WIDTH_MM = 2438.0
STACKS = [
    container_box("20", Pose((0.0, (WIDTH_MM + AISLE_MM) * row, 2591.0 * level)))
    for row in range(3)
    for level in range(2)
]
SUNS = [("port_golden", 90.0), ("port_golden", 0.0), ("port_noon", 90.0), ("port_overcast", 0.0)]


def face_radiance(boxes, light, yaw_deg):
    """Return the radiance [B, 6, 3] of the faces of boxes in one paint, without ground."""
    bounds = [(box.half_mm * (-1, -1, 0), box.half_mm * (1, 1, 2)) for box in boxes]
    paints = len(boxes) * [(ALBEDO,) * 3]
    changes = surrounding_light(boxes, paints, bounds, light, yaw_deg, None)
    return np.array([each.faces for each in changes])


class Rays:
    """Paths between boxes of one paint in an environment."""

    def __init__(self, boxes, light, yaw_deg):
        self.boxes, self.light, self.yaw_deg = boxes, light, yaw_deg
        self.rng = np.random.default_rng(1)

    def first(self, start, way):
        """Return the distance [N] of the nearest box on each ray, and the normal [N, 3] there."""
        nearest, normals = np.full(len(start), np.inf), np.zeros((len(start), 3))
        for box in self.boxes:
            at, along = (start - box.center_mm) @ box.rotation, way @ box.rotation
            with np.errstate(divide="ignore"):
                ends = np.sort([(-box.half_mm - at) / along, (box.half_mm - at) / along], axis=0)
            near, axis = ends[0].max(axis=1), ends[0].argmax(axis=1)
            hit = (near < ends[1].min(axis=1)) & (near > 0) & (near < nearest)
            nearest[hit] = near[hit]
            outward = -np.sign(along) * np.eye(3)[axis]
            normals[hit] = outward[hit] @ box.rotation.T
        return nearest, normals

    def radiance(self, start, way, bounces):
        """Return the radiance [N, 3] along rays from boxes and the sky, without the sun itself."""
        side = len(self.light.sky)
        cell = octahedral_encode(to_map_frame(way, self.yaw_deg)) * side
        column, row = np.clip(cell.astype(int), 0, side - 1).T
        found = self.light.sky[row, column].astype(float)
        away, normals = self.first(start, way)
        hit = np.isfinite(away)
        found[hit] = 0.0
        if bounces and hit.any():
            at = start[hit] + away[hit, None] * way[hit]
            found[hit] = ALBEDO * self.received(at, normals[hit], bounces - 1)
        return found

    def received(self, points, normals, bounces, suns=True):
        """Return an estimate of irradiance / pi [N, 3] at points with normals [N, 3]."""
        around = self.rng.normal(size=points.shape)
        way = normals + around / np.linalg.norm(around, axis=1, keepdims=True)
        found = self.radiance(points + normals, way, bounces)
        for sun in self.light.lights if suns else ():
            toward = np.tile(to_map_frame(sun.direction, -self.yaw_deg), (len(points), 1))
            open_ = np.isinf(self.first(points + normals, toward)[0])
            cosine = np.maximum((normals * toward).sum(axis=1), 0.0)
            found += (cosine * open_)[:, None] * np.array(sun.light)
        return found


@pytest.mark.parametrize(("name", "yaw_deg"), SUNS)
def test_ground_between_stacks_has_the_light_of_a_monte_carlo_integral(name, yaw_deg):
    light = load_environment(bundled_hdris()[name])
    faces = face_radiance(STACKS, light, yaw_deg)
    found = ground_light(STACKS, faces[:, :4], light, yaw_deg, 0.0)
    rays, up = Rays(STACKS, light, yaw_deg), np.tile((0.0, 0.0, 1.0), (10_000, 1))
    ratios = []
    for y in WIDTH_MM / 2 + AISLE_MM * np.array([0.15, 0.5, 0.85]):
        for place in ((-1500.0, y, 0.0), (1000.0, y + WIDTH_MM + AISLE_MM, 0.0)):
            expected = rays.received(np.tile(place, (len(up), 1)), up, 2, suns=False).mean(axis=0)
            texel = found.at(1e-3 * np.array([place[:2]]))[0, :3]
            ratios.append(texel @ REC_709 / (expected @ REC_709))
    assert 0.8 < np.mean(ratios) < 1.1
    assert np.abs(np.log(ratios)).max() < np.log(1.4)


@pytest.mark.parametrize(("name", "yaw_deg"), SUNS)
def test_walls_between_stacks_have_the_mean_radiance_of_a_monte_carlo_integral(name, yaw_deg):
    light = load_environment(bundled_hdris()[name])
    faces = face_radiance(STACKS, light, yaw_deg)
    rays, apart = Rays(STACKS, light, yaw_deg), []
    for box, radiance in zip(STACKS, faces, strict=True):
        for (axis, sign), own in zip(FACES[2:4], radiance[2:4], strict=True):
            local = rays.rng.uniform(-1, 1, (4000, 3)) * box.half_mm
            local[:, axis] = sign * box.half_mm[axis]
            normals = np.tile(sign * box.axes[axis], (len(local), 1))
            points = box.center_mm + local @ box.rotation.T
            expected = ALBEDO * rays.received(points, normals, 1).mean(axis=0)
            apart.append((own - expected) @ REC_709)
    brightest = (faces[:, 2:4] @ REC_709).max()
    assert np.abs(apart).mean() < 0.08 * brightest
    assert np.abs(apart).max() < 0.2 * brightest


def test_walls_in_a_row_see_the_sky_that_all_boxes_together_leave():
    """Boxes behind one another hide a part of the sky only once."""
    row = [container_box("20", Pose((0.0, 4000.0 * k, 0.0), 3.0 * k)) for k in range(5)]
    light = load_environment(bundled_hdris()["port_overcast"])
    rays, apart = Rays(row, light, 0.0), []
    size = row[0].half_mm
    bounds = [(np.array([-1, -1, 0]) * size, np.array([1, 1, 2]) * size)] * len(row)
    changes = surrounding_light(row, len(row) * [(ALBEDO,) * 3], bounds, light, 0.0, None)
    for box, change in zip(row, changes, strict=True):
        local, normals = lattice(size)
        points, toward = box.center_mm + local @ box.rotation.T, normals @ box.rotation.T
        for at, up, left in list(zip(points, toward, change.sky, strict=True))[::7]:
            around = rays.rng.normal(size=(1500, 3))
            way = up + around / np.linalg.norm(around, axis=1, keepdims=True)
            seen = np.isinf(rays.first(np.tile(at, (len(way), 1)), way)[0]).mean()
            apart.append(left[0] - seen)
    assert np.abs(apart).mean() < 0.015
    assert np.abs(apart).max() < 0.08


@pytest.mark.parametrize(("name", "yaw_deg"), SUNS)
def test_faces_of_a_box_alone_have_the_whole_light(name, yaw_deg):
    light = load_environment(bundled_hdris()[name])
    (found,) = face_radiance(STACKS[:1], light, yaw_deg)
    normals = np.array([sign * np.eye(3)[axis] for axis, sign in FACES])
    expected = sky_irradiance(light, normals, yaw_deg).astype(float)
    for sun in light.lights:
        toward = to_map_frame(sun.direction, -yaw_deg)
        expected += np.maximum(normals @ toward, 0.0)[:, None] * np.array(sun.light)
    np.testing.assert_allclose(found, ALBEDO * expected, rtol=1e-5)


def linear(encoded):
    """Return linear values of sRGB bytes."""
    values = encoded / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("wetness", [0.15, 0.3, 0.6, 1.0])
def test_mean_albedo_of_wet_ground_equals_its_baked_material(generators, wetness):
    generator = generators(Config.preset("gate"), seed=3, size=(64, 64), quality="draft")
    dry = Ground("concrete", -1200.0, (0.4, 0.4, 0.4), wear=0.0, lines=0.0, reach_mm=30000.0)
    wet = replace(dry, wetness=wetness)
    scene = generator.scene(0)
    of_dry, of_wet = (
        linear(generator.bake_ground(replace(scene, ground=each), texel_mm=30.0).base_color)
        for each in (dry, wet)
    )
    expected = of_wet.mean(axis=(0, 1)) / of_dry.mean(axis=(0, 1))
    assert expected.max() < 0.97
    found = np.divide(mean_albedo(wet), mean_albedo(dry))
    np.testing.assert_allclose(found, expected, rtol=0.02)
