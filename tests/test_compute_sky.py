"""The sky as a compute shader stores it where a GPU draws, on the driver at hand, against the sky
that is rasterized."""

import dataclasses

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.gl import open_context
from fastgen.renderer import Renderer
from fastgen.scene import Lens

SIZE = (203, 131)  # no row of an image fills work groups
DAMAGE = {"damage": {"probability": 1, "count": [2, 4]}}
HOLES = {"damage": {"probability": 1, "count": [2, 3], "kinds": ["perforation"]}}


@pytest.fixture(scope="module")
def lights():
    with Generator(seed=9, size=SIZE) as made:
        yield made._gpu.renderer()._light_of


@pytest.fixture
def drawn(lights):
    """Frames of some scenes, one drawn over the other: as on a processor, then as on a GPU."""

    def of(scenes, camera, layer="all", **options):
        found = []
        for software in (True, False):
            with open_context() as gl:
                gl.software = software
                with Renderer(gl, lights, **options) as renderer:
                    found.append([renderer.render(s, camera(s), SIZE, layer) for s in scenes])
        return zip(*found, strict=True)

    return of


def scenes(*values):
    """One of each distribution, so that each is drawn over what another left."""
    for value in values:
        with Generator(Config.from_values(value), seed=9, size=SIZE) as generator:
            yield generator.scene(1)


def check(pairs, most_steps):
    """Labels and depths are the same to the bit, and colours but for the sky's: one way
    interpolates where in the map they are."""
    for usual, other in pairs:
        for name in ("ids", "damage", "depth", "cover"):
            np.testing.assert_array_equal(getattr(usual, name), getattr(other, name), name)
        off = np.abs(usual.image.astype(int) - other.image.astype(int))
        assert off.max() <= most_steps
        np.testing.assert_array_equal(off[usual.cover == 255], 0)
        assert (usual.ids == 0).any()
        assert (usual.ids > 0).any()


@pytest.mark.parametrize("options", [{"samples_per_axis": 1, "coarse": True}, {}])
def test_frames_are_the_same_but_for_steps_of_the_sky(drawn, options):
    order = list(scenes({}, HOLES, DAMAGE, {}))
    check(drawn(order, lambda scene: scene.camera("Cl"), **options), 2)


def test_so_are_bent_frames_and_single_layers(drawn):
    (scene,) = scenes(DAMAGE)
    bent = dataclasses.replace(
        scene.camera("B"), lens=Lens("brown_conrady", (-0.01, 0.0, 0.0, 0.0, 0.0))
    )
    check(drawn([scene], lambda _: bent), 1)
    for layer in ("rust", "normals"):
        check(drawn([scene], lambda _: bent, layer), 0)


def test_a_driver_on_the_processor_is_known_as_such():
    with open_context() as gl:
        assert gl.software == ("llvmpipe" in gl.renderer)
