"""Ray-traced light at points, compared with form factors, algebra and sums over the sky."""

import numpy as np
import pytest

import fastgen.light.traced_light
from fastgen.light.environment import load_environment, to_map_frame
from fastgen.light.hdri import bundled_hdris
from fastgen.light.octahedral import octahedral_decode
from fastgen.light.ray_bodies import DistantLight, LitBody, RayBodies
from fastgen.light.reflectance import DIELECTRIC_F0, dfg_table
from fastgen.light.sky_rays import SkyRays, spread_points
from fastgen.light.traced_light import DIRECTIONS, RAYS, Points, lobe, traced_light

SIDE = 126
EVEN = SkyRays(np.ones((SIDE, SIDE, 3), np.float32), DIRECTIONS)
PAINT = np.array([0.6, 0.3, 0.1], np.float32)
LIGHT = np.array([0.5, 0.7, 0.9], np.float32)


def plate(center, along, across, facing=1):
    """Return a rectangle with reflectance PAINT under LIGHT.

    along, across: vectors from the center to the middles of two edges. The front faces
    along x across for facing 1, and the opposite way for -1.
    """
    center, along, across = (np.array(v, np.float64) for v in (center, along, across))
    corners = [center + a * along + b * across for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)[:, ::facing]
    ones = np.ones((4, 1), np.float32)
    return LitBody(np.array(corners, np.float32), triangles, PAINT * ones, LIGHT * ones)


def points(normal, toward_eye=None, roughness=0.4, place=(0, 0, 0)):
    """Return the points of one full tile, all at the same place."""
    row, column = np.divmod(np.arange(4), 2)
    normal = np.array(normal, float) / np.linalg.norm(normal)
    eye = normal if toward_eye is None else np.array(toward_eye) / np.linalg.norm(toward_eye)
    rows = [np.tile(v, (4, 1)).astype(np.float32) for v in (place, normal, eye)]
    return Points(column, row, *rows, np.full(4, roughness, np.float32))


def found(at, bodies, sky=EVEN, yaw_deg=0.0, lights=()):
    """Return the traced light averaged over a tile, [4, 3]."""
    return traced_light(at, RayBodies(bodies, lights), sky, yaw_deg).mean(axis=0)


def square_factor(half_side, height):
    """Form factor of a square to a parallel element below its middle.

    Siegel and Howell, Thermal Radiation Heat Transfer, configuration B-3, times four.
    """
    x = half_side / height
    root = np.sqrt(1 + x * x)
    return 4 / (2 * np.pi) * 2 * x / root * np.arctan(x / root)


FAR = plate((0, 0, -1e7), (1, 0, 0), (0, 1, 0))


def test_an_open_place_sees_the_whole_sky():
    for normal in ((0, 0, 1), (1, 0, 0), (0.3, -0.8, 0.1)):
        open_, indirect, mirrored, shown = found(points(normal), [FAR])
        assert (open_ == 1).all()
        assert (mirrored == 1).all()
        assert (indirect == 0).all()
        assert (shown == 0).all()


@pytest.mark.parametrize("half_side", [300, 1000, 4000])
def test_a_square_above_occludes_and_reflects_by_its_form_factor(half_side):
    above = plate((0, 0, 1000), (half_side, 0, 0), (0, half_side, 0), facing=-1)
    open_, indirect, *_ = found(points((0, 0, 1)), [above])
    factor = square_factor(half_side, 999)
    np.testing.assert_allclose(open_, 1 - factor, atol=0.04)
    np.testing.assert_allclose(indirect, factor * PAINT * LIGHT, atol=0.04 * PAINT.max())


def test_the_back_of_a_surface_occludes_but_reflects_nothing():
    above = plate((0, 0, 1000), (1000, 0, 0), (0, 1000, 0))
    open_, indirect, *_ = found(points((0, 0, 1)), [above])
    np.testing.assert_allclose(open_, 1 - square_factor(1000, 999), atol=0.04)
    assert (indirect == 0).all()


