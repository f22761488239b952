"""All shaders checked by the GLSL reference compiler, which rejects code that some drivers accept.

Vertex shaders are linked with their fragment shaders.
"""

import hashlib
import itertools
import shutil
import subprocess
from unittest.mock import MagicMock

import pytest

from fastgen.light.directional_lights import MOST_SUNS
from fastgen.render import settings
from fastgen.render.programs import DAMAGE_VARIANTS, LAYERS, link, listed_classes
from fastgen.render.shading import Shading

COMPILER = "glslangValidator"
SUNS = (0, 1, MOST_SUNS)


class Recorder(MagicMock):
    """Fake moderngl.Context that writes the shaders it gets into `folder`."""

    def program(self, vertex_shader, fragment_shader):
        self.keep(vert=vertex_shader, frag=fragment_shader)
        return MagicMock()

    def compute_shader(self, text):
        self.keep(comp=text)
        return MagicMock()

    def keep(self, **stages):
        program = self.folder / hashlib.sha256(repr(stages).encode()).hexdigest()[:16]
        program.mkdir(exist_ok=True)
        for stage, text in stages.items():
            (program / f"shader.{stage}").write_text(text, encoding="utf-8")


@pytest.fixture
def recorder(tmp_path):
    assert shutil.which(COMPILER), "glslangValidator is missing; run make glslang"
    made = Recorder()
    made.folder = tmp_path
    return made


def refused(folder):
    """Return the compiler's output for the programs that it rejects."""
    pairs = [sorted(program.iterdir()) for program in folder.iterdir()]
    compute = [pair[0] for pair in pairs if len(pair) == 1]
    commands = [["-l", *pair] for pair in pairs if len(pair) > 1]
    if compute:
        commands.append(compute)  # one process for all takes a third of the time
    assert commands
    words = ""
    for files in commands:
        done = subprocess.run([COMPILER, *files], capture_output=True, text=True, check=False)
        words += done.stdout + done.stderr if done.returncode else ""
    return words


@pytest.mark.parametrize("quality", settings.QUALITY)
def test_shading_is_standard_glsl(recorder, quality):
    chosen = settings.QUALITY[quality]
    # large images have fewer samples than their quality specifies
    for samples in [n for n in (1, 2, 3, 5) if n == 1 == chosen[0] or 1 < n <= chosen[0]]:
        for layer in LAYERS if quality in ("draft", "balanced") and samples != 2 else ("all",):
            shading = Shading(
                recorder,
                samples,
                chosen.lookups,
                layer,
                chosen.traced,
                chosen.coarse,
                compute_sky=True,
            )
            link_all(shading, samples)
    assert refused(recorder.folder) == ""


def link_all(shading, samples):
    shading._store_sky((1, 1))
    for bent, damage, cables in itertools.product((False, True), DAMAGE_VARIANTS, (False, True)):
        shading._draw_sky(MagicMock(), bent)
        shading._classify([(0, 0, 2, 2)], damage, cables)
        for name in listed_classes(samples):
            if shading._comes(name, damage, cables):
                for suns in SUNS:
                    shading._shader(name, suns)


def test_all_other_shaders_are_standard_glsl(recorder):
    for damage in DAMAGE_VARIANTS:
        link(recorder, "geometry.vert", "geometry.frag", {}, damage=damage)
        of_points = {"pixel_class": "decal" if damage == "sound" else "damaged", "damage": damage}
        for samples in (2, 3, 5):
            variant = {**of_points, "samples_per_axis": samples}
            link(recorder, "fullscreen.vert", "light_points.frag", {}, **variant)
        if damage != "holed":
            link(recorder, "bake.vert", "bake.frag", {}, **of_points)
    link(recorder, "occluder.vert", "occluder.frag", {})
    assert refused(recorder.folder) == ""


def test_code_that_only_drivers_accept_is_rejected(recorder):
    pasted = "#define ONE(name) name##_1\n#define A_1 1\n#if ONE(A)\n#endif\n"
    recorder.compute_shader(f"#version 430 core\n{pasted}void main() {{}}\n")
    assert "'#if' : unexpected tokens" in refused(recorder.folder)


def test_shaders_with_mismatched_interfaces_are_rejected(recorder):
    head = "#version 430 core\n"
    vertex = f"{head}out vec2 place; void main() {{ place = vec2(0.0); }}"
    recorder.program(vertex, f"{head}in vec3 place; void main() {{ if (place.z > 0.0) discard; }}")
    assert "place" in refused(recorder.folder)
