"""Openness to the sky, against rays and integrals."""

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from fastgen import openness
from fastgen.container import build_container
from fastgen.gl import open_context
from fastgen.openness import SkyProbe, encoded, open_sky, probe_points, sky_directions
from fastgen.spreader import build_spreader


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def decoded(values):
    """Directions [V, 3] and shares [V] of encoded openness."""
    rows = np.frombuffer(values, np.uint8).reshape(-1, 4).astype(float)
    return (rows[:, :3] - 128) / 127, rows[:, 3] / 255


def rays_open(meshes, points, directions):
    """Whether each of rays [K] from points [K, 3] leaves all meshes behind."""
    free = np.ones(len(points), bool)
    for mesh in meshes:
        body = trimesh.Trimesh(mesh.positions_mm, mesh.triangles.astype(np.int64), process=False)
        free &= ~RayMeshIntersector(body).intersects_any(points, directions)
    return free


def test_under_an_open_sky_a_surface_sees_all_of_it_about_its_normal():
    normals = np.random.default_rng(0).normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for values in (encoded(normals, np.ones((1, 1), bool)), open_sky(normals)):
        direction, share = decoded(values.tobytes())
        assert (share == 1).all()
        np.testing.assert_allclose(direction, normals, atol=0.5 / 127 + 1e-9)


def test_a_wall_beside_a_surface_takes_half_and_turns_the_light_away_from_it():
    """Open on the +x side only: half the light, from (2/3, 0, pi/3) by integration."""
    open_to = (sky_directions()[:, 0] > 0)[None]
    direction, share = decoded(encoded(np.array([[0.0, 0.0, 1.0]]), open_to).tobytes())
    assert share[0] == pytest.approx(0.5, abs=0.02)
    expected = np.array([2 / 3, 0, np.pi / 3])
    np.testing.assert_allclose(direction[0], expected / np.linalg.norm(expected), atol=0.05)


@pytest.mark.parametrize("kind", ["20", "45HC"])
@pytest.mark.parametrize("held", [False, True])
def test_the_share_of_open_sky_is_that_of_rays(gl, kind, held):
    container = build_container(kind)
    spreader = build_spreader(kind) if held else None
    probe = SkyProbe(gl.ctx)
    _, share = decoded(probe.openness(container, spreader))
    probe.release()
    sheets = [i for i, c in enumerate(container.charts) if c.face != "underside"]
    rng = np.random.default_rng(1)
    chosen = rng.choice(np.flatnonzero(np.isin(container.chart, sheets)), 800, replace=False)
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosine = np.maximum(container.normals[chosen] @ directions.T, 0)
    points = np.repeat(probe_points(container)[chosen], len(directions), axis=0)
    meshes = [container] if spreader is None else [container, spreader]
    free = rays_open(meshes, points, np.tile(directions, (len(chosen), 1)))
    expected = (cosine * free.reshape(cosine.shape)).sum(1) / cosine.sum(1)
    # vertices within another part see nothing; what is interpolated from them is better not dark
    error = (share[chosen] - expected)[expected > 0.02]
    assert len(error) > 600
    assert np.quantile(np.abs(error), 0.9) < 0.1
    assert abs(error.mean()) < 0.02


def test_what_is_kept_on_disk_is_what_was_found(gl, monkeypatch):
    container, spreader = build_container("20"), build_spreader("20")
    first = SkyProbe(gl.ctx).openness(container, spreader)

    def never(*_: object) -> None:
        raise AssertionError("probed again")

    monkeypatch.setattr(openness.SkyProbe, "_open_to", never)
    assert SkyProbe(gl.ctx).openness(container, spreader) == first


def test_backends_find_the_same(gl):
    container = build_container("20")
    found = []
    for backend in ("egl", "osmesa"):
        with open_context(backend) as context:
            probe = SkyProbe(context.ctx)
            found.append(probe.openness(container, None))
    assert found[0] == found[1]