def test_a_sunlit_wall_reflects_the_sun_and_a_shaded_one_does_not():
    wall = plate((-1000, 0, 0), (0, 1e5, 0), (0, 0, 1e5))
    toward = np.array([0.6, 0.0, 0.8])
    sun = DistantLight(toward.astype(np.float32), np.full(3, 5, np.float32))
    dark = found(points((0, 0, 1)), [wall])[1]
    lit = found(points((0, 0, 1)), [wall], lights=[sun])[1]
    np.testing.assert_allclose(dark, 0.5 * PAINT * LIGHT, atol=0.01)  # half the hemisphere
    np.testing.assert_allclose(lit - dark, 0.5 * PAINT * 5 * 0.6, rtol=0.03)
    # far away, with its unlit back toward the wall
    roof = plate(toward * 3e5, np.cross(toward, (0, 1, 0)) * 1e6, (0, 1e6, 0), facing=-1)
    shaded = found(points((0, 0, 1)), [wall, roof], lights=[sun])[1]
    np.testing.assert_allclose(shaded, dark, atol=0.01)


def test_a_sun_behind_a_wall_does_not_light_it():
    wall = plate((-1000, 0, 0), (0, 1e7, 0), (0, 0, 1e7))
    sun = DistantLight(np.array([-0.6, 0.0, 0.8], np.float32), np.full(3, 5, np.float32))
    without, behind = (found(points((0, 0, 1)), [wall], lights=s)[1] for s in ((), [sun]))
    np.testing.assert_array_equal(behind, without)


def test_a_mirror_shows_the_surface_in_its_direction():
    eye = (-1, 0, 1)
    there = plate((1000, 0, 1000), (300, 0, -300), (0, 400, 0), facing=-1)
    aside = plate((0, 1000, 1000), (400, 0, 0), (0, 300, -300), facing=1)
    *_, mirrored, shown = found(points((0, 0, 1), eye, 0.15), [there])
    assert (mirrored < 0.05).all()
    np.testing.assert_allclose(shown, PAINT * LIGHT, rtol=0.05)
    *_, mirrored, shown = found(points((0, 0, 1), eye, 0.15), [aside])
    assert (mirrored > 0.99).all()
    assert (shown < 0.01).all()


def test_rough_mirrors_show_a_wall_in_part():
    """At the foot of a wall, the wall cuts the lobe of a view from above in half."""
    wall = plate((-2, 0, 0), (0, 1e6, 0), (0, 0, 1e6))
    *_, mirrored, shown = found(points((0, 0, 1), roughness=0.6), [wall])
    np.testing.assert_allclose(mirrored, 0.5, atol=0.04)
    np.testing.assert_allclose(shown, 0.5 * PAINT * LIGHT, rtol=0.08)


def spherical_share(sky, yaw_deg, normal, hidden):
    """Return the share of a map's irradiance that comes from directions that are not hidden."""
    step = (np.arange(SIDE) + 0.5) / SIDE
    toward = octahedral_decode(np.stack(np.meshgrid(step, step), axis=-1)).reshape(-1, 3)
    solid_angle = np.abs(toward).sum(axis=1) ** 3
    world = to_map_frame(toward, -yaw_deg)
    cosine = np.maximum(world @ normal, 0)
    light = sky.reshape(-1, 3) * (cosine * solid_angle)[:, None]
    return 1 - light[hidden(world)].sum(axis=0) / light.sum(axis=0)


@pytest.mark.parametrize("name", ["venice", "sunset", "night", "port_noon"])
@pytest.mark.parametrize("yaw_deg", [0.0, 130.0])
def test_occlusion_of_real_skies_equals_a_sum_over_the_sky(name, yaw_deg):
    radiance = load_environment(bundled_hdris()[name]).specular[0, 1:-1, 1:-1]
    sky = SkyRays(np.ascontiguousarray(radiance), DIRECTIONS)
    normal = np.array([0.0, -1.0, 0.0])
    # a screen to the right of the middle, from 45 degrees above the horizon upward
    screen = plate((2e6, -1000, 2e6 + 1000), (2e6, 0, 0), (0, 0, 2e6), facing=1)

    def hidden(toward):
        return (toward[:, 1] < 0) & (toward[:, 2] > -toward[:, 1]) & (toward[:, 0] > 0)

    open_ = found(points(normal), [screen], sky, yaw_deg)[0]
    np.testing.assert_allclose(open_, spherical_share(radiance, yaw_deg, normal, hidden), atol=0.04)


