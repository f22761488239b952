"""Single GLSL functions compared with algebra and numpy."""

import numpy as np
import pytest

from fastgen.light.environment import IRRADIANCE_SIZE, ROUGHNESS_LEVELS, SPECULAR_SIZE
from fastgen.light.reflectance import dfg_table, fresnel_climb
from fastgen.render.gl import open_context
from fastgen.render.noise import noise_tiles
from fastgen.render.textures import noise_texture
from tests.glsl import blocks, run
from tests.sky_samples import quarter_sphere


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


def white_light(gl):
    """Return textures of a uniform environment of radiance 1 and the real split-sum table."""
    ctx = gl.ctx

    def ones(size, layers):
        return np.ones((layers, size, size, 4), np.float16).tobytes()

    layers = len(ROUGHNESS_LEVELS)
    table = dfg_table()
    made = {
        "specular_map": ctx.texture_array(
            (SPECULAR_SIZE, SPECULAR_SIZE, layers), 4, ones(SPECULAR_SIZE, layers), dtype="f2"
        ),
        "irradiance_map": ctx.texture(
            (IRRADIANCE_SIZE, IRRADIANCE_SIZE), 4, ones(IRRADIANCE_SIZE, 1), dtype="f2"
        ),
        "dfg_table": ctx.texture(table.shape[1::-1], 2, table.tobytes(), dtype="f4"),
    }
    made["dfg_table"].repeat_x = made["dfg_table"].repeat_y = False
    return made


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
def test_a_white_surface_in_a_white_furnace_vanishes(gl, metallic):
    """All light comes back at every roughness and angle: radiance 1 within 1 %."""
    kept = blocks(gl, yaw=(1, 0), background_size=16)
    roughness, cosine = np.meshgrid(np.linspace(0.05, 1, 20), np.linspace(0.05, 1, 20))
    rows = np.stack([roughness, cosine, np.full_like(cosine, metallic), cosine], -1).reshape(-1, 4)
    body = (
        '#include "environment_light.glsl"\n'
        "vec4 f(vec4 x) { vec3 view = vec3(sqrt(1.0 - x.y * x.y), 0.0, x.y);"
        " BrdfTerms r = brdf_terms(Material(vec3(1.0), x.x, x.z), vec3(0.0, 0.0, 1.0), view);"
        " return vec4(environment_reflection(r,"
        " SkyVisibility(vec3(0.0, 0.0, 1.0), 0.0, vec3(1.0), 1.0, 1.0, vec3(1.0),"
        " NO_TRACED_LIGHT)), 1.0); }"
    )
    out = run(gl, body, rows, white_light(gl))
    np.testing.assert_allclose(out[:, :3], 1.0, atol=0.01)
    del kept


def test_no_surface_returns_more_than_falls_on_it(gl):
    kept = blocks(gl, yaw=(1, 0), background_size=16)
    rng = np.random.default_rng(0)
    rows = np.c_[rng.uniform(0.05, 1, (500, 2)), rng.uniform(0, 1, (500, 2))]
    body = (
        '#include "environment_light.glsl"\n'
        "vec4 f(vec4 x) { vec3 view = vec3(sqrt(1.0 - x.y * x.y), 0.0, x.y);"
        " BrdfTerms r = brdf_terms(Material(vec3(x.w), x.x, x.z), vec3(0.0, 0.0, 1.0), view);"
        " return vec4(environment_reflection(r,"
        " SkyVisibility(vec3(0.0, 0.0, 1.0), 0.0, vec3(1.0), 1.0, 1.0, vec3(1.0),"
        " NO_TRACED_LIGHT)), 1.0); }"
    )
    out = run(gl, body, rows, white_light(gl))
    assert (out[:, 0] <= 1.01).all()
    assert (out[:, 0] >= 0).all()
    del kept


