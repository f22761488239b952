"""Directional lights extracted from environments, compared with the lights put there."""

import numpy as np
import pytest

from fastgen.light.directional_lights import MAX_LIGHTS, MIN_SHARE, extract_lights
from fastgen.light.environment import irradiance_at, load_environment, prefilter_environment
from tests.sky_samples import even_directions, lamps_at_night, texel_grid
from tests.test_environment import write_exr

TOWARD = np.array([0.6, -0.64, 0.48])
RADIUS = np.deg2rad(0.9)
DISC = np.array([9000.0, 8000.0, 6000.0])


def sunny(height=512):
    """Return a sky that brightens toward a sun disc, its directions, solid angles and disc mask."""
    direction, solid_angle = texel_grid(height)
    sky = 1.0 + 0.5 * direction[..., 2:] + np.exp((direction @ TOWARD - 1)[..., None] / 0.01)
    sky = sky * np.array([0.5, 0.7, 1.0])
    disc = np.arccos(np.clip(direction @ TOWARD, -1, 1)) < RADIUS
    return (sky + disc[..., None] * DISC).astype(np.float32), direction, solid_angle, disc


def test_direction_light_and_radius_of_a_known_sun_are_found():
    radiance, _, solid_angle, disc = sunny()
    (sun,), rest = extract_lights(radiance)
    assert np.degrees(np.arccos(sun.direction @ TOWARD)) < 0.05
    np.testing.assert_allclose(sun.light, DISC * solid_angle[disc].sum() / np.pi, rtol=0.01)
    assert sun.radius == pytest.approx(RADIUS, rel=0.05)
    assert rest.max() < 5


def test_sun_and_remaining_sky_together_give_the_original_irradiance():
    radiance, direction, solid_angle, _ = sunny()
    light = prefilter_environment("sunny", radiance)
    assert len(light.lights) == 1
    normals = even_directions(40)
    cosine = np.maximum(direction.reshape(-1, 3) @ normals.T, 0) * solid_angle.reshape(-1, 1)
    expected = cosine.T @ radiance.reshape(-1, 3) / np.pi
    np.testing.assert_allclose(irradiance_at(light, normals), expected, rtol=0.02)


def test_an_even_sky_and_a_broad_lamp_have_no_sun():
    direction, _ = texel_grid(256)
    lamp = 50 * np.exp((direction @ TOWARD - 1)[..., None] / 0.02) * np.ones(3)
    for radiance in (np.ones_like(lamp), np.zeros_like(lamp), 0.1 + lamp):
        lights, rest = extract_lights(radiance.astype(np.float32))
        assert lights == ()
        np.testing.assert_array_equal(rest, radiance.astype(np.float32))


LAMPS = np.array([[0.9, 0.3, 0.3], [-0.5, 0.8, 0.2], [0.2, -0.9, 0.4]])
LAMPS /= np.linalg.norm(LAMPS, axis=1, keepdims=True)


def test_lamps_of_a_night_are_found_brightest_first():
    strength = np.array([[0.2, 0.15, 0.1], [0.5, 0.5, 0.5], [0.1, 0.12, 0.2]])
    lights, rest = extract_lights(lamps_at_night(LAMPS, strength))
    for sun, k in zip(lights, (1, 0, 2), strict=True):
        assert np.degrees(np.arccos(sun.direction @ LAMPS[k])) < 0.1
        np.testing.assert_allclose(sun.light, strength[k], rtol=0.02)
    np.testing.assert_allclose(rest, 0.02, rtol=1e-3)


