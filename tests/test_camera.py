"""Camera projection compared with independent algebra."""

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.scene import Camera
from fastgen.scene.limits import FAR_M, NEAR_M

SIZE = (640, 480)


def camera(**changes):
    values = dict(name="T", position_mm=(0, -5000, 1000), target_mm=(0, 0, 1000), focal_mm=28.0)
    return Camera(**{**values, **changes})


def test_the_target_is_at_the_image_centre_at_its_distance():
    view = view_of(camera(position_mm=(3000, -4000, 2500), roll_deg=7), SIZE)
    pixel, depth = view.project(np.array([0, 0, 1000.0]))
    np.testing.assert_allclose(pixel, [320, 240], atol=1e-9)
    np.testing.assert_allclose(depth, np.linalg.norm([3, 4, 1.5]))


def test_sensor_width_spans_the_image_width():
    # at 5 m, f = 28 mm and a 36 mm sensor, the view is 5 * 36 / 28 m wide
    half = 5000 * 36 / 28 / 2
    pixel, _ = view_of(camera(), SIZE).project(np.array([[half, 0, 1000.0], [-half, 0, 1000.0]]))
    np.testing.assert_allclose(pixel, [[640, 240], [0, 240]], atol=1e-9)


def test_world_up_is_image_up_and_right_is_right():
    view = view_of(camera(), SIZE)
    pixel, _ = view.project(np.array([[0, 0, 2000.0], [1000.0, 0, 1000]]))
    assert pixel[0, 1] < 240
    assert pixel[0, 0] == pytest.approx(320)
    assert pixel[1, 0] > 320


def test_roll_turns_the_image_clockwise():
    pixel, _ = view_of(camera(roll_deg=90), SIZE).project(np.array([0, 0, 2000.0]))
    assert pixel[0] > 320  # what was above is now to the right
    assert pixel[1] == pytest.approx(240)


def test_rays_pass_through_the_points_they_see():
    view = view_of(camera(position_mm=(2000, -5000, 3000), roll_deg=3), SIZE)
    origin, directions = view.rays()
    for row, column in [(0, 0), (479, 639), (100, 333)]:
        pixel, _ = view.project(origin + 7000 * directions[row, column])
        np.testing.assert_allclose(pixel, [column + 0.5, row + 0.5], atol=1e-6)


def test_clip_matrix_agrees_with_project():
    view = view_of(camera(position_mm=(2000, -5000, 3000), roll_deg=3), SIZE)
    points = np.random.default_rng(1).uniform(-2000, 2000, (50, 3))
    pixel, depth = view.project(points)
    clip = np.c_[points * 1e-3, np.ones(50)] @ view.clip_matrix().T
    np.testing.assert_allclose(clip[:, 3], depth)
    ndc = clip[:, :3] / clip[:, 3:]
    np.testing.assert_allclose((ndc[:, :2] + 1) / 2 * SIZE, pixel, atol=1e-6)
    order = np.argsort(depth)
    assert (np.diff(ndc[order, 2]) > 0).all()


def test_near_and_far_planes_bound_the_depth_range():
    view = view_of(camera(), SIZE)
    points = np.array([[0, -5.0 + NEAR_M, 1.0, 1], [0, -5.0 + FAR_M, 1.0, 1]])
    clip = points @ view.clip_matrix().T
    np.testing.assert_allclose(clip[:, 2] / clip[:, 3], [-1, 1], atol=1e-9)


def test_a_camera_that_looks_straight_down_has_a_valid_rotation():
    view = view_of(camera(position_mm=(0, 0, 9000), target_mm=(0, 0, 0)), SIZE)
    np.testing.assert_allclose(view.rotation @ view.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.rotation) == pytest.approx(1)


@pytest.mark.parametrize("face", ["front", "back", "door", "no_door"])
def test_positive_azimuth_moves_right_and_positive_elevation_moves_up(face):
    """Measure the moves along the axes of the camera that looks straight at the face."""
    still = {"target_shift_mm": 0, "roll_deg": 0, "distance_mm": 9000, "focal_mm": 20}

    def placed(**angles):
        angles = {"azimuth_deg": 0, "elevation_deg": 0, **angles}
        rig = {"T": {"face": face, **still, **angles}}
        return Generator(Config.from_values({"cameras": rig}), seed=1).scene(0).camera("T")

    right, down, forward = view_of(placed(), (64, 64)).rotation
    first = np.array(placed().position_mm)
    turned = np.array(placed(azimuth_deg=30).position_mm) - first
    lifted = np.array(placed(elevation_deg=30).position_mm) - first
    for moved, toward in ((turned, right), (lifted, -down)):
        assert moved @ toward == pytest.approx(4500, abs=1)
        assert moved @ forward == pytest.approx(9000 * (1 - np.cos(np.pi / 6)), abs=1)
