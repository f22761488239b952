"""Fixtures that test files share."""

import shutil

import pytest


@pytest.fixture
def copy(dataset, tmp_path):
    """A copy, to be spoilt, of the dataset that a test file's own fixture `dataset` made."""
    shutil.copytree(dataset, tmp_path / "out")
    return tmp_path / "out"
