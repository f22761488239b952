"""Damages that are drawn toward the cameras, compared with rays from the cameras."""

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.scene.container_kinds import KINDS
from tests.plain import FEW_DECALS

LENGTHS = np.linspace(0, 1, 400, endpoint=False)


def scenes_of(preset, share, count):
    values = {
        "damage": {"probability": 1, "toward_cameras": share},
        "placement": {"damaged": 1},
        "markings": FEW_DECALS,
    }
    generator = Generator(Config.from_values(values, base=Config.preset(preset)), seed=9)
    return [generator.scene(index) for index in range(count)]


def containers(scene):
    """Return kind, position [3], rotation [3, 3] to the world, and damages of each container."""
    found = [(scene.container.kind, np.zeros(3), np.eye(3), scene.damages)]
    for each in scene.neighbours:
        angle = np.deg2rad(each.pose.yaw_deg)
        cos, sin = np.cos(angle), np.sin(angle)
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        found.append((each.container.kind, np.array(each.pose.position_mm), turn, each.damages))
    return found


def inside(points, kind, position, turn):
    """Return whether any world point [N, 3] is within a container."""
    half = np.array([KINDS[kind].length_mm, KINDS[kind].width_mm, KINDS[kind].height_mm]) / 2
    local = (points - position) @ turn - [0, 0, half[2]]
    return bool((np.abs(local) < half - 20).all(axis=1).any())


def shown(scene, size):
    """Return for each damage whether a camera has a free line to its middle within its image."""
    bodies = containers(scene)
    found = []
    for _, position, turn, damages in bodies:
        for damage in damages:
            # just outside of the sheet, whose ribs and castings are not solid here
            point = position + turn @ (np.array(damage.origin_mm) - 40 * np.array(damage.inward))
            found.append(
                any(free_line(scene_camera, point, bodies, size) for scene_camera in scene.cameras)
            )
    return found


def free_line(camera, point, bodies, size):
    view = view_of(camera, size)
    pixel, depth = view.project(point)
    if depth <= 0 or not ((pixel >= 0) & (pixel <= size)).all():
        return False
    origin, direction = view.rays(pixel)
    # the ray of the pixel passes the point
    np.testing.assert_allclose(np.cross(direction, point - origin), 0, atol=1)
    steps = origin + LENGTHS[:, None] * (point - origin)
    return not any(inside(steps, *body[:3]) for body in bodies)


@pytest.mark.parametrize(("preset", "least"), [("seafront", 1.0), ("yard", 0.97)])
def test_damages_drawn_toward_cameras_are_in_view(preset, least):
    # damages of neighbours that no camera can show stay where they are
    def first(share):
        return [
            flag
            for scene in scenes_of(preset, share, 12)
            for flag in shown(scene, (640, 640))[: len(scene.damages)]
        ]

    toward, anywhere = first(1.0), first(0.0)
    assert len(toward) == len(anywhere) > 20
    assert np.mean(toward) >= least
    assert np.mean(anywhere) < 0.9


def test_more_damages_of_neighbours_are_in_view():
    def all_of(share):
        return np.mean(
            [
                f
                for s in scenes_of("gate", share, 15)
                for f in shown(s, (640, 640))[len(s.damages) :]
            ]
        )

    assert all_of(1.0) > 1.5 * all_of(0.0)


def test_the_share_changes_only_the_damages_that_it_moves():
    """A share below one leaves some damages where they were, and all kinds and numbers."""
    before, half = scenes_of("seafront", 0.0, 20), scenes_of("seafront", 0.5, 20)
    pairs = [
        (one, other)
        for a, b in zip(before, half, strict=True)
        for one, other in zip(a.damages, b.damages, strict=True)
    ]
    assert all(one.kind == other.kind for one, other in pairs)
    same = sum(one == other for one, other in pairs)
    assert 0.5 * len(pairs) < same < len(pairs)
