"""No two surfaces of a mesh overlap in one plane, where the depth test would choose at random."""

import cv2
import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.seals import scene_seals
from fastgen.geometry.spreader import build_spreader

APART_MM = 0.5
LEAST_MM2 = 4.0
_SLACK_MM = 0.1


def overlaps(corners_mm):
    """Return pairs of triangles of corners_mm [T, 3, 3] that face alike and overlap in a plane."""
    edges = corners_mm[:, 1:] - corners_mm[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    lengths = np.linalg.norm(normals, axis=1)
    whole = np.flatnonzero(lengths > 1e-3)
    normals = normals[whole] / lengths[whole, None]
    offsets = np.einsum("ij,ij->i", normals, corners_mm[whole, 0])
    _, facing = np.unique(normals.round(3) + 0.0, axis=0, return_inverse=True)
    order = np.lexsort((offsets, facing.ravel()))
    gaps = (np.diff(facing.ravel()[order]) != 0) | (np.diff(offsets[order]) > APART_MM)
    found = []
    for group in np.split(order, np.flatnonzero(gaps) + 1):
        axis = np.cross(normals[group[0]], (0.3, 0.5, 0.81))
        axes = np.stack([axis, np.cross(normals[group[0]], axis)], axis=1) / np.linalg.norm(axis)
        flat = (corners_mm[whole[group]] @ axes).astype(np.float32)
        low, high = flat.min(axis=1) + _SLACK_MM, flat.max(axis=1) - _SLACK_MM
        for one in range(len(group) - 1):
            rest = slice(one + 1, None)
            boxes_meet = (low[rest] < high[one]).all(axis=1) & (high[rest] > low[one]).all(axis=1)
            for other in one + 1 + np.flatnonzero(boxes_meet):
                area, _ = cv2.intersectConvexConvex(flat[one], flat[other])
                if area > LEAST_MM2:
                    found.append((int(whole[group[one]]), int(whole[group[other]])))
    return found


def corners(mesh):
    return mesh.positions_mm[mesh.triangles].astype(np.float64)


@pytest.fixture(scope="module")
def scenes():
    """A scene of each container kind, with seals of both kinds."""
    config = Config.from_values({"seals": {"probability": 1}})
    with Generator(config, seed=1, size=(64, 64), quality="draft") as generator:
        sampled = [generator.scene(index) for index in range(16)]
    assert {seal.kind for scene in sampled for seal in scene.seals} == {"bolt", "cable"}
    return {scene.container.kind: scene for scene in sampled}


@pytest.mark.parametrize("kind", ["20", "40HC"])
def test_no_parts_of_a_container_share_a_plane(kind, scenes):
    container = scenes[kind].container
    mesh = build_container(kind, container.profiles)
    assert overlaps(corners(mesh)) == []


@pytest.mark.parametrize("down", [(True, True), (True, False)])
@pytest.mark.parametrize("kind", ["20", "40HC"])
def test_no_members_of_a_spreader_share_a_plane(kind, down):
    assert overlaps(corners(build_spreader(kind, down, 15.0))) == []


def test_no_parts_of_seals_share_a_plane(scenes):
    for scene in scenes.values():
        assert overlaps(corners(scene_seals(scene).mesh)) == []


def test_overlaps_are_found():
    square = np.array([[(0, 0, 0), (9, 0, 0), (9, 9, 0)], [(0, 0, 0), (9, 9, 0), (0, 9, 0)]], float)
    assert overlaps(square) == []
    assert len(overlaps(np.concatenate([square, square + (3, 0, 0.1)]))) == 3
    assert overlaps(np.concatenate([square, square + (3, 0, 1)])) == []
    assert overlaps(np.concatenate([square, square[:, ::-1] + (3, 0, 0)])) == []
