"""Values for the shader's blocks, against what the shader makes of them."""

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.mesh import MATERIALS
from fastgen.shapes import spreader_mesh
from fastgen.srgb import DECODED
from fastgen.surface_values import reflectances


@pytest.mark.parametrize(
    ("part", "rust", "roughness"),
    [("roof", 0.0, 0.3), ("roof", 0.0, 0.8), ("roof", 0.2, 0.5), ("spreader", 0.2, 0.5)],
)
def test_what_is_reflected_is_the_mean_of_paint_rust_and_stains(part, rust, roughness):
    """And what a dielectric of 4 % mirrors before them: over a hemisphere 2 to 9 %."""
    config = Config.from_values(
        {
            "damage": {"probability": 0.0},
            "surface": {
                "colors": {"paint": "#2060c0"},
                "rust_coverage": rust,
                "roughness": roughness,
                "dirt_strength": 0,
                "ageing_strength": 0,
            },
            "spreader": {"probability": 1.0},
            "weather": {"wet_probability": 0.0},
        }
    )
    with Generator(config, seed=3, size=(64, 64)) as generator:
        scene = generator.scene(index=1)
        meshes = generator._gpu.renderer().mesh(scene.container), spreader_mesh(scene)
        atlases = generator.bake(scene, texel_mm=20.0), generator.bake_spreader(scene, 20.0)
    which = int(part == "spreader")
    mesh, atlas = meshes[which], atlases[which]
    material = ("paint_sheet", "spreader")[which]
    charts = [mesh.charts[i] for i in mesh.chart[mesh.triangles[:, 0]]]
    faces = {"roof"} if part == "roof" else {chart.face for chart in charts}
    of_it = np.array([chart.material == material and chart.face in faces for chart in charts])
    u, v = atlas.uv(points_on(mesh, of_it)).T
    height, width = atlas.base_color.shape[:2]
    albedo = DECODED[atlas.base_color[(v * height).astype(int), (u * width).astype(int)]].mean(0)
    found = np.array(reflectances(scene, meshes)[MATERIALS.index(material)])
    mirrored = (found - albedo) / (1 - albedo)
    assert (mirrored > 0.01).all()
    assert (mirrored < 0.1).all()


def points_on(mesh, chosen, count=20000):
    """Points [N, 2] in the atlas, in mm, spread evenly over triangles `chosen` [T] of a mesh."""
    rng = np.random.default_rng(1)
    corners = mesh.positions_mm[mesh.triangles[chosen]].astype(float)
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    drawn = rng.choice(len(area), count, p=area / area.sum())
    shares = rng.dirichlet((1, 1, 1), count)
    on_sheet = mesh.atlas_mm[mesh.triangles[chosen]].astype(float)[drawn]
    return np.einsum("nk,nkc->nc", shares, on_sheet)
