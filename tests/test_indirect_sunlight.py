"""Indirect sunlight between parts of a container, compared with ray casts."""

from dataclasses import replace

import image_error
import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.settings import QUALITY
from fastgen.scene import EnvironmentView, Spreader
from tests import oracle
from tests.plain import EVEN_PAINT
from tests.sky_samples import one_light
from tests.test_environment import write_exr

RAYS = 400
EVEN = {**EVEN_PAINT, "colors": {"grey": "#bcbcbc"}, "roughness": 1.0}


@pytest.fixture(scope="module", params=[(0.7, 0.5, 0.5), (0.6, -0.75, 0.3)], ids=["right", "left"])
def recess(request, tmp_path_factory):
    """Rendered and expected colours [N, 3] of shaded pixels around a door leaf.

    The sky is black except for one sun. The expected colours are one-bounce light found by rays.
    """
    toward = np.array(request.param) / np.linalg.norm(request.param)
    folder = tmp_path_factory.mktemp("skies")
    write_exr(folder / "sun.exr", one_light(toward, 1e6, 512) + np.float32(1e-3))
    config = Config.from_values({"surface": EVEN, "damage": {"probability": 0}})
    with pytest.MonkeyPatch.context() as patch:
        # rays go through pixel centres, so each pixel must be shaded individually there
        single = QUALITY["draft"]._replace(coarse=False)
        patch.setitem(QUALITY, "draft", single)
        made = Generator(config, 3, (240, 240), "auto", folder, "draft")
    with made as generator:
        scene = replace(
            generator.scene(0), environment=EnvironmentView("sun", 0.0), decals=(),
            spreader=Spreader(False, (0.5, 0.5, 0.5), (False, False), 15.0),
        )  # fmt: skip
        renderer = generator.gpu.renderer()
        (sun,) = renderer.ambient("sun").lights
        mesh = PreparedScene(scene).container
        sample = generator.render(scene=scene, camera="Cr")
        exposure = generator.exposure(scene, scene.camera("Cr"))
    hits = oracle.cast(mesh, sample.view)
    names = np.array([chart.name for chart in mesh.charts])[mesh.chart[mesh.triangles[:, 0]]]
    paint = np.array([chart.material for chart in mesh.charts])[mesh.chart[mesh.triangles[:, 0]]]
    plain = np.char.startswith(names, "door") | np.char.startswith(names, "post.door")
    plain &= np.isin(paint, ["paint_sheet", "paint_frame"])
    flat = mesh.normals[mesh.triangles[:, 0]].astype(float)
    # faces beside the leaf; the leaf is the wall that hides their sky
    plain &= np.abs(flat[:, 0]) < 0.7
    seen = plain[hits.triangle] & (hits.triangle >= 0)

    body = RayMeshIntersector(
        trimesh.Trimesh(mesh.positions_mm.astype(float), mesh.triangles, process=False)
    )
    start, rays = sample.view.rays()
    normals = flat[hits.triangle[seen]]
    depth = hits.depth_m[seen, None] * 1000
    points = start + depth * rays[seen] / (rays[seen] @ sample.view.rotation[2])[:, None]
    points += 2.0 * normals

    def in_shade(places):
        return body.intersects_any(places, np.tile(toward, (len(places), 1)))

    # keep only points well within the shadow
    steps = 20.0 * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    dark = np.all([in_shade(points + step) for step in steps], axis=0) | (normals @ toward < -0.1)
    chosen = np.flatnonzero(dark)[:: max(1, dark.sum() // 500)]
    points, normals = points[chosen], normals[chosen]
    # cosine-weighted directions: points on a unit sphere around the normal's tip
    rng = np.random.default_rng(0)
    around = rng.normal(size=(len(points), RAYS, 3))
    around /= np.linalg.norm(around, axis=2, keepdims=True)
    ways = (around + normals[:, None]).reshape(-1, 3)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    met, ray, triangle = body.intersects_location(
        np.repeat(points, RAYS, axis=0), ways, multiple_hits=False
    )
    facing = flat[triangle] @ toward
    facing[(flat[triangle] * ways[ray]).sum(axis=1) > 0] = 0
    lit = (facing > 0) & ~in_shade(met + 2.0 * flat[triangle])
    got = np.bincount(ray // RAYS, lit * np.maximum(facing, 0), len(points)) / RAYS
    albedo = image_error.srgb_decode(np.array(0xBC / 255))
    radiance = albedo * albedo * got[:, None] * np.array(sun.light)
    expected = image_error.displayed(radiance, exposure)
    return sample.image[seen][chosen] / 255, expected


def test_indirect_sunlight_on_shaded_faces_is_close_to_ray_casts(recess):
    """Displayed values agree within a factor of two, as walls count as endless and fully lit."""
    found, expected = (colors.mean(axis=1) for colors in recess)
    assert len(found) > 150
    assert 0.8 < found.mean() / expected.mean() < 2.0
    assert np.corrcoef(found, expected)[0, 1] > 0.4
