"""Surface facets and decal outlines compared with brute force and `sheet_to_surface`."""

import dataclasses

import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.geometry import damage_law
from fastgen.geometry.decal_facets import DecalSurface
from fastgen.geometry.decal_outlines import Outlines
from fastgen.geometry.facets import Facets, clip, in_fours
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Decal
from tests import oracle


@pytest.fixture(scope="module")
def scenes():
    """Damaged scenes."""
    generator = Generator(Config.from_values({"damage": {"probability": 1.0}}), seed=31)
    return [PreparedScene(generator.scene(index)) for index in range(4)]


def test_clipping_halves_a_square():
    square = np.array([[[0.0, 0], [2, 0], [2, 2], [0, 2]]])
    half, left = clip(square, square[..., 0] - 1.5)
    assert left.all()
    assert half.shape == (1, 4, 2)
    assert {tuple(p) for p in half[0]} == {(1.5, 0), (2, 0), (2, 2), (1.5, 2)}
    none, left = clip(square, square[..., 0] - 3)
    assert len(none) == 0
    assert not left.any()


def test_two_triangles_of_a_flat_convex_quad_become_one_polygon():
    square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    bent = square + [5.0, 0, 0]
    bent[3, 2] = 1
    dart = np.array([[0.0, 9, 0], [4, 9, 0], [1, 10, 0], [0, 13, 0]])
    triangles = [
        *(square[[0, 1, 2]], square[[0, 2, 3]]),  # the fourth corner comes last
        *(square[[0, 1, 2]] + 20, square[[3, 0, 2]] + 20),  # here it comes first
        *(bent[[0, 1, 2]], bent[[0, 2, 3]]),
        *(dart[[0, 1, 2]], dart[[0, 2, 3]]),
        *(square[[0, 1, 2]] + 40, square[[0, 2, 3]] + 60),
        square[[0, 1, 2]] + 80,
    ]
    corners = np.array(triangles)
    facets = Facets.of(np.concatenate([corners, 2 * corners], axis=2), np.full(len(corners), 3))
    made = in_fours(facets)
    polygons = made.points_mm[made.corners]
    assert (made.rest_mm == 2 * made.points_mm).all()
    assert (made.owner == 3).all()
    assert len(polygons) == 2 + 7
    assert (polygons[:2] == [square, square + 20]).all()
    assert (polygons[2:, :3] == corners[4:]).all()
    assert (polygons[2:, 3] == corners[4:, 2]).all()


def test_facets_store_each_corner_once_and_are_cut_with_their_rest_positions():
    square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    triangle = square[[0, 1, 2, 2]]  # its last corner repeats
    polygons = np.array([square, triangle + 5, triangle + 9])
    facets = Facets.of(np.concatenate([polygons, -polygons], axis=2), np.array([0, 0, 2]))
    assert (facets.points_mm[facets.corners] == polygons).all()
    assert (facets.rest_mm == -facets.points_mm).all()
    assert facets.owner.tolist() == [0] * 7 + [2] * 3
    left = facets.beyond(facets.points_mm[:, 0] - 6)
    assert left.points_mm[:, 0].min() == 6
    assert (left.rest_mm == -left.points_mm).all()
    assert left.owner.tolist() == [0] * 4 + [2] * 3


@pytest.mark.parametrize("turned_deg", [0.0, 17.0])
def test_outlines_of_decals_lie_on_the_surface(scenes, turned_deg):
    for prepared in scenes:
        scene, mesh = prepared.scene, prepared.container
        decals = [decal for decal in scene.decals if decal.class_name]
        decals = [
            dataclasses.replace(decal, rotation_deg=decal.rotation_deg + turned_deg)
            for decal in decals
        ]
        turned = dataclasses.replace(scene, decals=tuple(decals))
        found = DecalSurface(turned, mesh).outlines_mm
        edges = Outlines.of(decals).points_mm()
        assert len(edges) > 0
        for decal, edge, around in zip(decals, edges, found, strict=True):
            *_, width, height = mesh.charts[mesh.chart_index(decal.face)].rect_mm
            if (edge < 0).any() or (edge > (width, height)).any():
                continue  # tests/test_decals_at_borders.py covers clipped outlines
            away = edge - decal.center_mm
            assert oracle.inside(decal, decal.center_mm + away * 0.999).all()
            assert not oracle.inside(decal, decal.center_mm + away * 1.001).any()
            rest, _ = mesh.sheet_to_surface(decal.face, edge)
            np.testing.assert_allclose(around, damage_law.deform(scene.damages, rest), atol=1e-6)


def test_sides_and_reach_of_outlines_equal_brute_force():
    rng = np.random.default_rng(5)
    decals = [
        Decal(kind, "text", "front", (40.0, -7.0), tuple(rng.uniform(5, 50, 2)), angle)
        for kind in ("marker", "text")
        for angle in rng.uniform(-180, 180, 10)
    ]
    outlines = Outlines.of(decals)
    normals, offsets = outlines.half_planes()
    points = rng.uniform(-60, 60, (3000, 2)) + (40, -7)
    for decal, normal, offset, edge, reach in zip(
        decals, normals, offsets, outlines.points_mm(), outlines.reach_mm(), strict=True
    ):
        inside = (points @ normal.T + offset >= 0).all(axis=1)
        assert (inside == oracle.inside(decal, points)).all()
        np.testing.assert_allclose(reach, np.abs(edge - decal.center_mm).max(axis=0))


def test_container_points_include_the_outermost_in_every_direction(scenes):
    directions = np.random.default_rng(7).normal(size=(200, 3))
    for prepared in scenes:
        everything = damage_law.deform(prepared.scene.damages, prepared.container.positions_mm)
        kept = prepared.hull_points_mm
        assert len(kept) < len(everything) / 4
        farthest = (everything @ directions.T).max(axis=0)
        np.testing.assert_allclose((kept @ directions.T).max(axis=0), farthest, atol=1e-9)
