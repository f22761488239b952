"""Layers of the visibility buffer: shading reads the layer that an image names."""

from functools import partial

import numpy as np

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render import renderer
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.visibility_buffer import VisibilityBuffer

SIZE = (160, 120)
HOLED = Config.from_values(
    {
        "damage": {"probability": 1, "count": [2, 3], "kinds": ["perforation", "concave"]},
        "spreader": {"probability": 1},
    }
)


def drawn():
    """Return images of two damaged scenes, with normals."""
    with Generator(HOLED, seed=5, size=SIZE) as generator:
        drawing = generator.gpu.renderer()
        scenes = [generator.scene(index) for index in (0, 1)]
        return [
            drawing.render(PreparedScene(scene), scene.camera("A"), SIZE, normals=True)
            for scene in scenes
        ]


def test_every_pass_reads_the_layer_of_the_image(monkeypatch):
    """The second layer gets a copy of what was drawn, and the first one other content."""
    usual = drawn()
    begin, end = VisibilityBuffer.begin, VisibilityBuffer.end
    copied = []

    def begin_two(samples, layers):
        begin(samples, [*layers, *layers])

    def copy_to_second(samples):
        end(samples)
        for name, texture in samples.textures.items():
            first = texture.read()[: len(texture.read()) // 2]
            texture.write(np.zeros(len(first), np.uint8).tobytes() + first)
            copied.append(name)

    monkeypatch.setattr(VisibilityBuffer, "begin", begin_two)
    monkeypatch.setattr(VisibilityBuffer, "end", copy_to_second)
    monkeypatch.setattr(renderer, "DrawInputs", partial(DrawInputs, layer=1))
    for one, other in zip(usual, drawn(), strict=True):
        for name in ("image", "cover", "ids", "damage", "depth", "normals"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    assert {"surface_ids", "atlas_positions", "rest_x"} <= set(copied)
    assert any((frame.damage // 100 == 5).any() for frame in usual), "no hole is in view"
