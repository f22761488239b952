"""Light changes gradually with the environment's yaw and with roughness, without jumps."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from fastgen import Config
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene.limits import MIN_ROUGHNESS
from tests.plain import EVEN_PAINT

CONFIG = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
SIZE = (64, 64)
ENVIRONMENTS = ("port_noon", "port_night", "sky")
JUMP = 0.045
"""Largest change between two images relative to the mean. Where the sun grazes a wall, shadows of
the corrugation change a third of the light in three degrees; a lost sun changes it at once."""


@pytest.fixture(scope="module")
def generator(generators):
    return generators(CONFIG, seed=4, size=SIZE, quality="draft")


def luminance(generator, scene, camera):
    """Return the luminance of the container's pixels, float64 [N]."""
    with generator.gpu.drawing() as renderer:
        frame = renderer.render(PreparedScene(scene), camera, SIZE, radiance=True)
    # pixels on an edge show the sun, too, if it is behind the container
    inside = binary_erosion(frame.ids > 0, np.ones((3, 3)), iterations=2)
    return frame.radiance[inside] @ np.array([0.2126, 0.7152, 0.0722])


def lit(scene, name, yaw_deg):
    return replace(scene, environment=replace(scene.environment, name=name, yaw_deg=yaw_deg))


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_light_has_no_jumps_in_yaw(name, generator):
    """Search the largest changes of a whole turn for a jump."""
    scene = generator.scene(0)
    camera = scene.cameras[0]

    def mean(yaw_deg):
        return luminance(generator, lit(scene, name, float(yaw_deg)), camera).mean()

    yaws = np.arange(0, 361, 6)
    turn = np.array([mean(yaw) for yaw in yaws])
    assert turn[0] == pytest.approx(turn[-1], rel=1e-4)
    assert np.ptp(turn) > 0.1 * turn.mean()
    for worst in np.argsort(np.abs(np.diff(turn)))[-2:]:
        between = [mean(yaw) for yaw in np.linspace(yaws[worst], yaws[worst + 1], 25)]
        assert np.abs(np.diff(between)).max() < JUMP * turn.mean()


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_light_has_no_jumps_in_roughness(name, generator):
    scene = replace(lit(generator.scene(0), name, 40.0), decals=())
    for camera in scene.cameras[:2]:
        means = []
        for roughness in np.linspace(0, 1, 41):
            paint = replace(scene.surface.paint, roughness=float(roughness))
            painted = replace(scene, surface=replace(scene.surface, paint=paint))
            values = luminance(generator, painted, camera)
            assert np.isfinite(values).all()
            means.append(values.mean())
        assert np.abs(np.diff(means)).max() < JUMP * np.mean(means)
        assert np.ptp(means) > 1e-3 * np.mean(means)


def test_mirror_smooth_surfaces_are_drawn_like_the_smoothest(generator):
    scene = replace(lit(generator.scene(0), "port_night", 40.0), decals=())
    means = []
    for roughness in (0.0, 1e-9, MIN_ROUGHNESS):
        paint = replace(scene.surface.paint, roughness=roughness)
        smooth = replace(scene, surface=replace(scene.surface, paint=paint))
        values = luminance(generator, smooth, scene.cameras[0])
        assert np.isfinite(values).all()
        means.append(values.mean())
    assert means[0] == pytest.approx(means[1], rel=1e-6)
    assert means[0] == pytest.approx(means[2], rel=1e-3)