def test_the_only_lamp_on_one_side_is_extracted_among_many():
    """Five strong lamps are side by side and a faint one is opposite; no light is lost."""
    turn = np.deg2rad([-40, -20, 0, 20, 40, 180])
    toward = np.stack([np.cos(turn), np.sin(turn), 0.2 + 0 * turn], axis=-1) / np.hypot(1, 0.2)
    strength = np.array([1.0, 1.1, 1.2, 1.3, 1.4, 0.2])[:, None] * np.ones(3)
    radiance = lamps_at_night(toward, strength)
    light = prefilter_environment("night", radiance)
    assert len(light.lights) == MAX_LIGHTS
    assert light.lights[-1].direction @ toward[-1] > 0.9999
    direction, solid_angle = texel_grid(512)
    normals = even_directions(40)
    cosine = np.maximum(direction.reshape(-1, 3) @ normals.T, 0) * solid_angle.reshape(-1, 1)
    expected = cosine.T @ radiance.reshape(-1, 3) / np.pi
    np.testing.assert_allclose(irradiance_at(light, normals), expected, rtol=0.02, atol=0.03)


@pytest.mark.parametrize("radiance", [sunny(128)[0], lamps_at_night(LAMPS, np.ones((3, 3)), 256)])
def test_suns_come_back_from_the_cache(tmp_path, radiance):
    file = write_exr(tmp_path / "sunny.exr", radiance)
    first = load_environment(file, tmp_path / "cache")
    assert first.lights
    assert load_environment(file, tmp_path / "cache").lights == first.lights


def test_lamps_side_by_side_are_one_sun_and_a_broad_lamp_is_not_split():
    side = np.cross(LAMPS[0], [0.0, 0.0, 1.0])
    two = LAMPS[0] + np.outer([-1, 1], np.tan(np.deg2rad(1.4)) * side / np.linalg.norm(side))
    two /= np.linalg.norm(two, axis=1, keepdims=True)
    (sun,), _ = extract_lights(lamps_at_night(two, np.ones((2, 3)), radius_deg=0.4))
    assert np.degrees(np.arccos(sun.direction @ LAMPS[0])) < 0.1
    np.testing.assert_allclose(sun.light, 2.0, rtol=0.02)
    for radius_deg in (2.8, 3.5, 4.5, 8.0):
        lights, _ = extract_lights(
            lamps_at_night(LAMPS[:1], np.ones((1, 3)), radius_deg=radius_deg)
        )
        assert len(lights) <= 1


@pytest.mark.parametrize("times", [0.7, 1.4])
def test_a_lamp_is_extracted_above_a_share_of_the_light_on_its_side(times):
    """The other light comes from many brighter windows that are too broad to be extracted."""
    turn = np.deg2rad(np.arange(0, 360, 18))
    windows = np.stack([np.cos(turn), np.sin(turn), 0.2 + 0 * turn], axis=-1) / np.hypot(1, 0.2)
    around = lamps_at_night(windows, np.ones((20, 3)), radius_deg=7.0)
    direction, solid_angle = texel_grid(512)
    aside = np.array([0.3, 0.1, -0.95]) / np.linalg.norm([0.3, 0.1, -0.95])
    cosine = np.maximum(direction @ aside, 0) * solid_angle
    irradiance = (around[..., 1] * cosine).sum() / np.pi
    lamp = times * MIN_SHARE / (1 - times * MIN_SHARE) * irradiance * np.ones((1, 3))
    radiance = around + lamps_at_night(aside[None], lamp, radius_deg=2.5) - np.float32(0.02)
    assert radiance[direction @ aside > np.cos(np.deg2rad(2))].max() < around.max()
    lights, _ = extract_lights(radiance)
    assert len(lights) == (times > 1)
    for sun in lights:
        assert sun.direction @ aside > np.cos(np.deg2rad(0.2))


@pytest.mark.parametrize("elevation_deg", [3.0, 60.0, 84.0, 88.0])
def test_a_sun_is_found_at_any_elevation(elevation_deg):
    """Texels of the map are crowded near the poles."""
    up = np.deg2rad(elevation_deg)
    toward = np.array([np.cos(up), 0.0, np.sin(up)])
    radiance = lamps_at_night(toward[None], np.ones((1, 3)))
    (sun,), rest = extract_lights(radiance)
    np.testing.assert_allclose(sun.light, 1.0, rtol=0.02)
    assert sun.direction @ toward > np.cos(np.deg2rad(0.1))
    np.testing.assert_allclose(rest, 0.02, rtol=1e-3)