def test_ray_traced_light_replaces_the_hidden_sky(gl):
    """Surfaces as bright as the white sky change nothing, at every share of hidden sky.

    Black surfaces remove the light that they hide; the sky visibility cone has no effect.
    """
    kept = blocks(gl, yaw=(1, 0), background_size=16)
    rng = np.random.default_rng(5)
    rows = np.c_[rng.uniform(0.05, 1, 500), rng.uniform(0, 1, (500, 3))]  # rough, n.v, open, cone

    def lit(rays):
        body = (
            '#include "environment_light.glsl"\n'
            "vec4 f(vec4 x) { vec3 view = vec3(sqrt(1.0 - x.y * x.y), 0.0, x.y);"
            f" vec3 open = vec3(x.z); TracedLight rays = {rays};"
            " BrdfTerms r = brdf_terms(Material(vec3(0.5), x.x, 0.0), vec3(0.0, 0.0, 1.0), view);"
            " return vec4(environment_reflection(r,"
            " SkyVisibility(vec3(0.0, 0.0, 1.0), x.w, vec3(0.2), x.w, 1.0, vec3(0.3), rays)"
            "), 1.0); }"
        )
        return run(gl, body, rows, white_light(gl))[:, :3]

    all_open = lit("TracedLight(vec3(1.0), vec3(0.0), vec3(1.0), vec3(0.0), 1.0)")
    bright = lit("TracedLight(open, 1.0 - open, open, 1.0 - open, 1.0)")
    dark = lit("TracedLight(open, vec3(0.0), open, vec3(0.0), 1.0)")
    np.testing.assert_allclose(bright, all_open, rtol=1e-4)
    np.testing.assert_allclose(dark, rows[:, 2:3] * all_open, rtol=1e-3, atol=1e-4)
    del kept


def test_indirect_light_has_the_occluders_colour_and_never_exceeds_the_sky(gl):
    """Brighter occluders make a surface brighter, up to the light of the whole white sky."""
    kept = blocks(gl, yaw=(1, 0), background_size=16)
    rng = np.random.default_rng(3)
    rows = np.c_[rng.uniform(0.05, 1, 500), rng.uniform(0, 1, (500, 3))]  # rough, n.v, paint, rim
    body = (
        '#include "environment_light.glsl"\n'
        "vec4 f(vec4 x) { vec3 view = vec3(sqrt(1.0 - x.y * x.y), 0.0, x.y);"
        " float share = 1.0 - x.w * x.w;"
        " BrdfTerms r = brdf_terms(Material(vec3(x.z), x.x, 0.0), vec3(0.0, 0.0, 1.0), view);"
        " return vec4(environment_reflection(r,"
        " SkyVisibility(vec3(0.0, 0.0, 1.0), x.w, vec3(share), share, 1.0, vec3(0.0, 0.5, 1.0),"
        " NO_TRACED_LIGHT)), 1.0); }"
    )
    black, grey, white = run(gl, body, rows, white_light(gl))[:, :3].T
    assert (black <= grey + 1e-6).all()
    assert (grey <= white + 1e-6).all()
    assert (white <= 1.01).all()
    # deep in a recess no other light arrives, for any paint of the surface
    deep = np.c_[rows[:, :3], np.full(len(rows), 1.0)]
    assert run(gl, body, deep, white_light(gl))[:, 0].max() < 0.06
    bright, hidden = rows[:, 2] > 0.5, rows[:, 3] > 0.5
    assert (white - black)[bright & hidden].mean() > 0.1
    del kept


def test_fresnels_equations_equal_their_numpy_twin(gl):
    cosine = np.linspace(0, 1, 200)
    body = "vec4 f(vec4 x) { return vec4(fresnel_climb(x.x), 0, 0, 0); }"
    body = f'#include "reflectance.glsl"\n{body}'
    out = run(gl, body, np.repeat(cosine[:, None], 4, 1), white_light(gl))
    np.testing.assert_allclose(out[:, 0], fresnel_climb(cosine), atol=1e-5)