def test_runs_of_spread_points_form_nets():
    """Each run of 2^k points has one point in every elementary interval of area 2^-k."""
    u, v = spread_points(256)
    for start, count in ((0, 256), (64, 64), (128, 64), (208, 16)):
        part = slice(start, start + count)
        for wide in range(count.bit_length()):
            tall = count.bit_length() - 1 - wide
            cells = set(zip(np.floor(u[part] * 2**wide), np.floor(v[part] * 2**tall), strict=True))
            assert len(cells) == count


@pytest.fixture
def many_rays(monkeypatch):
    """Trace enough rays to distinguish a wrong formula from noise."""
    monkeypatch.setattr(fastgen.light.traced_light, "MIRRORED_RAYS", 4096)


def ggx_share(sky, yaw_deg, normal, eye, roughness, hidden):
    """Return the share of a mirrored map [N, N, 3] that is not hidden.

    Sums F D G1 G1 / n.v over all texels.
    """
    step = (np.arange(SIDE) + 0.5) / SIDE
    toward = octahedral_decode(np.stack(np.meshgrid(step, step), axis=-1)).reshape(-1, 3)
    solid_angle = np.abs(toward).sum(axis=1) ** 3
    world = to_map_frame(toward, -yaw_deg)
    up = world @ normal
    half = (world + eye) / np.linalg.norm(world + eye, axis=1, keepdims=True)
    squared = roughness**4
    spread = 1 / ((half @ normal) ** 2 * (squared - 1) + 1) ** 2
    shadowed = 1 / (up + np.sqrt(squared + (1 - squared) * up**2))  # G1 / (2 n.l)
    c = half @ eye
    g = np.sqrt(c**2 + 1.25)
    fresnel = 0.5 * ((g - c) / (g + c)) ** 2
    fresnel *= 1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2
    weight = np.where(up > 0, up * shadowed * spread * fresnel * solid_angle, 0)
    light = sky.reshape(-1, 3) * weight[:, None]
    return 1 - light[hidden(world)].sum(axis=0) / light.sum(axis=0)


@pytest.mark.parametrize("name", ["sunset", "port_noon"])
@pytest.mark.parametrize("yaw_deg", [0.0, 130.0])
@pytest.mark.parametrize("roughness", [0.5, 0.8])
def test_occlusion_of_mirrored_skies_equals_a_sum_over_the_lobe(
    many_rays, name, yaw_deg, roughness
):
    radiance = np.ascontiguousarray(load_environment(bundled_hdris()[name]).specular[0, 1:-1, 1:-1])
    normal, eye = np.array([0.0, -1.0, 0.0]), np.array([0.0, -0.3, -(0.91**0.5)])
    screen = plate((2e6, -1000, 2e6 + 1000), (2e6, 0, 0), (0, 0, 2e6), facing=-1)

    def hidden(toward):
        return (toward[:, 1] < 0) & (toward[:, 2] > -toward[:, 1]) & (toward[:, 0] > 0)

    sky = SkyRays(radiance, DIRECTIONS)
    traced = traced_light(points(normal, eye, roughness), RayBodies([screen], ()), sky, yaw_deg)
    expected = ggx_share(radiance, yaw_deg, normal, eye, roughness, hidden)
    assert np.abs(expected - 0.5).max() < 0.47  # the screen hides a part
    np.testing.assert_allclose(traced[:, 2].mean(axis=0), expected, atol=0.03)
    even = ggx_share(np.ones_like(radiance), 0, normal, eye, roughness, hidden)
    indirect = traced[:, 3].mean(axis=0)
    np.testing.assert_allclose(indirect, (1 - even) * PAINT * LIGHT, rtol=0.05)


