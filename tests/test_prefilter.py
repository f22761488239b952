"""Prefiltered maps compared with direct sums and Monte Carlo samples."""

import cv2
import numpy as np
import pytest

from fastgen.light.environment import (
    ROUGHNESS_LEVELS,
    EnvironmentLight,
    irradiance_at,
    prefilter_environment,
)
from fastgen.light.octahedral import (
    levelled,
    octahedral_decode,
    octahedral_encode,
    sample_octahedral,
)
from fastgen.light.prefilter import shrink
from fastgen.light.reflectance import dfg_table, fresnel_climb, mean_specular_albedo
from fastgen.light.rgb9e5 import unpacked
from tests.sky_samples import even_directions, one_light, patchwork, texel_grid


@pytest.fixture(scope="module")
def patches() -> tuple[np.ndarray, EnvironmentLight]:
    radiance = patchwork(3)
    return radiance, prefilter_environment("patches", radiance)


def test_constant_environment_stays_constant_everywhere():
    light = prefilter_environment("even", np.full((128, 256, 3), 0.7, np.float32))
    for values in (light.specular, light.irradiance, unpacked(light.background), light.luminance):
        np.testing.assert_allclose(values, 0.7, rtol=2e-3)
    assert light.mean_luminance == pytest.approx(0.7, rel=1e-5)


def test_specular_levels_equal_monte_carlo_of_the_ggx_lobe(patches):
    radiance, light = patches
    height = radiance.shape[0]
    rng = np.random.default_rng(11)
    for normal in even_directions(6) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]:
        side = np.linalg.svd(normal[None])[2][1:]
        for level in (1, 2, 3, 5, 7):
            alpha = ROUGHNESS_LEVELS[level] ** 2
            u, turn = rng.random(100_000), 2 * np.pi * rng.random(100_000)
            tilt = np.arctan(alpha * np.sqrt(u / (1 - u)))  # inverse of the GGX distribution
            half = np.cos(tilt)[:, None] * normal + np.sin(tilt)[:, None] * (
                np.cos(turn)[:, None] * side[0] + np.sin(turn)[:, None] * side[1]
            )
            reflected = 2 * (half @ normal)[:, None] * half - normal
            cosine = np.maximum(reflected @ normal, 1e-6)
            # half vectors are sampled from D, so only the masking term of the integrand remains
            weight = (reflected @ normal > 0) / (1 + smith_lambda(cosine, alpha))
            row = np.arccos(np.clip(reflected[:, 2], -1, 1)) / np.pi * height
            column = (0.5 - np.arctan2(reflected[:, 1], reflected[:, 0]) / (2 * np.pi)) * 2 * height
            seen = radiance[np.minimum(row.astype(int), height - 1), column.astype(int) % 256]
            expected = (seen * weight[:, None]).sum(0) / weight.sum()
            found = sample_octahedral(light.specular[level], normal[None])[0]
            np.testing.assert_allclose(found, expected, rtol=0.03, atol=0.01)