@pytest.mark.parametrize("slope_deg", [10, 50, 60])
def test_black_paint_reflects_a_sun_with_the_split_sum_albedo(gl, slope_deg):
    """By Helmholtz reciprocity the reflected energy is the split-sum table's value.

    Light from one direction, reflected into all views, equals light from all around, reflected
    into that direction.
    """
    slope, roughness, steps = np.deg2rad(slope_deg), 0.31, 120
    toward = np.tile([np.sin(slope), 0, np.cos(slope), 0], (4, 1))
    kept = blocks(gl, yaw=(1, 0), light_direction=toward, light_irradiance=np.ones((4, 4)))
    views, angles = quarter_sphere(steps)
    body = (
        '#include "directional_light.glsl"\n'
        f"vec4 f(vec4 x) {{ Material black = Material(vec3(0.0), {roughness}, 0.0);"
        " return vec4(light_reflection(brdf_terms(black, vec3(0.0, 0.0, 1.0), x.xyz), 0), 1.0); }"
    )
    radiance = run(gl, body, np.c_[views, np.zeros(len(views))], white_light(gl))[:, 0]
    found = (radiance * views[:, 2] * 2 * angles).sum() / (np.pi * np.cos(slope))
    column = np.cos(slope) * 32 - 0.5
    scale, bias = (
        np.interp(column, np.arange(32), dfg_table()[int(roughness * 32), :, k]) for k in (0, 1)
    )
    assert found == pytest.approx(0.04 * scale + bias, rel=0.03)
    del kept


def test_octahedral_mapping_equals_its_numpy_twin(gl):
    from fastgen.light.octahedral import octahedral_encode

    directions = np.random.default_rng(1).normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    body = (
        "vec4 f(vec4 x) { vec2 uv = octahedral(x.xyz);"
        " return vec4(uv, length(octahedral_direction(uv) - x.xyz), 0.0); }"
    )
    out = run(gl, body, np.c_[directions, np.zeros(400)])
    np.testing.assert_allclose(out[:, :2], octahedral_encode(directions), atol=1e-6)
    assert out[:, 2].max() < 1e-5


def test_packed_surface_ids_keep_zone_and_normal(gl):
    directions = np.random.default_rng(2).normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[:6] = np.r_[np.eye(3), -np.eye(3)]
    charts = np.arange(400) * 2
    body = (
        "vec4 f(vec4 x) { uint key = pack_surface_id(uint(x.w), x.xyz);"
        " return vec4(id_normal(key), float(id_zone(key))); }"
    )
    out = run(gl, body, np.c_[directions, charts])
    np.testing.assert_array_equal(out[:, 3], charts)
    assert np.abs(out[:, :3] - directions).max() < 2e-3
    np.testing.assert_allclose(out[:6, :3], directions[:6], atol=1e-7)


def test_srgb_coding_is_iec_61966(gl):
    values = np.linspace(0, 1, 300)
    encoded = np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)
    body = (
        '#include "tone_curve.glsl"\n'
        "vec4 f(vec4 x) { return vec4(srgb_encode(x.rrr).r, srgb_decode(x.ggg).r, 0, 0); }"
    )
    out = run(gl, body, np.stack([values, encoded, encoded, encoded], axis=1))
    np.testing.assert_allclose(out[:, 0], encoded, atol=0.05 / 255)
    np.testing.assert_allclose(out[:, 1], values, atol=1e-6)


def test_tone_curve_keeps_order_and_range(gl):
    greys = np.geomspace(1e-4, 1e5, 400)
    body = '#include "tone_curve.glsl"\nvec4 f(vec4 x) { return vec4(neutral_tone(x.rgb), 0); }'
    out = run(gl, body, np.repeat(greys[:, None], 4, 1))[:, 0]
    assert (np.diff(out) >= -1e-6).all()
    assert out.min() >= 0
    assert out.max() <= 1


@pytest.mark.parametrize("coverage", [0.05, 0.2, 0.5])
def test_a_noise_threshold_covers_the_same_share_at_every_distance(gl, coverage):
    """A surface is equally rusty from nearby and from afar."""
    steps = 1000 * (np.arange(128) + 0.37) / 128
    points = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    shares = [
        rusty_share(gl, points, footprint, coverage).mean()
        for footprint in (0.5, 2.0, 8.0, 11.0, 23.0, 32.0, 128.0)
    ]
    np.testing.assert_allclose(shares, coverage, atol=0.012)


