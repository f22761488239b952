"""Parts meet without gaps, checked on the meshes and by looking for pinholes in images."""

import dataclasses

import numpy as np
import pytest

from fastgen.geometry.container import build_container
from fastgen.geometry.seams import stitched
from fastgen.geometry.spreader import build_spreader
from fastgen.scene.container_kinds import KINDS, WallProfiles
from tests import oracle


def areas(positions, triangles):
    a, b, c = positions[triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def test_edges_are_split_where_neighbours_have_vertices():
    # a square of two triangles; three narrow ones share its right edge and two its lower edge
    positions = np.array(
        [[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0], [3, 1, 0], [3, 2, 0], [5, 0, 0], [1.5, 0, 0]]
        + [[1, -2, 0], [0, 0, 0], [3, 0, 0], [3, 3, 0]],
        float,
    )
    triangles = np.array(
        [[0, 1, 2], [0, 2, 3], [10, 6, 4], [4, 6, 5], [5, 6, 11], [9, 8, 7], [7, 8, 10]]
    )
    values = positions[:, :2] * 10
    points, more, faces, source = stitched(positions, values, triangles)
    assert len(faces) == len(triangles) + 3
    np.testing.assert_allclose(more, points[:, :2] * 10)
    for triangle in range(len(triangles)):
        whole = areas(positions, triangles[[triangle]]).sum()
        assert areas(points, faces[source == triangle]).sum() == pytest.approx(whole)
    # every inner edge is now shared by two triangles, matched by position
    names = np.unique(points.round(6), axis=0, return_inverse=True)[1].ravel()[faces]
    edges = [tuple(sorted((t[i], t[(i + 1) % 3]))) for t in names.tolist() for i in range(3)]
    border = [e for e in set(edges) if edges.count(e) == 1]
    length = sum(
        np.linalg.norm(np.subtract(*np.unique(points.round(6), axis=0)[list(e)])) for e in border
    )
    outline = 3 + 3 + 2 + np.sqrt(4 + 9) + 2 * np.sqrt(2**2 + 1) - np.sqrt(5) + np.sqrt(8)
    assert length == pytest.approx(outline, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_no_vertex_lies_within_an_edge_of_only_one_triangle(kind):
    for mesh in (build_container(kind, WallProfiles()), build_spreader(kind)):
        points, names = np.unique(mesh.positions_mm, axis=0, return_inverse=True)
        corners = names.ravel()[mesh.triangles].astype(np.int64)
        edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
        edges, uses = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        loose = edges[uses == 1]
        vertices = points[np.unique(loose)].astype(np.float64)
        for a, b in points[loose].astype(np.float64)[::7]:
            along = (vertices - a) @ (b - a) / ((b - a) @ (b - a))
            aside = np.linalg.norm(vertices - a - along[:, None] * (b - a), axis=1)
            length = np.linalg.norm(b - a)
            inside = (along * length > 0.06) & ((1 - along) * length > 0.06)
            assert not (inside & (aside < 0.04)).any()


def test_no_pixel_centre_falls_through_the_door(generators):
    generator = generators(seed=2024, size=(256, 256))
    for index in (14, 21, 31, 34, 45, 47, 50, 52):
        scene = dataclasses.replace(generator.scene(index), damages=())
        sample = generator.render(scene=scene, camera="Cr")
        void = sample.ids == 0
        around = [np.roll(void, shift, axis) for shift in (-1, 1) for axis in (0, 1)]
        alone = void & ~np.any(around, axis=0)
        mesh = build_container(scene.container.kind, scene.container.profiles)
        assert not (alone & oracle.cast(mesh, sample.view, scene).hit).any()
