"""Textures baked for export: their resolution, and the place of damage in them."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.export import export_glb
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.spreader import build_spreader
from fastgen.scene import Spreader


@pytest.fixture(scope="module")
def generator():
    values = {"container": {"kinds": {"20": 1}}, "damage": {"probability": 1, "count": [4, 4]}}
    with Generator(Config.from_values(values), 2, (64, 64), quality="draft") as made:
        yield made


def test_the_texel_size_proposed_by_an_error_fits(generator, tmp_path):
    scene = generator.scene(0)
    with pytest.raises(ConfigError, match="give ") as caught:
        export_glb(generator, scene, tmp_path / "box.glb", texel_mm=0.01)
    proposed = float(str(caught.value).split("give ")[1].split()[0])
    mesh = build_container(scene.container.kind, scene.container.profiles)
    assert max(mesh.atlas_size_mm) / proposed <= 8192


def test_a_spreader_has_the_container_texel_size_unless_its_atlas_would_be_too_large(
    generator, tmp_path, monkeypatch
):
    scene = replace(
        generator.scene(0), spreader=Spreader(True, (0.5, 0.5, 0.5), (True, True), 15.0)
    )
    container = build_container(scene.container.kind, scene.container.profiles)
    asked = []
    baked = generator.bake_spreader
    monkeypatch.setattr(
        generator, "bake_spreader", lambda scene, mm: asked.append(mm) or baked(scene, mm)
    )
    for most in (4000, int(max(container.atlas_size_mm) / 16)):
        monkeypatch.setattr("fastgen.render.passes.bake.MAX_ATLAS", most)
        export_glb(generator, scene, tmp_path / "box.glb", [], 16.1)
    widest = max(build_spreader(scene.container.kind).atlas_size_mm)
    assert asked[0] == 16.1
    assert asked[1] == pytest.approx(widest * 16 / max(container.atlas_size_mm), rel=0.01)
    assert asked[1] > 16.1


def test_a_dent_marks_its_own_wall_and_not_the_opposite_one(generator):
    undamaged = replace(generator.scene(0), damages=())
    mesh = build_container(undamaged.container.kind, undamaged.container.profiles)
    (_, low, _), (_, _, high) = mesh.bounds_mm
    dent = next(d for i in range(40) for d in generator.scene(i).damages if d.kind == "dented")
    dent = replace(
        dent,
        face="front",
        origin_mm=(0.0, float(low), float(high) / 2),
        along=(1.0, 0.0, 0.0),
        across=(0.0, 0.0, 1.0),
        inward=(0.0, 1.0, 0.0),
    )
    without, dented = (generator.bake(replace(undamaged, damages=d), 16.0) for d in ((), (dent,)))
    levels = [atlas.base_color.astype(int) for atlas in (without, dented)]
    changed = np.abs(levels[0] - levels[1]).max(axis=2) > 1  # shader variants may round differently
    found = {}
    for face in ("front", "back"):
        x, y, width, height = mesh.charts[mesh.chart_index(face)].rect_mm
        ends = without.uv(np.array([(x, y + height), (x + width, y)])) * changed.shape[::-1]
        (left, top), (right, bottom) = np.rint(ends).astype(int)
        found[face] = int(changed[top:bottom, left:right].sum())
    assert found["front"] > 50
    assert found["back"] == 0