@pytest.mark.parametrize("coverage", [0.05, 0.2, 0.5])
def test_a_wide_lookup_is_close_to_the_mean_of_lookups_within_it(gl, coverage):
    """A spot of rust keeps its darkness from afar, neither washed out nor hardened."""
    side = 16.0
    points, within = points_and_steps(side)
    near = rusty_share(gl, (points[:, None] + within).reshape(-1, 2), 1.0, coverage)
    truth = near.reshape(len(points), -1).mean(axis=1)
    wide = rusty_share(gl, points, side, coverage)
    assert abs((wide - truth).mean()) < 0.01
    assert np.sqrt(((wide - truth) ** 2).mean()) < 0.55 * truth.std()


@pytest.mark.parametrize(
    ("layer", "channel", "softness", "threshold"),
    [(1, "z", 0.35, 0.1), (1, "z", 0.35, 0.3), (1, "z", 0.35, 0.9), (0, "w", 0.15, 0.6)],
)
def test_a_soft_threshold_keeps_its_share_from_afar(gl, layer, channel, softness, threshold):
    """Dirt is as thick, and decals are as worn, from afar as from nearby."""
    side = 16.0
    points, within = points_and_steps(side)
    ramp = f"covered(n.value.{channel}, x.w, n.lost.{channel}, {softness})"
    near = noise_share(gl, layer, ramp, (points[:, None] + within).reshape(-1, 2), 1.0, threshold)
    truth = near.reshape(len(points), -1).mean(axis=1)
    wide = noise_share(gl, layer, ramp, points, side, threshold)
    assert abs((wide - truth).mean()) < 0.015
    assert np.sqrt(((wide - truth) ** 2).mean()) < 0.4 * truth.std() + 0.03


@pytest.mark.parametrize("coverage", [0.003, 0.01, 0.04])
def test_scratches_cover_the_configured_share(gl, coverage):
    """The share holds from nearby and from afar, where a pixel covers many scratches."""
    steps = 1000 * (np.arange(256) + 0.37) / 256
    points = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    for footprint in (0.5, 2.0, 8.0, 32.0):
        share = noise_share(gl, 1, "scratches(n)", points, footprint, scratch_coverage=coverage)
        assert share.mean() == pytest.approx(coverage, rel=0.25)


def points_and_steps(side):
    """Return sheet points [300, 2] and offsets [256, 2] over a square of width `side`, in mm."""
    steps = (np.arange(16) + 0.5) / 16 - 0.5
    points = np.random.default_rng(5).uniform(0, 1000, (300, 2))
    return points, np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * side


def rusty_share(gl, points, footprint, coverage):
    """Return the rusty share [N] of pixels `footprint` mm wide at sheet points [N, 2] in mm."""
    rust = "normal_covered(n.value.y, normal_threshold(x.w), n.lost.y, 0.03)"
    return noise_share(gl, 0, rust, points, footprint, coverage)


def noise_share(gl, layer, share, points, footprint, w=0.0, **scene):
    """Evaluate the GLSL expression `share` for pixels `footprint` mm wide at points [N, 2].

    The expression may use the noise sample `n` and the value `w` as `x.w`. scene: values of the
    uniform blocks. Returns float32 [N].
    """
    texture = noise_texture(gl)
    read = "read_without_period" if layer == 0 else "read_noise"
    kept = blocks(gl, noise_lost=noise_tiles().lost_deviation.reshape(-1, 4), **scene)
    body = (
        '#include "noise.glsl"\n#include "scratches.glsl"\n'
        f"vec4 f(vec4 x) {{ NoiseSample n = {read}({layer}, x.xy, 1000.0, x.z);"
        f" return vec4({share}, 0.0, 0.0, 0.0); }}"
    )
    count = len(points)
    rows = np.c_[points, np.full(count, footprint), np.full(count, w)]
    found = [run(gl, body, part, {"noise_tiles": texture}) for part in np.array_split(rows, 8)]
    del kept
    texture.release()
    return np.concatenate(found)[:, 0]
