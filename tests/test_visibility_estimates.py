"""Damages that are drawn toward the cameras, compared with rays from the cameras."""

import numpy as np

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.scene.container_kinds import KINDS
from tests.plain import FEW_DECALS

LENGTHS = np.linspace(0, 1, 400, endpoint=False)


def scenes_of(preset, share, count, **damage):
    values = {
        "damage": {"probability": 1, "toward_cameras": share, **damage},
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


def shown(scene, least_px=0.75 * 1e-3 * 640 * 640):
    """Return for each damage whether a camera shows its middle, not too grazing, and large enough.

    The limits are 2 degrees and a quarter wider than those of the sampler, which takes the damage
    at the middle of its perspective.
    """
    bodies = containers(scene)
    found = []
    for _, position, turn, damages in bodies:
        for damage in damages:
            outward = -np.array(damage.inward)
            # just outside of the sheet, because containers are solid here
            points = np.array([damage.origin_mm, *corners_of(damage)]) + 40 * outward
            points = position + points @ turn.T
            found.append(
                any(
                    free_line(camera, points[0], bodies)
                    and degrees_from(camera, points[0], turn @ outward) < 77
                    and pixels_of(camera, points[1:]) > least_px
                    for camera in scene.cameras
                )
            )
    return found


def corners_of(damage):
    """Return the corners [4, 3] of the rectangle of a damage, in order around it."""
    along, across = (
        0.5 * extent * np.array(axis)
        for extent, axis in zip(damage.size_mm, (damage.along, damage.across), strict=True)
    )
    sides = [along + across, along - across, -along - across, across - along]
    return np.array(damage.origin_mm) + sides


def degrees_from(camera, point, outward):
    way = np.array(camera.position_mm) - point
    return np.degrees(np.arccos(way @ outward / np.linalg.norm(way)))


def pixels_of(camera, corners):
    """Return the area of a polygon of world points in an image of 640x640 (shoelace formula)."""
    x, y = view_of(camera, (640, 640)).project(corners)[0].T
    return 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def free_line(camera, point, bodies):
    """Return whether a camera's image contains a point, with no container on the way."""
    view = view_of(camera, (640, 640))
    pixel, depth = view.project(point)
    if depth <= 0 or not ((pixel >= 0) & (pixel <= 640)).all():
        return False
    eye = np.array(camera.position_mm)
    way = eye + LENGTHS[:, None] * (point - eye)
    return not any(inside(way, *body[:3]) for body in bodies)


def views_of(preset, share):
    """Return whether a camera shows each damage of first containers, and of neighbours."""
    first, others = [], []
    for scene in scenes_of(preset, share, 12):
        flags = shown(scene)
        first += flags[: len(scene.damages)]
        others += flags[len(scene.damages) :]
    return first, others


def test_all_damages_drawn_toward_the_cameras_of_seafront_are_shown():
    (toward, _), (anywhere, _) = views_of("seafront", 1.0), views_of("seafront", 0.0)
    assert len(toward) == len(anywhere) > 20
    assert all(toward)
    assert np.mean(anywhere) < 0.9


def test_damages_drawn_toward_cameras_are_shown_among_neighbours():
    toward, anywhere = views_of("gate", 1.0), views_of("gate", 0.0)
    # some damages are too small for the cameras wherever they are
    assert np.mean(toward[0]) > 0.9
    assert np.mean(anywhere[0]) < 0.8
    # and no camera may see a neighbour
    assert np.mean(toward[1]) > 1.5 * np.mean(anywhere[1]) > 0


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


def test_damages_that_are_small_in_all_images_are_drawn_where_cameras_see_them():
    """Holes of 30 mm cover less than 0.1 % of the images of gate."""
    small = {
        "kinds": ["perforation"],
        "perforation": {"torn": 0, "diameter_mm": 30, "rim_mm": 5, "depth_mm": 5},
    }
    toward, anywhere = (scenes_of("gate", share, 12, **small) for share in (1.0, 0.0))
    assert not any(any(shown(scene)) for scene in toward)
    seen, before = (
        [flag for scene in scenes for flag in shown(scene, 0.0)[: len(scene.damages)]]
        for scenes in (toward, anywhere)
    )
    assert len(seen) > 20
    assert np.mean(seen) > 0.95
    assert np.mean(before) < 0.85
