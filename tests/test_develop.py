"""Effect of each part of the sensor model on an image, one part at a time."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from fastgen.camera import weather as falling
from fastgen.camera.electronics import stamped
from fastgen.camera.projection import view_of
from fastgen.camera.sensor import develop
from fastgen.camera.tone_curve import light_of
from fastgen.camera.weather import rained
from fastgen.config.config import Config
from fastgen.frame import Frame
from fastgen.generator import Generator
from fastgen.scene import Camera
from fastgen.scene.optics import Defocus, Noise, Rain, Sensor, Stamp, Weather

SIZE = (161, 121)
CAMERA = Camera("T", (0, -6000, 1200), (0, 0, 1200), 24.0)
AIR = (0.5, 0.5, 0.5)


def recorded(image, sensor, depth_m=6.0):
    """Return `image` [H, W, 3] as recorded by a camera with `sensor` from `depth_m` away."""
    height, width = image.shape[:2]
    frame = Frame(
        image=image,
        cover=np.full((height, width), 255, np.uint8),
        ids=np.ones((height, width), np.uint16),
        damage=np.full((height, width), 1, np.uint16),
        depth=np.full((height, width), depth_m, np.float32),
    )
    camera = replace(CAMERA, sensor=sensor)
    view = view_of(camera, (width, height))
    return develop(frame, view, camera, Weather(), AIR).image


def even(level=110):
    return np.full((SIZE[1], SIZE[0], 3), level, np.uint8)


def point():
    """Return a dark image with one bright pixel near its centre."""
    image = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    image[60, 80] = 250
    return image


def ratio(after, before):
    return light_of(after).mean(axis=(0, 1)) / light_of(before).mean(axis=(0, 1))


def test_exposure_error_is_in_stops():
    for stops in (-1.0, 0.5):
        found = ratio(recorded(even(), Sensor(exposure_error_ev=stops)), even())
        np.testing.assert_allclose(found, 2**stops, rtol=0.02)


def test_white_balance_multiplies_channels():
    found = ratio(recorded(even(), Sensor(gains=(1.25, 1.0, 0.8))), even())
    np.testing.assert_allclose(found, (1.25, 1.0, 0.8), rtol=0.02)


def test_white_balance_follows_photon_noise_and_keeps_the_signal_to_noise_ratio():
    sensor = Sensor(gains=(1.5, 1.0, 0.7), noise=Noise(2000, 0.0, 3))
    light = light_of(recorded(even(), sensor)).reshape(-1, 3)
    level = light_of(even())[0, 0, 0]
    np.testing.assert_allclose(
        light.mean(axis=0) / light.std(axis=0), (level * 2000) ** 0.5, rtol=0.05
    )


def test_exposure_error_precedes_photon_noise():
    light = light_of(recorded(even(), Sensor(exposure_error_ev=-2.0, noise=Noise(2000, 0.0, 3))))
    counted = light_of(even())[0, 0, 0] / 4 * 2000
    assert light.mean() / light.std() == pytest.approx(counted**0.5, rel=0.05)


def test_corners_darken_by_the_vignetting():
    light = light_of(recorded(even(), Sensor(vignetting=0.5)))[..., 0]
    assert light[60, 80] == pytest.approx(light_of(even())[0, 0, 0], rel=0.02)
    assert light[0, 0] / light[60, 80] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("motion", "rows", "columns"), [((0.1, 0.0), 1, 16), ((0.0, 0.1), 16, 1)])
def test_motion_is_right_and_down_in_image_widths(motion, rows, columns):
    lit = light_of(recorded(point(), Sensor(motion=motion)))[..., 0] > 0.01
    assert np.ptp(np.nonzero(lit)[0]) + 1 == pytest.approx(rows, abs=2)
    assert np.ptp(np.nonzero(lit)[1]) + 1 == pytest.approx(columns, abs=2)


def test_only_points_out_of_focus_are_blurred():
    sensor = Sensor(defocus=Defocus(6000, 1.0))
    np.testing.assert_array_equal(recorded(point(), sensor, depth_m=6.0) > 30, point() > 30)
    near = light_of(recorded(point(), sensor, depth_m=0.5))[..., 0]
    assert np.count_nonzero(near > 0.1 * near.max()) >= 5


def test_jpeg_compression_keeps_colours():
    image = even()
    image[:] = (220, 30, 60)
    apart = recorded(image, Sensor(jpeg_quality=90)).astype(int) - image
    assert np.abs(apart).max() < 8


@pytest.mark.parametrize("size", [(64, 64), (150, 400), (640, 360)])
def test_a_stamp_fits_into_the_image(size):
    image = np.full((size[1], size[0], 3), 90, np.uint8)
    for corner in ("top left", "top right", "bottom left", "bottom right"):
        changed = stamped(image, Stamp("2024-02-29 12:00:00", corner, 0.04)) != image
        columns = np.nonzero(changed.any(axis=(0, 2)))[0]
        assert columns.min() > 0
        assert columns.max() < size[0] - 1


def test_a_limit_on_the_number_of_drops_keeps_their_total_light(monkeypatch):
    view = view_of(CAMERA, SIZE)
    dark, far = np.zeros((121, 161, 3), np.float32), np.full((121, 161), np.inf, np.float32)

    def light():
        return rained(dark, far, view, Rain(30, 0.004, 0.1, 5), np.ones(3, np.float32)).mean()

    monkeypatch.setattr(falling, "_MOST_DROPS", 10**6)
    every = light()
    monkeypatch.setattr(falling, "_MOST_DROPS", 3000)
    assert every > 0
    assert light() == pytest.approx(every, rel=0.15)


def test_sampled_sensors_lie_within_their_ranges():
    values = {
        "sensor": {
            "white_balance_ev": [0.2, 0.3],
            "exposure_error_ev": [-0.9, -0.8],
            "defocus": {"probability": 1.0, "focus": [0.5, 0.6]},
        }
    }
    scene = Generator(Config.from_values(values), seed=3).scene(0)
    for camera in scene.cameras:
        sensor = camera.sensor
        away_mm = np.linalg.norm(np.subtract(camera.position_mm, camera.target_mm))
        assert 0.45 * away_mm < sensor.defocus.focus_mm < 0.65 * away_mm
        assert -0.9 <= sensor.exposure_error_ev <= -0.8
        red, green, blue = sensor.gains
        assert green == 1
        assert 2**0.2 <= min(red, blue) <= max(red, blue) <= 2**0.3 + 1e-4


@pytest.mark.parametrize(
    ("name", "hours"), [("port_noon", range(8, 17)), ("port_night", (21, 22, 23, 0, 1, 2, 3))]
)
def test_cameras_of_a_scene_share_one_timestamp_that_fits_the_light(name, hours):
    values = {
        "environment": {"names": [name]},
        "sensor": {"stamp": {"probability": 1.0, "years": [2020, 2021]}},
    }
    generator = Generator(Config.from_values(values), seed=2)
    shapes = ("%Y-%m-%d", "%d/%m/%Y", "%d.%m.%Y", "%Y/%m/%d")
    seen, found = set(), set()
    for index in range(60):
        texts = [camera.sensor.stamp.text for camera in generator.scene(index).cameras]
        moments = set()
        for text in texts:
            separator = next(c for c in "-/." if c in text)
            long = len(text.split(separator)[0]) == 4
            shape = next(s for s in shapes if separator in s and s.startswith("%Y") == long)
            seen.add(shape)
            moments.add(datetime.strptime(text, f"{shape} %H:%M:%S"))
        (moment,) = moments
        assert moment.year in (2020, 2021)
        assert moment.hour in hours
        found.add(moment)
    assert len(found) == 60
    assert seen == set(shapes)
