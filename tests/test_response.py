"""Response curves of cameras compared with a scalar twin and with their defining properties."""

import numpy as np
import pytest

from fastgen.camera.response import respond, response_curve
from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.scene.optics import Response

SIZE = (160, 120)
GREY = 1.055 * 0.18 ** (1 / 2.4) - 0.055


def recorded(pixel, response):
    """Return the codes of one pixel, computed channel by channel with plain numbers."""
    wells = [min(max(value, 0.0), response.clip) for value in pixel]
    luminance = 0.2126 * wells[0] + 0.7152 * wells[1] + 0.0722 * wells[2]
    codes = []
    for value in wells:
        vivid = luminance + response.saturation * (value - luminance)
        x = min(max(vivid, 0.0), response.clip)
        knee = 2 - response.clip
        y = x if x <= knee else 1 - (response.clip - x) ** 2 / (4 * (1 - knee))
        code = 12.92 * y if y <= 0.0031308 else 1.055 * y ** (1 / 2.4) - 0.055
        if code <= GREY:
            code = GREY * (code / GREY) ** response.contrast
        else:
            code = 1 - (1 - GREY) * ((1 - code) / (1 - GREY)) ** response.contrast
        codes.append(255 * code)
    return codes


@pytest.mark.parametrize(
    "response", [Response(1.0, 1.0, 1.0), Response(1.4, 1.25, 1.2), Response(2.0, 0.8, 0.5)]
)
def test_images_equal_those_of_a_scalar_twin(response):
    light = np.random.default_rng(1).random((40, 30, 3)).astype(np.float32) ** 3 * 3
    expected = [[recorded(pixel, response) for pixel in row] for row in light.tolist()]
    # a code is rounded, and a step of the stored curve is 0.4 codes at black
    np.testing.assert_allclose(respond(light, response), expected, atol=0.5 + 0.4)


def test_the_curve_is_straight_up_to_its_knee_and_smooth_up_to_white():
    response = Response(clip=1.4, contrast=1.0, saturation=1.0)
    light = np.linspace(0, 1.4, 14001)
    encoded = response_curve(light, response)
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(linear[light <= 0.6], light[light <= 0.6], atol=1e-9)
    assert linear[-1] == pytest.approx(1)
    slope = np.diff(linear) / np.diff(light)
    assert np.abs(np.diff(slope)).max() < 1e-3
    assert slope[-1] == pytest.approx(0, abs=1e-3)


def test_contrast_keeps_black_white_and_middle_grey_and_is_the_slope_there():
    response = Response(clip=1.0, contrast=1.3, saturation=1.0)
    kept = response_curve(np.array([0.0, 0.18, 1.0]), response)
    np.testing.assert_allclose(kept, [0, GREY, 1], atol=1e-9)
    near = np.array([0.1799, 0.1801])
    plain = response_curve(near, Response(1.0, 1.0, 1.0))
    assert np.ptp(response_curve(near, response)) / np.ptp(plain) == pytest.approx(1.3, rel=1e-3)


def test_light_beyond_the_clip_is_white_which_the_neutral_curve_never_reaches():
    light = np.array([[[1.5, 2.0, 4.0], [1.3, 1.3, 1.3], [-1.0, 0.0, -0.1]]], np.float32)
    image = respond(light, Response(1.2, 1.1, 1.3))
    np.testing.assert_array_equal(image[0], [[255] * 3, [255] * 3, [0] * 3])
    assert tone_map_and_encode(light)[0, 1].max() < 250


def test_saturation_moves_colours_away_from_a_grey_that_stays():
    light = np.array([[[0.3, 0.2, 0.1], [0.2, 0.2, 0.2]]], np.float32)
    dull, plain, vivid = (
        respond(light, Response(1.2, 1.0, saturation)).astype(int) for saturation in (0.0, 1.0, 1.3)
    )
    assert np.ptp(dull[0, 0]) == 0
    assert np.ptp(vivid[0, 0]) > np.ptp(plain[0, 0]) + 10
    np.testing.assert_array_equal(vivid[0, 1], plain[0, 1])


def test_an_image_with_a_response_curve_has_the_labels_of_the_neutral_one(generators):
    values = {"sensor": {"response": {"probability": 1.0}}}
    plain, camera = (generators(Config.from_values(v), seed=3, size=SIZE) for v in ({}, values))
    drawn = [camera.scene(index).camera("B").sensor.response for index in range(20)]
    assert len(set(drawn)) == 20
    assert all(1.0 <= response.clip <= 1.5 for response in drawn)
    a, b = (generator.render(index=0, camera="B") for generator in (plain, camera))
    assert a.objects == b.objects
    np.testing.assert_array_equal(a.ids, b.ids)
    assert (a.image != b.image).mean() > 0.5


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"clip": [0.9, 1.2]}, "sensor.response.clip.*1 to 2"),
        ({"contrast": 0.5}, "sensor.response.contrast.*0.8 to 2"),
        ({"saturated": 1}, "sensor.response.saturated: unknown key"),
    ],
)
def test_bad_values_are_named(values, words):
    with pytest.raises(ConfigError, match=words):
        Config.from_values({"sensor": {"response": values}})
