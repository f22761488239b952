"""Light on a roof below a spreader, compared with the ray-traced preset."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.generator import Generator

ROOF = Config.from_values(
    {
        "cameras": {
            "roof": {
                "face": "roof",
                "focal_mm": 14,
                "distance_mm": 5500,
                "azimuth_deg": 25,
                "elevation_deg": 30,
            }
        },
        "spreader": {"probability": 1},
        "damage": {"probability": 0},
        "environment": {"names": ["dawn"]},  # no sun
    }
)


@pytest.mark.parametrize(("paint", "spreader"), [(0.03, 0.7), (0.6, 0.02)])
def test_light_from_a_roofs_hidden_sky_has_the_spreaders_colour(paint, spreader):
    light, roof = {}, None
    for quality in ("high", "balanced"):
        with Generator(ROOF, seed=1, size=(160, 160), quality=quality) as generator:
            scene = generator.scene(0)
            surface = scene.surface
            scene = replace(
                scene,
                decals=(),
                spreader=replace(scene.spreader, albedo=(spreader,) * 3),
                surface=replace(surface, paint=replace(surface.paint, albedo=(paint,) * 3)),
            )
            sample = generator.render(scene=scene, normals=True)
        if roof is None:
            held = [each.id for each in sample.objects if each.class_name == "spreader"]
            up = (sample.normals @ sample.view.rotation)[..., 2] > 0.9
            roof = up & (sample.ids > 0) & ~np.isin(sample.ids, held)
            assert roof.sum() > 1000
        # after the tone curve, which affects both alike
        light[quality] = (((sample.image[roof] / 255 + 0.055) / 1.055) ** 2.4).mean()
    assert light["balanced"] == pytest.approx(light["high"], rel=0.2)
