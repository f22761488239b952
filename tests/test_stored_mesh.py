"""Meshes from the disk cache equal the computed ones."""

from dataclasses import fields, replace

import numpy as np
import pytest

from fastgen.files import disk_cache
from fastgen.geometry.container import build_container
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.stored_mesh import stored


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(disk_cache, "default_folder", lambda: tmp_path / "cache")
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def built() -> Mesh:
    return build_container("20")


def never():
    raise AssertionError("the cached mesh was built again")


def assert_equal(found: Mesh, wanted: Mesh) -> None:
    for each in fields(Mesh):
        one, other = (getattr(mesh, each.name) for mesh in (found, wanted))
        if isinstance(other, np.ndarray):
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)
            assert not one.flags.writeable
        else:
            assert one == other


def test_a_cached_mesh_equals_the_built_one(folder, built):
    stored("box", 1, ("20", 1.5), lambda: built)
    found = stored("box", 1, ("20", 1.5), never)
    assert_equal(found, built)
    # the hull spans the same points, in any order
    away = found.points_mm @ np.random.default_rng(1).normal(size=(3, 200))
    np.testing.assert_array_equal(away[found.hull].max(axis=0), away.max(axis=0))


def test_other_inputs_versions_or_libraries_rebuild_the_mesh(folder, built, monkeypatch):
    moved = replace(built, positions_mm=built.positions_mm + np.float32(1))
    stored("box", 1, ("20", 1.5), lambda: built)
    assert_equal(stored("box", 1, ("20", 2.5), lambda: moved), moved)
    assert_equal(stored("box", 2, ("20", 1.5), lambda: moved), moved)
    monkeypatch.setattr(disk_cache, "_LIBRARIES", ("99",))
    assert_equal(stored("box", 1, ("20", 1.5), lambda: moved), moved)


def test_an_unusable_cache_folder_is_no_error(tmp_path, monkeypatch, built):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setattr(disk_cache, "default_folder", lambda: tmp_path / "file" / "cache")
    assert_equal(stored("box", 1, 1, lambda: built), built)
