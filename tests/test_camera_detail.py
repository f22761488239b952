"""Sharpening and chroma noise of the camera, compared with filters and statistics."""

import numpy as np
import pytest

from fastgen.camera.electronics import sharpened, with_chroma_noise
from fastgen.camera.sensor import needs_radiance
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.scene import Camera
from fastgen.scene.optics import ChromaNoise, Sensor, Sharpening, Weather

LUMA = np.array([0.299, 0.587, 0.114])


def edge(dark, bright):
    image = np.full((20, 60, 3), dark, np.uint8)
    image[:, 30:] = bright
    return image


def test_sharpening_is_an_unsharp_mask_of_a_gaussian_blur():
    image = edge(80, 160)
    radius, amount = 1.5, 0.8
    away = np.arange(-12, 13)
    kernel = np.exp(-(away**2) / (2 * radius**2))
    line = image[10, :, 0].astype(float)
    blurred = np.convolve(np.pad(line, 12, "edge"), kernel / kernel.sum(), "valid")
    expected = line + amount * (line - blurred)
    # the blurred image is rounded to codes, and OpenCV cuts the kernel off
    sharp = sharpened(image, Sharpening(amount, radius))[10, :, 0]
    np.testing.assert_allclose(sharp, expected, atol=0.5 + 0.5 * amount + 0.5)
    assert sharp.max() > 175
    assert sharp.min() < 65


def test_even_areas_stay_and_halos_clip_at_black_and_white():
    sharp = sharpened(edge(5, 250), Sharpening(2.0, 1.0))
    assert (sharp[:, :20] == 5).all()
    assert (sharp[:, 40:] == 250).all()
    assert sharp.min() == 0
    assert sharp.max() == 255


def test_chroma_noise_keeps_luma_and_has_the_configured_strength():
    image = np.full((480, 640, 3), 120, np.uint8)
    strength = 0.02
    noisy = with_chroma_noise(image, ChromaNoise(strength, 4.0, 5)).astype(float)
    luma = noisy @ LUMA
    assert luma.mean() == pytest.approx(120, abs=0.05)
    # only the rounding of three channels: sqrt(0.299^2 + 0.587^2 + 0.114^2) / sqrt(12)
    assert luma.std() == pytest.approx(0.193, abs=0.02)
    for channel, factor in ((2, 1.772), (0, 1.402)):
        chroma = (noisy[..., channel] - luma) / factor
        assert chroma.std() == pytest.approx(255 * strength, rel=0.05)
    blue, red = noisy[..., 2] - luma, noisy[..., 0] - luma
    assert abs(np.corrcoef(blue.ravel(), red.ravel())[0, 1]) < 0.05


@pytest.mark.parametrize("scale_px", [4.0, 8.0])
def test_blotches_are_as_large_as_their_scale(scale_px):
    """The autocorrelation is that of linear interpolation between independent values.

    It is the cubic B-spline, which is 0 from two scales on.
    """
    image = np.full((480, 640, 3), 120, np.uint8)
    noisy = with_chroma_noise(image, ChromaNoise(0.03, scale_px, 2))[..., 2].astype(float) - 120
    for x, expected in ((0.5, 1 - 1.5 * 0.5**2 + 0.75 * 0.5**3), (1.0, 0.25), (2.5, 0.0)):
        step = round(x * scale_px)
        alike = (noisy[:, :-step] * noisy[:, step:]).mean() / noisy.var()
        assert alike == pytest.approx(expected, abs=0.06)


def test_chroma_noise_depends_only_on_its_seed():
    image = np.full((50, 70, 3), 120, np.uint8)
    first = with_chroma_noise(image, ChromaNoise(0.05, 4.0, 5))
    np.testing.assert_array_equal(first, with_chroma_noise(image, ChromaNoise(0.05, 4.0, 5)))
    assert (first != with_chroma_noise(image, ChromaNoise(0.05, 4.0, 6))).mean() > 0.8


def test_both_work_on_the_image_that_the_renderer_encodes():
    sensor = Sensor(chroma_noise=ChromaNoise(0.01, 4.0, 1), sharpening=Sharpening(0.5, 1.0))
    camera = Camera("T", (0, 9000, 0), (0, 0, 0), 35.0, sensor=sensor)
    assert not needs_radiance(camera, Weather())


def test_both_are_drawn_with_their_probability_and_within_their_ranges():
    values = {"chroma_noise": {"probability": 0.5}, "sharpening": {"probability": 0.5}}
    generator = Generator(Config.from_values({"sensor": values}), seed=3)
    sensors = [generator.scene(i).camera("A").sensor or Sensor() for i in range(200)]
    for name in values:
        assert 70 < sum(getattr(sensor, name) is not None for sensor in sensors) < 130
    strengths = [s.chroma_noise.strength for s in sensors if s.chroma_noise]
    assert 0.002 <= min(strengths) < max(strengths) <= 0.01
    both = sum(bool(s.chroma_noise and s.sharpening) for s in sensors)
    assert 30 < both < 70


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"sharpening": {"radius_px": 0}}, "sensor.sharpening.radius_px.*0.1 to 20"),
        ({"chroma_noise": {"strength": [0.1, 0.9]}}, "sensor.chroma_noise.strength.*0 to 0.5"),
    ],
)
def test_bad_values_are_named(values, words):
    with pytest.raises(ConfigError, match=words):
        Config.from_values({"sensor": values})
