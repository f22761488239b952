"""The sky behind the container, compared with rays into the environment map."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen import Generator
from fastgen.camera.projection import view_of
from fastgen.light.environment import load_environment
from fastgen.light.hdri import bundled_hdris
from fastgen.light.octahedral import levelled, sample_octahedral
from fastgen.light.rgb9e5 import unpacked


@pytest.fixture(scope="module")
def generator():
    with Generator(seed=5, size=(160, 96)) as made:
        yield made


def displayed(radiance):
    """Tone-map and encode exposed radiance [..., 3] to sRGB 0..255.

    Khronos PBR Neutral, section 2; IEC 61966-2-1.
    """
    low = radiance.min(axis=-1, keepdims=True)
    color = radiance - np.where(low < 0.08, low - 6.25 * low**2, 0.04)
    peak = color.max(axis=-1, keepdims=True)
    start, d = 0.76, 0.24
    new_peak = 1 - d * d / np.maximum(peak + d - start, d)
    shrunk = color * new_peak / np.maximum(peak, start)
    white = 1 - 1 / (0.15 * (peak - new_peak) + 1)
    color = np.where(peak < start, color, shrunk * (1 - white) + new_peak * white)
    curve = 1.055 * np.maximum(color, 1e-9) ** (1 / 2.4) - 0.055
    return 255 * np.where(color <= 0.0031308, 12.92 * color, curve)


# ahead, almost straight up and down, and across the map's seams; little container in view
@pytest.mark.parametrize("toward", [(1, 0.2, 0.1), (0, 0.01, 1), (-1, -1, -0.3), (0.02, 1, -3)])
@pytest.mark.parametrize("roll_deg", [0.0, 37.0])
def test_the_sky_is_the_mean_of_the_environment_along_four_rays_of_each_pixel(
    generator, toward, roll_deg
):
    scene = generator.scene(2)
    eye = np.array([9000.0, 7000.0, 1500.0])
    camera = replace(
        scene.cameras[0],
        position_mm=tuple(eye),
        target_mm=tuple(eye + 1000 * np.array(toward)),
        focal_mm=18.0,
        roll_deg=roll_deg,
    )
    sample = generator.render(scene=scene, camera=camera)
    width, height = generator.size
    _, rays = view_of(camera, (2 * width, 2 * height)).rays()
    yaw = np.deg2rad(scene.environment.yaw_deg)
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    light = load_environment(bundled_hdris()[scene.environment.name])
    directions = (rays @ turn.T).reshape(-1, 3)
    radiance = sample_octahedral(unpacked(light.background), levelled(directions))
    radiance = radiance.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    expected = displayed(generator.exposure(scene, camera) * radiance)
    # pixels next to the container are mixed
    sky = cv2.erode((sample.ids == 0).astype(np.uint8), np.ones((5, 5))) > 0
    assert sky.mean() > 0.3
    # the map on the GPU has nine bits per channel
    apart = np.abs(sample.image[sky] - expected[sky]).max(axis=-1)
    # pixels on an edge of the octahedron extrapolate the map coordinates beyond it
    assert (apart > 2.5).mean() < 0.01
    assert np.median(apart) < 0.6