@pytest.mark.parametrize("cosine", [0.3, 0.9])
@pytest.mark.parametrize("roughness", [0.4, 0.9])
def test_rays_of_a_lobe_integrate_over_the_hemisphere(many_rays, cosine, roughness):
    eye = (0, (1 - cosine**2) ** 0.5, cosine)
    toward, weight, density = lobe(points((0, 0, 1), eye, roughness), 0)
    np.testing.assert_allclose(np.linalg.norm(toward, axis=-1), 1, atol=1e-3)
    np.testing.assert_array_equal(weight[0] > 0, toward[0, :, 2] > 0)
    if roughness > 0.5:  # narrower lobes sample the rest too rarely
        upward = np.where(toward[..., 2] > 0, 1 / density, 0).mean()
        assert upward == pytest.approx(2 * np.pi, rel=0.05)
    table = dfg_table()
    scale, bias = table[int(roughness * len(table)), int(cosine * len(table))]
    albedo = scale * DIELECTRIC_F0 + bias  # the table has correlated masking (G2)
    assert weight.mean() == pytest.approx(albedo, rel=0.2)


def test_sky_directions_integrate_over_the_whole_sky():
    rng = np.random.default_rng(3)
    radiance = rng.random((SIDE, SIDE, 3)).astype(np.float32) ** 8
    sky = SkyRays(radiance, DIRECTIONS)
    np.testing.assert_allclose(np.linalg.norm(sky.directions, axis=1), 1, atol=1e-5)
    for part in (slice(None), slice(0, RAYS), slice(3 * RAYS, 4 * RAYS)):
        weight = 1 / sky.density[part]
        assert weight.mean() == pytest.approx(4 * np.pi, rel=0.08)
    total = (sky.radiance / sky.density[:, None]).mean(axis=0) / (4 * np.pi)
    np.testing.assert_allclose(total, radiance.mean(axis=(0, 1)), rtol=0.15)
    axes = (sky.directions / sky.density[:, None]).mean(axis=0)
    assert np.abs(axes).max() < 0.05 * 4 * np.pi


def test_means_over_solid_angles_equal_those_of_the_map():
    step = (np.arange(SIDE) + 0.5) / SIDE
    toward = octahedral_decode(np.stack(np.meshgrid(step, step), axis=-1))
    radiance = np.stack([1 + toward[..., 0], 2 - toward[..., 1], 1.5 + 0 * toward[..., 2]], axis=-1)
    sky = SkyRays(radiance.astype(np.float32), DIRECTIONS)
    rng = np.random.default_rng(1)
    asked = rng.normal(size=(500, 3)).astype(np.float32)
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    expected = np.stack([1 + asked[:, 0], 2 - asked[:, 1], np.full(500, 1.5)], axis=1)
    for solid_angle, apart in ((1e-3, 0.03), (0.02, 0.12), (0.3, 0.4)):
        means = sky.mean(asked, np.full(500, solid_angle, np.float32))
        np.testing.assert_allclose(means, expected, atol=apart)
    everywhere = sky.mean(asked, np.full(500, 100, np.float32))  # limited to the coarsest level
    np.testing.assert_allclose(everywhere, expected, atol=0.5)


def test_means_between_levels_cover_the_requested_solid_angle():
    radiance = np.zeros((SIDE, SIDE, 3), np.float32)
    radiance[63, 63] = 1  # straight up; the texel covers about 4 pi / SIDE^2
    sky = SkyRays(radiance, DIRECTIONS)
    up = np.array([[0.01, 0.01, 1]], np.float32)
    texel = 4 * np.pi / SIDE**2
    for times in (1, 9, 100):
        seen = sky.mean(up, np.array([times * texel], np.float32))[0, 0]
        assert 0.4 / times < seen < 2.5 / times
