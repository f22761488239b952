"""Fixtures shared by several test files."""

import json
import shutil
from collections import OrderedDict

import pytest

from fastgen import Config, Generator

OPEN_GENERATORS = 4
"""Generators that are kept open; each holds a GL context and its textures."""


@pytest.fixture
def copy(dataset, tmp_path):
    """A copy of the dataset from the test file's `dataset` fixture, which the test may damage."""
    shutil.copytree(dataset, tmp_path / "out")
    return tmp_path / "out"


@pytest.fixture(scope="session")
def generators():
    """A function that lends a Generator; tests with equal arguments share one and leave it open."""
    kept = OrderedDict()

    def lend(config=None, *arguments, **settings):
        plain = json.dumps((config or Config.preset()).to_plain())
        key = (plain, arguments, tuple(sorted(settings.items())))
        if key not in kept:
            if len(kept) == OPEN_GENERATORS:
                kept.popitem(last=False)[1].close()
            kept[key] = Generator(config, *arguments, **settings)
        kept.move_to_end(key)
        return kept[key]

    yield lend
    for generator in kept.values():
        generator.close()
