"""Rust on walls: no visible repetition, and streaks that run down."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.srgb import DECODED
from tests.plain import EVEN_PAINT

TEXEL_MM = 20.0
BORDER = 8


@pytest.fixture(scope="module", params=[0, 1])
def wall(request):
    """Brightness [H, W] of a white container's side with black rust; row 0 is the lowest."""
    config = Config.from_values(
        {
            "container": {"kinds": {"40": 1}},
            "damage": {"probability": 0},
            "weather": {"wet_probability": 0},
            "surface": {
                "colors": {"white": "#ffffff"},
                **EVEN_PAINT,
                "rust_coverage": 0.1,
            },
        }
    )
    with Generator(config, 3, (64, 64)) as generator:
        scene = generator.scene(request.param)
        rust = replace(scene.surface.rust, albedo=(0.0, 0.0, 0.0))
        scene = replace(scene, decals=(), surface=replace(scene.surface, rust=rust))
        mesh = PreparedScene(scene).container
        colors = generator.bake(scene, TEXEL_MM).base_color[::-1]
    side = next(c for c in mesh.charts if (c.face, c.material) == ("front", "paint_sheet"))
    x, y, width, height = (np.array(side.rect_mm) / TEXEL_MM).astype(int)
    inside = colors[y + BORDER : y + height - BORDER, x + BORDER : x + width - BORDER]
    return DECODED[inside].mean(axis=-1)


def test_rust_does_not_repeat_along_a_wall(wall):
    """A repeated tile would correlate fully at its period, and a sum of two tiles by half."""
    apart = wall - wall.mean()
    alike = [
        (apart[:, lag:] * apart[:, :-lag]).mean() / apart.var()
        for lag in range(int(1000 / TEXEL_MM), int(0.8 * wall.shape[1]))
    ]
    assert max(alike) < 0.65


def test_rust_streaks_run_down_a_wall(wall):
    """Paint below rust is darker than paint above it."""
    rusty = wall < 0.3
    step = int(200 / TEXEL_MM)
    low, high = slice(None, -step), slice(step, None)
    below = wall[low][rusty[high] & ~rusty[low]].mean()
    above = wall[high][rusty[low] & ~rusty[high]].mean()
    assert below < above - 0.05


def test_most_streaks_start_at_the_top_of_a_wall(wall):
    """Rust stains more of the paint below the upper edge than above the lower one."""
    undamaged = np.where(wall < 0.3, np.nan, wall)
    rows = int(300 / TEXEL_MM)
    top, bottom = np.nanmean(undamaged[-rows:]), np.nanmean(undamaged[:rows])
    assert top < bottom - 0.02


def test_old_rust_is_darker_and_lies_inside_younger_rust(generators):
    surface = {**EVEN_PAINT, "rust_coverage": 0.2, "rust_colors": ["#6b3a1c"]}
    values = {"surface": {"colors": {"white": "#ffffff"}, **surface}}
    config = Config.from_values({"damage": {"probability": 0}, **values})
    generator = generators(config, 3, (64, 64))
    scene = replace(generator.scene(0), decals=())
    mesh = PreparedScene(scene).container
    colors = DECODED[generator.bake(scene, 5.0).base_color[::-1]]
    roof = next(c for c in mesh.charts if (c.face, c.material) == ("roof", "paint_sheet"))
    x, y, width, height = (np.array(roof.rect_mm) / 5.0).astype(int)
    blue, red = colors[y + 60 : y + height - 60, x + 60 : x + width - 60, [2, 0]].transpose(2, 0, 1)
    rusty = blue < 0.5 * red.max() * 0.2
    depth = cv2.distanceTransform(rusty.astype(np.uint8), cv2.DIST_L2, 5)
    rim, core = red[(depth > 1.5) & (depth < 3)].mean(), red[depth > 8].mean()
    assert core < 0.8 * rim