def smith_lambda(cosine: np.ndarray, alpha: float) -> np.ndarray:
    """Lambda of Smith's masking term 1 / (1 + lambda) for GGX: Heitz 2014, eq. 72."""
    return (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2


def test_irradiance_equals_the_direct_cosine_sum(patches):
    radiance, light = patches
    direction, solid_angle = texel_grid(radiance.shape[0])
    normals = even_directions(40)
    cosine = np.maximum(np.einsum("hwc,kc->khw", direction, normals), 0)
    expected = np.einsum("khw,hw,hwc->kc", cosine, solid_angle, radiance) / np.pi
    np.testing.assert_allclose(irradiance_at(light, normals, 0.0), expected, rtol=0.01)


def test_a_light_appears_in_its_direction():
    toward = np.array([0.48, 0.6, 0.64])  # between +x and +y, above the horizon
    light = prefilter_environment("lamp", one_light(toward, 1000.0))
    size = light.background.shape[0]
    row, column = np.unravel_index(
        unpacked(light.background)[1:-1, 1:-1, 0].argmax(), (size - 2, size - 2)
    )
    # the levelled octahedral layout, written out for x > 0
    y, z = (np.array([column, row]) + 0.5) / (size - 2) * 2 - 1
    found = np.array([1 - abs(y) - abs(z), y, z])
    assert found @ toward / np.linalg.norm(found) > np.cos(np.deg2rad(3))
    (sun,) = light.lights
    assert np.dot(sun.direction, toward) > np.cos(np.deg2rad(1))


@pytest.mark.parametrize(
    ("toward", "tolerance"),
    # interpolation between the rows around a pole does not quite preserve area
    [((0, 0, 1), 0.12), ((0, 0, -1), 0.12), ((-1, 0, 0), 0.03), ((0.6, 0, 0.8), 0.03)],
)
def test_energy_of_a_single_texel_survives_every_map(toward, tolerance):
    radiance = one_light(np.array(toward, float), 200.0)
    expected = (radiance[..., 0] * texel_grid(128)[1]).sum() / (4 * np.pi)
    light = prefilter_environment("lamp", radiance)
    directions = even_directions(200_000)
    # a directional light of irradiance pi E has a mean radiance of pi E / (4 pi)
    aside = sum(sun.light[0] for sun in light.lights) / 4
    for layer, rest in (
        (unpacked(light.background), 0.0),
        *((layer, aside) for layer in light.specular),
    ):
        mean = sample_octahedral(layer, directions)[:, 0].mean() + rest
        assert mean == pytest.approx(expected, rel=tolerance)
    assert light.mean_luminance == pytest.approx(expected, rel=0.01)


def test_a_million_fold_sun_neither_speckles_nor_overflows():
    sky = np.full((128, 256, 3), 0.5, np.float32)
    toward = np.array([0.6, -0.48, 0.64])
    light = prefilter_environment("sun", sky + one_light(toward, 1e6))
    for values in (light.specular, light.irradiance, unpacked(light.background)):
        assert np.isfinite(values).all()
        assert values.min() >= 0.499
        assert values.max() <= 65504
    # every lobe falls off monotonically along any great circle away from the sun
    side = np.linalg.svd(toward[None])[2][1:]
    angle = np.deg2rad(np.arange(0, 120, 3.0))[:, None]
    for level in range(3, len(ROUGHNESS_LEVELS)):
        for turn in np.linspace(0, 2 * np.pi, 12, endpoint=False):
            across = np.cos(turn) * side[0] + np.sin(turn) * side[1]
            line = np.cos(angle) * toward + np.sin(angle) * across
            seen = sample_octahedral(light.specular[level], line)[:, 0]
            assert (seen[1:] <= seen[:-1] * 1.01).all()


def test_a_sun_beyond_the_range_of_half_floats_keeps_its_energy():
    radiance = one_light(np.array([0.0, 0.6, 0.8]), 1e6)
    expected = (radiance[..., 0] * texel_grid(128)[1]).sum() / (4 * np.pi)
    light = prefilter_environment("sun", radiance)
    (sun,) = light.lights
    seen = sample_octahedral(light.specular[4], even_directions(50_000))[:, 0]
    assert seen.mean() + sun.light[0] / 4 == pytest.approx(expected, rel=0.02)


def test_octahedral_mapping_is_its_own_inverse_and_follows_the_convention():
    directions = even_directions(5000)
    np.testing.assert_allclose(octahedral_decode(octahedral_encode(directions)), directions)
    uv = octahedral_encode([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, -1], [0.3, -0.2, -0.5]])
    folded = [0.5 + 0.5 * (1 - 0.2), 0.5 - 0.5 * (1 - 0.3)]
    np.testing.assert_allclose(uv, [[0.5, 0.5], [1, 0.5], [0.5, 1], [1, 1], folded])


def test_lookup_is_continuous_over_every_seam(patches):
    _, light = patches
    angle = np.linspace(0.01, np.pi / 2, 50)
    below = np.stack([np.cos(angle), np.zeros(50), -np.sin(angle)], axis=-1)
    for quarter in range(4):  # the map's edges are the axes' meridians below the horizon
        c, s = round(np.cos(quarter * np.pi / 2)), round(np.sin(quarter * np.pi / 2))
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        left, right = ((below + np.array([0, e, 0])) @ turn.T for e in (1e-7, -1e-7))
        for layer in (unpacked(light.background), light.irradiance, *light.specular):
            gap = np.abs(sample_octahedral(layer, left) - sample_octahedral(layer, right))
            assert gap.max() < 1e-3 * layer.max()


@pytest.mark.parametrize("shape", [(300, 600), (129, 256), (510, 1024)])
def test_shrinking_keeps_light_per_solid_angle(shape):
    radiance = np.random.default_rng(5).random((*shape, 3), dtype=np.float32)
    small = shrink(radiance, 128)
    assert small.shape == (64, 128, 3)

    def total(image: np.ndarray) -> np.ndarray:
        edges = np.cos(np.linspace(0, np.pi, image.shape[0] + 1))
        light: np.ndarray = (image.mean(1) * (edges[:-1] - edges[1:])[:, None]).sum(0) / 2
        return light

    np.testing.assert_allclose(total(small), total(radiance), rtol=1e-4)


def test_fine_checkerboard_does_not_alias_in_the_background():
    rows, columns = np.mgrid[0:512, 0:1024]
    board = np.repeat(((rows + columns) % 2).astype(np.float32)[..., None], 3, axis=2)
    light = prefilter_environment("board", board)
    blurred = cv2.blur(unpacked(light.background)[1:-1, 1:-1], (16, 16))
    assert np.abs(blurred - 0.5).max() < 0.06


