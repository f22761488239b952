"""Fixtures shared by several test files."""

import shutil

import pytest


@pytest.fixture
def copy(dataset, tmp_path):
    """A copy of the dataset from the test file's `dataset` fixture, which the test may damage."""
    shutil.copytree(dataset, tmp_path / "out")
    return tmp_path / "out"
