"""The sky from the compute shader that GPUs use, compared with the rasterized sky.

Both run on the driver of this machine.
"""

import dataclasses

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.environment import load_environment
from fastgen.light.hdri import bundled_hdris
from fastgen.render.gl import is_software, open_context
from fastgen.render.renderer import Renderer
from fastgen.render.settings import QUALITY
from fastgen.scene import Lens

SIZE = (203, 131)  # no row of an image fills its work groups
DAMAGE = {"damage": {"probability": 1, "count": [2, 4]}}
HOLES = {"damage": {"probability": 1, "count": [2, 3], "kinds": ["perforation"]}}


def light(name):
    return load_environment(bundled_hdris()[name])


def drawn(scenes, camera, layer="all", quality=QUALITY["balanced"]):
    """Return pairs of frames of each scene: rendered as on a CPU, and as on a GPU.

    The scenes are drawn one after another into the same targets.
    """
    found = []
    for software in (True, False):
        with open_context() as gl:
            gl.software = software
            with Renderer(gl, light, quality) as renderer:
                found.append(
                    [renderer.render(PreparedScene(s), camera(s), SIZE, layer) for s in scenes]
                )
    return zip(*found, strict=True)


def one_of_each(*values):
    """Return one scene of each configuration."""
    return [Generator(Config.from_values(value), seed=9).scene(1) for value in values]


def check(pairs, most_steps):
    """Assert that labels and depths are bit-identical and that only sky colours differ slightly.

    Sky colours may differ because one method interpolates environment map coordinates.
    """
    for usual, other in pairs:
        for name in ("ids", "damage", "depth", "cover"):
            np.testing.assert_array_equal(getattr(usual, name), getattr(other, name), name)
        off = np.abs(usual.image.astype(int) - other.image.astype(int))
        assert off.max() <= most_steps
        assert off[usual.ids == 0].mean() <= 0.1 * most_steps
        np.testing.assert_array_equal(off[usual.cover == 255], 0)
        assert (usual.ids == 0).any()
        assert (usual.ids > 0).any()


@pytest.mark.parametrize("quality", [QUALITY["draft"], QUALITY["balanced"]])
def test_frames_differ_only_by_small_steps_in_the_sky(quality):
    order = one_of_each({}, HOLES, DAMAGE, {})
    check(drawn(order, lambda scene: scene.camera("Cl"), quality=quality), 2)


def test_distorted_frames_and_single_layers_differ_only_in_the_sky():
    (scene,) = one_of_each(DAMAGE)
    bent = dataclasses.replace(
        scene.camera("B"), lens=Lens("brown_conrady", (-0.01, 0.0, 0.0, 0.0, 0.0))
    )
    check(drawn([scene], lambda _: bent), 1)
    for layer in ("rust", "normals"):
        check(drawn([scene], lambda _: bent, layer), 0)


@pytest.mark.parametrize(
    ("renderer", "software"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("softpipe", True),
        ("zink Vulkan 1.3(llvmpipe (LLVM 15.0.6, 256 bits) (MESA_LLVMPIPE))", True),
        ("NVIDIA H200/PCIe/SSE2", False),
        ("Mesa Intel(R) UHD Graphics 620 (KBL GT2)", False),
        ("AMD Radeon RX 6600 (radeonsi, navi23, LLVM 17.0.6, DRM 3.57, 6.8.0)", False),
    ],
)
def test_software_drivers_are_told_from_gpus(renderer, software):
    assert is_software(renderer) is software
