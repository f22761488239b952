"""Values for the shader's blocks, against what the shader makes of them."""

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.mesh import MATERIALS
from fastgen.srgb import DECODED
from fastgen.surface_values import reflectances


@pytest.mark.parametrize(("rust", "roughness"), [(0.0, 0.3), (0.0, 0.8), (0.12, 0.5)])
def test_what_a_roof_reflects_is_the_mean_of_its_paint_and_rust(rust, roughness):
    """And what a dielectric of 4 % mirrors before them: over a hemisphere 2 to 9 %."""
    config = Config.from_values(
        {
            "damage": {"probability": 0.0},
            "surface": {
                "colors": {"paint": "#2060c0"},
                "rust_coverage": rust,
                "roughness": roughness,
            },
            "weather": {"wet_probability": 0.0},
        }
    )
    with Generator(config, seed=3, size=(64, 64)) as generator:
        scene = generator.scene(index=1)
        mesh = generator._gpu.renderer().mesh(scene.container)
        atlas = generator.bake(scene, texel_mm=20.0)
    x, y, width, height = (
        np.array(
            next(
                chart.rect_mm
                for chart in mesh.charts
                if (chart.face, chart.material) == ("roof", "paint_sheet")
            )
        )
        / atlas.texel_mm
    ).astype(int)
    roof = DECODED[atlas.base_color[::-1][y + 1 : y + height, x + 1 : x + width]]
    albedo = roof.reshape(-1, 3).mean(axis=0)
    found = np.array(reflectances(scene)[MATERIALS.index("paint_sheet")])
    mirrored = (found - albedo) / (1 - albedo)
    assert (mirrored > 0.01).all()
    assert (mirrored < 0.1).all()
