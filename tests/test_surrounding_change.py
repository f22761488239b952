"""Light of ground and neighbours: vertex bytes decoded as in the shader, and the light."""

import numpy as np
import pytest

from fastgen.geometry.shape_library import ShapeLibrary
from fastgen.light.environment import Ambient, prefilter_environment, sky_irradiance
from fastgen.light.sky_visibility import (
    Sky,
    SkyVisibility,
    encoded_cones,
    sky_directions,
)
from fastgen.light.surrounding_change import SurroundingLight, lattice


@pytest.mark.parametrize("added", [0.0, 0.4, 20.0])
@pytest.mark.parametrize("color", [(1.0, 1.0, 1.0), (0.01, 0.3, 1.0)], ids=["grey", "blue"])
def test_encoded_light_of_surroundings_is_the_light_itself(color, added):
    """Cover channels that are dark in the open, and light that needs another common scale."""
    sky = Sky(Ambient.of(prefilter_environment("even", np.full((32, 64, 3), color, "f4"))), 20.0)
    mesh = ShapeLibrary().container("20")
    low, high = mesh.bounds_mm
    points = len(lattice((high - low) / 2)[0])
    open_to = np.tile(sky_directions() @ np.array([0.6, 0.0, 0.8]) > 0, (len(mesh.normals), 1))
    bits = np.packbits(open_to, axis=1)
    visibility = SkyVisibility.of(mesh.normals, bits, encoded_cones(mesh.normals, open_to))
    values, _, light = visibility.lit(sky)
    change = SurroundingLight(
        sky=np.full((points, 3), 0.7, np.float32),
        added=np.tile(np.array([1.0, 0.5, 0.25], np.float32) * np.float32(added), (points, 1)),
        lower=np.zeros((6, 3), np.float32),
        open_bits=np.full((points, bits.shape[1]), 0xF0, np.uint8),
        ground=None,
        faces=np.zeros((6, 3), np.float32),
    )
    found = change.applied(visibility, sky, values, light, mesh)
    expected = change.vertex_light(values, light, mesh)
    cones = (found[:, :3].astype(float) - 128) / 127
    bent = cones / np.linalg.norm(cones, axis=1, keepdims=True)
    whole = sky_irradiance(sky.light, bent.astype(np.float32), sky.yaw_deg)
    # as shaders/sky_visibility_at.glsl decodes it
    decoded = found[:, 4:7] / 127 * (1 + found[:, 7:8] / 4) * whole
    brightest = (expected / whole).max(axis=1, keepdims=True)
    # the largest ratio is 255 / 127 times the largest scale; brighter light keeps its colour
    fits = np.minimum(1, 255 / 127 * (1 + 255 / 4) / brightest)
    step = whole * brightest.clip(1) * fits / 100
    assert (np.abs(decoded - expected * fits) < step).all()
    assert (found[:, 8:] == (bits & 0xF0)).all()