def test_the_background_is_as_sharp_as_the_hdri():
    """Stripes one texel wide along the horizon keep their contrast."""
    stripes = np.zeros((256, 512, 3), np.float32)
    stripes[:, ::2] = 1.0
    background = unpacked(prefilter_environment("stripes", stripes).background)
    middle = 2 * np.pi * (np.arange(512) + 0.5) / 512
    along = np.stack([-np.cos(middle), np.sin(middle), np.full(512, 1e-3)], axis=1)
    seen = sample_octahedral(background, levelled(along))[:, 0]
    # a background as wide in texels as the HDRI would lose over half of the contrast
    assert seen[::2].mean() - seen[1::2].mean() > 0.6


def test_a_level_edge_stays_level_in_the_background():
    """A horizon between bright sky and dark land shows no detail finer than three degrees."""
    sky = np.full((256, 512, 3), 0.1, np.float32)
    sky[:128], sky[120:127] = 20.0, 5.0
    background = unpacked(prefilter_environment("level", sky).background)
    angle = np.linspace(0, 2 * np.pi, 20000, endpoint=False)
    for elevation in np.deg2rad(np.linspace(-3, 8, 221)):
        ring = np.stack([np.cos(angle), np.sin(angle), np.full(20000, np.tan(elevation))], axis=1)
        seen = sample_octahedral(background, levelled(ring))[:, 0]
        waves = np.fft.rfft(seen)
        teeth = np.fft.irfft(np.where(np.arange(len(waves)) < 120, 0, waves))
        assert teeth.std() < 0.05 * seen.mean()  # 0.33 if the horizon is a diagonal of the map


def unpolarized(cosine, index=1.5):
    """Fresnel reflectance of unpolarized light from air, by the cosine of its angle."""
    inside = np.sqrt(1 - (1 - cosine**2) / index**2)
    across = (cosine - index * inside) / (cosine + index * inside)
    along = (inside - index * cosine) / (inside + index * cosine)
    return (across**2 + along**2) / 2


def test_reflectance_follows_fresnels_equations():
    cosine = np.linspace(0, 1, 101)
    expected = (unpolarized(cosine) - 0.04) / 0.96
    np.testing.assert_allclose(fresnel_climb(cosine), expected, atol=1e-12)
    # Walsh 1926: reflectance under uniform light at an index of 1.5
    middles = (np.arange(10000) + 0.5) / 10000
    assert np.mean(2 * middles * unpolarized(middles)) == pytest.approx(0.0918, abs=1e-4)


@pytest.mark.parametrize(("row", "column"), [(12, 2), (12, 28), (20, 10), (31, 31), (25, 0)])
def test_dfg_equals_brute_force_over_light_directions(row, column):
    alpha, n_dot_v = ((row + 0.5) / 32) ** 2, (column + 0.5) / 32
    steps = 700
    theta = (np.arange(steps) + 0.5) / steps * np.pi / 2
    phi = (np.arange(steps) + 0.5) / steps * np.pi
    z, turn = np.cos(theta)[:, None], phi[None]
    light = np.stack(np.broadcast_arrays(np.sin(theta)[:, None] * np.cos(turn), z), axis=-1)
    view_x = np.sqrt(1 - n_dot_v**2)
    v_dot_l = view_x * light[..., 0] + n_dot_v * z
    length = np.sqrt(2 + 2 * v_dot_l)
    n_dot_h, v_dot_h = (n_dot_v + z) / length, (1 + v_dot_l) / length
    spread = alpha**2 / (np.pi * (n_dot_h**2 * (alpha**2 - 1) + 1) ** 2)
    # height-correlated visibility, G / (4 n.l n.v), in the form of Lagarde 2014
    visible = 0.5 / (
        z * np.sqrt(n_dot_v**2 * (1 - alpha**2) + alpha**2)
        + n_dot_v * np.sqrt(z**2 * (1 - alpha**2) + alpha**2)
    )
    cell = np.sin(theta)[:, None] * (np.pi / 2 / steps) * (2 * np.pi / steps)
    integrand = spread * visible * z * cell
    climb = (unpolarized(v_dot_h) - 0.04) / 0.96
    expected = ((1 - climb) * integrand).sum(), (climb * integrand).sum()
    np.testing.assert_allclose(dfg_table()[row, column], expected, atol=1e-3)


def test_smooth_surfaces_reflect_all_light_and_rough_ones_never_more():
    white = dfg_table().sum(axis=-1)
    assert white.max() <= 1.0001
    np.testing.assert_allclose(white[:3, 8:], 1.0, atol=0.01)


@pytest.mark.parametrize("f0", [0.0, 0.04, 0.5, 1.0])
def test_a_smooth_surface_reflects_the_mean_of_fresnels_equations(f0):
    """The mean is over the cosine-weighted hemisphere."""
    cosine = (np.arange(10000) + 0.5) / 10000
    climb = (unpolarized(cosine) - 0.04) / 0.96
    mean = np.mean(2 * cosine * (f0 + (1 - f0) * climb))
    assert mean_specular_albedo(f0, 0.05) == pytest.approx(mean, abs=0.003)
    assert mean_specular_albedo(f0, 0.9) < mean_specular_albedo(f0, 0.05)
