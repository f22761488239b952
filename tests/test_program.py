"""Programs: which shader programs variants share."""

import pytest

from fastgen.classes import ALL_DAMAGE_CLASSES, DRAWN_DAMAGE_CLASSES
from fastgen.render import program
from fastgen.render.program import Programs, expand, shader_text
from fastgen.render.variant import ShaderVariant

STAGES = ("geometry.frag", "classify.comp", "shade.comp", "bake.frag", "normals.comp")


@pytest.fixture
def programs(monkeypatch):
    """Programs without OpenGL: each is the list of its complete texts."""
    monkeypatch.setattr(
        program,
        "ShaderProgram",
        lambda _, stages, variant, read: [expand(read(stage), variant, read) for stage in stages],
    )
    return Programs(None, shader_text)


@pytest.mark.parametrize("stage", STAGES)
def test_programs_without_damage_are_shared_by_all_configured_kinds(programs, stage):
    few, many = (
        programs.get((stage,), ShaderVariant(kinds=kinds))
        for kinds in (DRAWN_DAMAGE_CLASSES, ALL_DAMAGE_CLASSES)
    )
    assert few is many


@pytest.mark.parametrize("stage", STAGES)
def test_programs_with_damage_have_the_forms_of_their_kinds(programs, stage):
    few, many = (
        programs.get((stage,), ShaderVariant(pixel_class="holed", damage="holed", kinds=kinds))
        for kinds in (DRAWN_DAMAGE_CLASSES, ALL_DAMAGE_CLASSES)
    )
    assert "graffiti_mark" in many[0]
    assert "graffiti_mark" not in few[0]
