"""Surface values for the uniform blocks, compared with the shader's results."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.geometry.mesh import MATERIALS
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.rust import rusted
from fastgen.render.surface_values import SceneMaterials, scene_values
from fastgen.scene import Spreader
from fastgen.srgb import DECODED


@pytest.mark.parametrize("rust", [0.0, 0.12, 0.2])
def test_mean_albedo_under_rust_equals_baked_textures(generators, rust):
    """Checked on the roof, the frame, castings, the spreader and its cables."""
    config = Config.from_values(
        {
            "damage": {"probability": 0.0},
            "surface": {
                "colors": {"paint": "#2060c0"},
                "rust_coverage": rust,
                "rust_scale_mm": 200,  # so that even the castings have many patches
                "dirt_strength": 0,
                "ageing_strength": 0,
                "scratch_coverage": 0,
                "scrapes": 0,
                "bleach": 0,
                "dirt_streaks": 0,
            },
            "spreader": {"probability": 1.0},
            "weather": {"wet_probability": 0.0},
        }
    )
    generator = generators(config, seed=3, size=(64, 64))
    scene = generator.scene(index=1)
    meshes = PreparedScene(scene).container, PreparedScene(scene).spreader.mesh
    atlases = generator.bake(scene, texel_mm=20.0), generator.bake_spreader(scene, 20.0)
    scene = replace(scene, decals=())
    values = scene_values(PreparedScene(scene), 16)
    base, trait = (np.asarray(values[f"material_{k}"]) for k in ("base", "trait"))
    rate = values["rust_rate"] * trait[:, 1:2]
    found, _ = rusted(base[:, :3], rate, np.array(scene.surface.rust.albedo), meshes)
    for mesh, atlas, material, face in (
        (meshes[0], atlases[0], "paint_sheet", "roof"),
        (meshes[0], atlases[0], "paint_frame", None),
        (meshes[0], atlases[0], "casting", None),
        (meshes[1], atlases[1], "spreader", None),
        (meshes[1], atlases[1], "cable", None),
    ):
        charts = [mesh.charts[i] for i in mesh.chart[mesh.triangles[:, 0]]]
        of_it = np.array([c.material == material and face in (None, c.face) for c in charts])
        u, v = atlas.uv(points_on(mesh, of_it)).T
        height, width = atlas.base_color.shape[:2]
        texels = atlas.base_color[(v * height).astype(int), (u * width).astype(int)]
        albedo = DECODED[texels].mean(axis=0)
        np.testing.assert_allclose(
            found[MATERIALS.index(material)], albedo, rtol=0.05, atol=0.015, err_msg=material
        )


def test_reflectance_is_albedo_plus_a_few_percent_specular(generators):
    generator = generators(seed=3, size=(64, 64))
    scene = replace(generator.scene(index=1), spreader=Spreader(present=False))
    surface = scene.surface
    plain = replace(scene, surface=replace(surface, rust=replace(surface.rust, coverage=0.0)))
    paint = np.array(surface.paint.albedo)
    sheet = np.array(
        SceneMaterials(PreparedScene(plain)).reflectances[MATERIALS.index("paint_sheet")]
    )
    mirrored = (sheet - paint) / (1 - paint)
    assert (mirrored > 0.01).all()
    assert (mirrored < 0.1).all()


def points_on(mesh, chosen, count=20000):
    """Return atlas points [N, 2] in mm, spread evenly over the triangles `chosen` [T]."""
    rng = np.random.default_rng(1)
    corners = mesh.positions_mm[mesh.triangles[chosen]].astype(float)
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    drawn = rng.choice(len(area), count, p=area / area.sum())
    shares = rng.dirichlet((1, 1, 1), count)
    on_sheet = mesh.atlas_mm[mesh.triangles[chosen]].astype(float)[drawn]
    return np.einsum("nk,nkc->nc", shares, on_sheet)
