"""All shaders checked by the GLSL reference compiler, which rejects code that some drivers accept.

Vertex shaders are linked with their fragment shaders.
"""

import hashlib
import itertools
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from fastgen.classes import ALL_DAMAGE_CLASSES, DRAWN_DAMAGE_CLASSES
from fastgen.light.directional_lights import MAX_LIGHTS
from fastgen.render import settings
from fastgen.render.blocks import BLOCKS
from fastgen.render.constants import CONSTANTS
from fastgen.render.program import expand, shader_text
from fastgen.render.variant import (
    DAMAGE_VARIANTS,
    LAYERS,
    GroundVariant,
    ShaderVariant,
    listed_classes,
)
from fastgen.resources import shader_path
from fastgen.scene.limits import GROUNDS

COMPILER = "glslangValidator"
LIGHTS = (0, 1, MAX_LIGHTS)


class Programs:
    """Folder of shader texts for the compiler, one subfolder per program."""

    def __init__(self, folder):
        self.folder = folder

    def add(self, stages, variant):
        self.keep({name.rpartition(".")[2]: expand(shader_text(name), variant) for name in stages})

    def keep(self, texts):
        program = self.folder / hashlib.sha256(repr(texts).encode()).hexdigest()[:16]
        program.mkdir(exist_ok=True)
        for stage, text in texts.items():
            (program / f"shader.{stage}").write_text(text, encoding="utf-8")


@pytest.fixture
def programs(tmp_path):
    assert shutil.which(COMPILER), "glslangValidator is missing; run make glslang"
    return Programs(tmp_path)


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
def test_shading_is_standard_glsl(programs, quality):
    chosen = settings.QUALITY[quality]
    # large images have fewer samples than their quality specifies
    for samples in [n for n in (1, 2, 3, 5) if n == 1 == chosen[0] or 1 < n <= chosen[0]]:
        for layer in LAYERS if quality in ("draft", "balanced") and samples != 2 else ("all",):
            for radiance in (False, True) if layer == "all" else (False,):
                variant = ShaderVariant(
                    samples,
                    chosen.lookups,
                    layer,
                    traced=chosen.traced and layer == "all",
                    radiance=radiance,
                )
                add_all(programs, variant)
    assert refused(programs.folder) == ""


def add_all(programs, variant):
    programs.add(("background.comp",), variant)
    programs.add(("background.vert", "background.frag"), variant)
    programs.add(("fullscreen.vert", "background_by_ray.frag"), variant)
    for damage in DAMAGE_VARIANTS:
        programs.add(("classify.comp",), replace(variant, damage=damage))
    for name, lights in itertools.product(listed_classes(variant.samples_per_axis), LIGHTS):
        damage = "holed" if "damaged" in name or name == "holed" else "undamaged"
        shaded = replace(variant, pixel_class=name, damage=damage, lights=lights)
        programs.add(("shade.comp",), shaded)


def test_all_other_shaders_are_standard_glsl(programs):
    for damage in DAMAGE_VARIANTS:
        for kinds in (DRAWN_DAMAGE_CLASSES, ALL_DAMAGE_CLASSES):
            drawn = ShaderVariant(damage=damage, kinds=kinds)
            programs.add(("geometry.vert", "geometry.frag"), drawn)
        of_points = ShaderVariant(
            pixel_class="decal" if damage == "undamaged" else "damaged",
            damage=damage,
            kinds=ALL_DAMAGE_CLASSES,
        )
        for samples in (1, 2, 3, 5):
            variant = replace(of_points, samples_per_axis=samples)
            programs.add(("fullscreen.vert", "ray_points.frag"), variant)
            traits = {"undamaged": "mixed", "damaged": "mixed_damaged", "holed": "holed"}
            if samples > 1 or damage == "holed":
                normals = replace(variant, pixel_class=traits[damage])
                programs.add(("normals.comp",), normals)
        if damage != "holed":
            programs.add(("bake.vert", "bake.frag"), of_points)
    programs.add(("occluder.vert", "occluder.frag"), ShaderVariant())
    for kind, wet, coarse in zip(GROUNDS, (False, True, True), (True, False, True), strict=True):
        ground = GroundVariant(
            kind, boxes=True, wet=wet, props=not coarse, shadows=coarse, coarse=coarse
        )
        variant = ShaderVariant(lookups=2 - coarse, lights=MAX_LIGHTS if wet else 1, ground=ground)
        programs.add(("rectangles.vert", "ground.frag"), variant)
        programs.add(("fullscreen.vert", "ground_bake.frag"), variant)
    lens = ShaderVariant(lens=True)
    programs.add(("rectangles.vert", "ground_spread.frag"), lens)
    programs.add(("rectangles.vert", "background_by_ray.frag"), lens)
    assert refused(programs.folder) == ""


@pytest.mark.parametrize("path", sorted(shader_path().iterdir()), ids=lambda path: path.name)
def test_a_shader_file_includes_the_constants_and_blocks_that_it_uses(path):
    # a macro without a definition counts as 0 in #if, so a missing include changes the image
    text = path.read_text()
    included = set(re.findall(r'#include "(\w+\.(?:constants|block))"', text))
    used = set(re.findall(r"\b[A-Za-z_]\w*\b", re.sub(r"//.*|#include.*", "", text)))
    everything = [ShaderVariant(samples_per_axis=n, kinds=ALL_DAMAGE_CLASSES) for n in (1, 3)]
    for group, constants in CONSTANTS.items():
        names = {name.split("(")[0] for variant in everything for name in constants(variant)}
        assert bool(names & used) == (f"{group}.constants" in included), group
    for name, block in BLOCKS.items():
        members = {member[1] for member in block.members}
        assert bool(members & used) == (f"{name}.block" in included), name


def test_code_that_only_drivers_accept_is_rejected(programs):
    pasted = "#define ONE(name) name##_1\n#define A_1 1\n#if ONE(A)\n#endif\n"
    programs.keep({"comp": f"#version 430 core\n{pasted}void main() {{}}\n"})
    assert "'#if' : unexpected tokens" in refused(programs.folder)


def test_shaders_with_mismatched_interfaces_are_rejected(programs):
    head = "#version 430 core\n"
    vertex = f"{head}out vec2 place; void main() {{ place = vec2(0.0); }}"
    fragment = f"{head}in vec3 place; void main() {{ if (place.z > 0.0) discard; }}"
    programs.keep({"vert": vertex, "frag": fragment})
    assert "place" in refused(programs.folder)
