"""The shape library, and the geometry that the cameras of a scene share."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.errors import ConfigError
from fastgen.geometry.container import build_container, container_outline
from fastgen.geometry.facets import in_fours, mesh_facets
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.geometry.shape_library import CONTAINER_SHAPES, ShapeLibrary
from fastgen.geometry.spreader import build_spreader, tier_bounds_mm
from fastgen.scene.container_kinds import WallProfiles


def same(one, other):
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("positions_mm", "normals", "atlas_mm", "zone", "triangles")
    )


def test_equal_shapes_are_one_object():
    shapes = ShapeLibrary()
    assert shapes.container("20") is shapes.container("20", WallProfiles())
    assert shapes.container_outline("20") is shapes.container_outline("20")
    assert shapes.spreader("20", (True, False), 20.0) is shapes.spreader("20", (True, False), 20.0)
    assert shapes.container("20") is not ShapeLibrary().container("20")


def test_shapes_equal_newly_built_meshes():
    shapes = ShapeLibrary()
    assert same(shapes.container("20"), build_container("20"))
    assert same(shapes.container_outline("20"), container_outline("20"))
    shape = shapes.spreader("40", (False, True), 30.0)
    assert same(shape.mesh, build_spreader("40", (False, True), 30.0))
    assert same(shape.outline, build_spreader("40", (False, True), 30.0, np.inf))


def test_the_least_recently_used_shape_is_dropped_when_the_library_is_full(monkeypatch):
    loaded = []
    monkeypatch.setattr(
        "fastgen.geometry.shape_library.build_container", lambda *shape: loaded.append(shape)
    )
    shapes = ShapeLibrary()
    for profiles in range(CONTAINER_SHAPES + 1):
        shapes.container("20", profiles)
    shapes.container("20", 1)
    assert len(loaded) == CONTAINER_SHAPES + 1
    shapes.container("20", 0)
    assert len(loaded) == CONTAINER_SHAPES + 2


def test_derived_geometry_of_a_spreader_equals_that_of_its_meshes():
    shape = ShapeLibrary().spreader("40", (True, True), 20.0)
    expected = in_fours(mesh_facets(shape.outline))
    assert np.array_equal(shape.facets(lens=False).points_mm, expected.points_mm)
    assert np.array_equal(shape.facets(lens=False).corners, expected.corners)
    assert shape.drawn(lens=False) is shape.mesh
    assert len(shape.drawn(lens=True).triangles) > len(shape.mesh.triangles)
    # the renderer uses the same bounds with and without a lens
    for mesh in (shape.mesh, shape.drawn(lens=True)):
        assert np.array_equal(shape.tier_bounds_mm, tier_bounds_mm(mesh))
    assert len(shape.solid.triangles) < len(shape.outline.triangles)  # without cables


@pytest.mark.parametrize(
    ("shape", "message"),
    [(("41", (True, True)), "41"), (("20", (True, True), 900.0), "gap_mm: 900")],
)
def test_shapes_that_cannot_be_built_are_refused(shape, message):
    with pytest.raises(ConfigError, match=message):
        ShapeLibrary().spreader(*shape)


def test_the_cameras_of_a_scene_share_its_geometry(monkeypatch):
    config = Config.from_values({"damage": {"probability": 1.0}, "spreader": {"probability": 1}})
    made, create = [], PreparedScene.__init__

    def counted(self, *arguments):
        create(self, *arguments)
        made.append(self)

    monkeypatch.setattr(PreparedScene, "__init__", counted)
    with Generator(config, seed=3, size=(64, 64), quality="draft") as generator:
        for camera in ("A", "B", "Cl"):
            generator.render(0, camera)
        assert len(made) == 1
        own = replace(generator.scene(0), decals=())
        for camera in ("A", "B"):
            generator.render(scene=own, camera=camera)
        assert len(made) == 2
        generator.render(0, "Cr")
        assert len(made) == 2


def test_a_scene_without_spreader_and_decals_has_no_geometry_of_them():
    config = Config.from_values({"spreader": {"probability": 0}})
    prepared = PreparedScene(replace(Generator(config).scene(0), decals=()))
    assert prepared.spreader is None
    assert prepared.usual_spreader is None
    assert prepared.decals.outlines_mm.shape == (0, 0, 3)
    assert prepared.decals.facets.corners.shape == (0, 3)
