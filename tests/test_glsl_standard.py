"""All shaders that may be linked, by GLSL's reference compiler: some drivers let pass what it
refuses, and others do not."""

import hashlib
import itertools
import subprocess
from unittest.mock import MagicMock

import pytest

from fastgen import generator
from fastgen.drawing.programs import DAMAGE_VARIANTS, LAYERS, link, listed_classes
from fastgen.drawing.shading import Shading
from fastgen.light.sun import MOST_SUNS

SUNS = (0, 1, MOST_SUNS)


class Recorder(MagicMock):
    """Stands for a moderngl.Context, and writes the shaders that it is given into `folder`."""

    def program(self, vertex_shader, fragment_shader):
        self.keep("vert", vertex_shader)
        self.keep("frag", fragment_shader)
        return MagicMock()

    def compute_shader(self, text):
        self.keep("comp", text)
        return MagicMock()

    def keep(self, stage, text):
        name = hashlib.sha256(text.encode()).hexdigest()[:16]
        (self.folder / f"{name}.{stage}").write_text(text, encoding="utf-8")


@pytest.fixture
def recorder(tmp_path):
    made = Recorder()
    made.folder = tmp_path
    return made


def refused(folder):
    """What the compiler says of those that it refuses."""
    files = sorted(folder.iterdir())
    assert files
    done = subprocess.run(["glslangValidator", *files], capture_output=True, text=True, check=False)
    return done.stdout + done.stderr if done.returncode else ""


@pytest.mark.parametrize("quality", generator.QUALITY)
def test_shading_is_glsl(recorder, quality):
    chosen = generator.QUALITY[quality]
    samples = chosen.samples_per_axis
    for layer in LAYERS if quality == "balanced" else ("all",):
        shading = Shading(
            recorder, samples, chosen.lookups, layer, chosen.traced, chosen.coarse, compute_sky=True
        )
        shading._store_sky((1, 1))
        for bent, damage, cables in itertools.product(
            (False, True), DAMAGE_VARIANTS, (False, True)
        ):
            shading._draw_sky(MagicMock(), bent)
            shading._classify([(0, 0, 2, 2)], damage, cables)
            for name in listed_classes(samples):
                if shading._comes(name, damage, cables):
                    for suns in SUNS:
                        shading._shader(name, suns)
    assert refused(recorder.folder) == ""


def test_all_else_is_glsl(recorder):
    for damage in DAMAGE_VARIANTS:
        link(recorder, "geometry.vert", "geometry.frag", {}, damage=damage)
        of_points = {"pixel_class": "decal" if damage == "sound" else "damaged", "damage": damage}
        for samples in (3, 5):
            variant = {**of_points, "samples_per_axis": samples}
            link(recorder, "fullscreen.vert", "light_points.frag", {}, **variant)
        if damage != "holed":
            link(recorder, "bake.vert", "bake.frag", {}, **of_points)
    link(recorder, "occluder.vert", "occluder.frag", {})
    assert refused(recorder.folder) == ""


def test_what_drivers_alone_take_is_refused(tmp_path):
    pasted = "#define ONE(name) name##_1\n#define A_1 1\n#if ONE(A)\n#endif\n"
    (tmp_path / "pasted.vert").write_text(f"#version 430 core\n{pasted}void main() {{}}\n")
    assert "pasted.vert" in refused(tmp_path)
