"""Effect of each part of the sensor model on an image, one part at a time."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from fastgen.camera import weather as falling
from fastgen.camera.electronics import stamped
from fastgen.camera.projection import view_of
from fastgen.camera.sensor import apply_camera_model
from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.camera.weather import add_rain
from fastgen.config.config import Config
from fastgen.frame import Frame
from fastgen.generator import Generator
from fastgen.scene import Camera
from fastgen.scene.optics import Defocus, Noise, Rain, Sensor, Stamp, Weather
from tests.tone_inverse import light_of

SIZE = (161, 121)
CAMERA = Camera("T", (0, -6000, 1200), (0, 0, 1200), 24.0)
AIR = (0.5, 0.5, 0.5)


def recorded(light, sensor, depth_m=6.0):
    """Return the image of `light` [H, W, 3] from `depth_m` away by a camera with `sensor`."""
    height, width = light.shape[:2]
    frame = Frame(
        image=tone_map_and_encode(light),
        radiance=light,
        cover=np.full((height, width), 255, np.uint8),
        ids=np.ones((height, width), np.uint16),
        damage=np.full((height, width), 1, np.uint16),
        depth=np.full((height, width), depth_m, np.float32),
    )
    camera = replace(CAMERA, sensor=sensor)
    view = view_of(camera, (width, height))
    return apply_camera_model(frame, view, camera, Weather(), AIR)


LEVEL = 0.2


def even():
    return np.full((SIZE[1], SIZE[0], 3), LEVEL, np.float32)


def point(radiance=2.0):
    """Return darkness with one bright pixel near its centre."""
    light = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    light[60, 80] = radiance
    return light


def ratio(sensor):
    """Return how much brighter an even image is with `sensor`, for each channel."""
    return light_of(recorded(even(), sensor)).mean(axis=(0, 1)) / LEVEL


def test_exposure_error_is_in_stops():
    for stops in (-1.0, 0.5):
        found = ratio(Sensor(exposure_error_ev=stops))
        np.testing.assert_allclose(found, 2**stops, rtol=0.02)


def test_white_balance_multiplies_channels():
    found = ratio(Sensor(gains=(1.25, 1.0, 0.8)))
    np.testing.assert_allclose(found, (1.25, 1.0, 0.8), rtol=0.02)


def test_white_balance_follows_photon_noise_and_keeps_the_signal_to_noise_ratio():
    sensor = Sensor(gains=(1.5, 1.0, 0.7), noise=Noise(2000, 0.0, 3))
    light = light_of(recorded(even(), sensor)).reshape(-1, 3)
    np.testing.assert_allclose(
        light.mean(axis=0) / light.std(axis=0), (LEVEL * 2000) ** 0.5, rtol=0.05
    )


def test_exposure_error_precedes_photon_noise():
    light = light_of(recorded(even(), Sensor(exposure_error_ev=-2.0, noise=Noise(2000, 0.0, 3))))
    counted = LEVEL / 4 * 2000
    assert light.mean() / light.std() == pytest.approx(counted**0.5, rel=0.05)


def test_corners_darken_by_the_vignetting():
    light = light_of(recorded(even(), Sensor(vignetting=0.5)))[..., 0]
    assert light[60, 80] == pytest.approx(LEVEL, rel=0.02)
    assert light[0, 0] / light[60, 80] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("motion", "rows", "columns"), [((0.1, 0.0), 1, 16), ((0.0, 0.1), 16, 1)])
def test_motion_is_right_and_down_in_image_widths(motion, rows, columns):
    lit = light_of(recorded(point(), Sensor(motion=motion)))[..., 0] > 0.01
    assert np.ptp(np.nonzero(lit)[0]) + 1 == pytest.approx(rows, abs=2)
    assert np.ptp(np.nonzero(lit)[1]) + 1 == pytest.approx(columns, abs=2)


def test_only_points_out_of_focus_are_blurred():
    sensor = Sensor(defocus=Defocus(6000, 1.0))
    np.testing.assert_array_equal(recorded(point(), sensor, depth_m=6.0) > 30, point() > 0)
    near = light_of(recorded(point(), sensor, depth_m=0.5))[..., 0]
    assert np.count_nonzero(near > 0.1 * near.max()) >= 5


def test_defocus_spreads_more_light_from_a_brighter_lamp():
    """Both lamps are white in a sharp image. Defocus must use their radiance."""
    sensor = Sensor(defocus=Defocus(6000, 1.0))
    sharp, blurred = (
        [recorded(point(radiance), sensor, depth_m) for radiance in (2.0, 50.0)]
        for depth_m in (6.0, 0.5)
    )
    assert min(image[60, 80].min() for image in sharp) > 240
    faint, bright = (light_of(image) for image in blurred)
    disc = faint > 0.1 * faint.max()
    assert (bright[disc] > 5 * faint[disc]).all()


def test_jpeg_compression_keeps_colours():
    light = even()
    light[:] = (0.6, 0.06, 0.09)
    apart = recorded(light, Sensor(jpeg_quality=90)).astype(int) - tone_map_and_encode(light)
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
        return add_rain(dark, far, view, Rain(30, 0.004, 0.1, 5), np.ones(3, np.float32)).mean()

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
