"""Glare of the sun and lamps on wet ground, against Monte Carlo integrals and algebra."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.gl import open_context
from fastgen.scene import Camera, EnvironmentView, Ground, Pose, Prop
from fastgen.scene.optics import Weather
from tests.glsl import blocks, run
from tests.plain import bare
from tests.sky_samples import quarter_sphere

SIZE = (200, 150)
WATER = 1.33
STEPS = 120  # all views fit into one row of a texture


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


def fresnel(cosine, index=WATER):
    """Return the unpolarized Fresnel reflectance of a dielectric."""
    inside = np.sqrt(1 - (1 - cosine**2) / index**2)
    s = (cosine - index * inside) / (cosine + index * inside)
    p = (inside - index * cosine) / (inside + index * cosine)
    return (s**2 + p**2) / 2


def reflected_share(roughness, slope, rays=400_000):
    """Return the share of light from a direction that a GGX surface of water reflects.

    Facets are drawn from the distribution of Walter et al. 2007, eq. 35.
    """
    rng = np.random.default_rng(5)
    u, v = rng.random((2, rays))
    alpha = roughness**2
    tilt, turn = np.arctan(alpha * np.sqrt(u / (1 - u))), 2 * np.pi * v
    facet = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], 1)
    light = np.array([np.sin(slope), 0, np.cos(slope)])
    met = facet @ light
    out = 2 * met[:, None] * facet - light
    kept = (met > 0) & (out[:, 2] > 0)

    def hidden(cosine):
        """Return Smith's Lambda."""
        return (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2

    seen = 1 / (1 + hidden(light[2]) + hidden(out[kept, 2]))
    weight = fresnel(met[kept]) * seen * met[kept] / (light[2] * facet[kept, 2])
    return weight.sum() / rays


@pytest.mark.parametrize("slope_deg", [15, 50, 70])
@pytest.mark.parametrize("roughness", [0.35, 0.6])
def test_wet_ground_reflects_the_share_of_a_light_that_water_does(gl, slope_deg, roughness):
    slope = np.deg2rad(slope_deg)
    toward = np.tile([np.sin(slope), 0, np.cos(slope), 0], (4, 1))
    kept = blocks(gl, light_direction=toward, light_irradiance=np.ones((4, 4)), light_count=1)
    views, angles = quarter_sphere(STEPS)
    body = (
        '#include "ground_mirror.glsl"\n'
        f"vec4 f(vec4 x) {{ GroundMaterial wet = GroundMaterial(vec3(0.0), {roughness});"
        " return vec4(ground_glare(vec3(0.0), -x.xyz, wet, 0.25, 0.01), 1.0); }"
    )
    radiance = run(gl, body, np.c_[views, np.zeros(len(views))], lights=1)[:, 0]
    found = (radiance * views[:, 2] * 2 * angles).sum() / (np.pi * np.cos(slope))
    # a quarter of the light is hidden
    assert found == pytest.approx(0.75 * reflected_share(roughness, slope), rel=0.06)
    del kept


def test_glare_lies_where_the_sun_is_mirrored_and_ends_in_shadows():
    with Generator(Config.preset("gate"), seed=3, size=SIZE, quality="draft") as made:
        first = made.scene(0)
        scene = replace(
            bare(first),
            damages=(),
            weather=Weather(),
            container=replace(first.container, present=False),
            environment=EnvironmentView("port_afternoon", 0.0),
            ground=Ground("concrete", 0.0, wear=0.0, lines=0.0, reach_mm=30000.0, wetness=0.6),
        )
        toward = np.array(made.gpu.renderer().ambient(scene).lights[0].direction)
        eye = 6000 * np.array([-toward[0], -toward[1], toward[2]]) / np.linalg.norm(toward)
        camera = Camera("glare", tuple(map(float, eye)), (0.0, 0.0, 0.0), 24.0)
        shade = Prop(
            "box",
            Pose(tuple(map(float, 9000 * toward / np.linalg.norm(toward)))),
            (3000.0, 3000.0, 3000.0),
            (0.1, 0.1, 0.1),
        )
        images = {}
        for name, wetness, props in (
            ("dry", 0.0, ()),
            ("wet", 0.6, ()),
            ("shaded", 0.6, (shade,)),
        ):
            drawn = replace(scene, props=props, ground=replace(scene.ground, wetness=wetness))
            frame = made.gpu.renderer().render(PreparedScene(drawn), camera, SIZE, radiance=True)
            images[name] = np.where(np.isfinite(frame.depth), frame.radiance.mean(axis=2), np.nan)
    _, rays = view_of(camera, SIZE).rays()
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    mirrored = rays * (1, 1, -1)
    apart_deg = np.rad2deg(np.arccos(np.clip(mirrored @ toward, -1, 1)))
    near, far = apart_deg < 5, (apart_deg > 25) & (apart_deg < 35)
    gains = [
        np.nanmean(images["wet"][part]) / np.nanmean(images["dry"][part]) for part in (near, far)
    ]
    assert gains[0] > 2 * gains[1]
    assert np.nanmean(images["shaded"][near]) < 0.2 * np.nanmean(images["wet"][near])
