"""Fixtures shared by several test files."""

import json
import os
import shutil
from collections import OrderedDict

import pytest

from fastgen import Config, Generator
from fastgen.dataset.console import LOGGER
from tests import in_process
from tests.report_makers import make_dataset

# Tests compile many programs and draw little with each. Mesa then needs a third less time without
# LLVM's optimization passes, which do not change results. GALLIVM_PERF= keeps them.
os.environ.setdefault("GALLIVM_PERF", "nopt")

OPEN_GENERATORS = 4
"""Generators that are kept open; each holds a GL context and its textures."""

LONGEST = (
    "test_damage_sampling.py",
    "test_hostile_paths.py",
    "test_config.py",
    "test_giveaways.py",
    "test_damage.py",
    "test_examples.py",
    "test_storage.py",
    "test_stopping.py",
    "test_sky_visibility.py",
    "test_extensions.py",
    "test_export.py",
    "test_renderer.py",
    "test_coverage.py",
    "test_generate.py",
    "test_light_points.py",
    "test_indirect_light.py",
    "test_placement.py",
    "test_wear.py",
    "test_marks.py",
    "test_limits.py",
)
"""Files that take longest. One that started last would run on while the other workers idle."""


def pytest_collection_modifyitems(items):
    """Put the longest files first; pytest-xdist hands out files in this order."""
    places = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path.name, len(LONGEST)))


@pytest.fixture(autouse=True)
def log_handlers():
    """Take back the handlers of a Maker that a test runs in this process."""
    handlers, level = LOGGER.handlers, LOGGER.level
    yield
    LOGGER.handlers = handlers
    LOGGER.setLevel(level)


@pytest.fixture
def copy(dataset, tmp_path):
    """A copy of the dataset from the test file's `dataset` fixture, which the test may damage."""
    shutil.copytree(dataset, tmp_path / "out")
    return tmp_path / "out"


@pytest.fixture(scope="module")
def no_workers():
    """Datasets of the test file are made without worker processes, see in_process.py."""
    with in_process.no_workers():
        yield


@pytest.fixture(scope="session")
def report_dataset(tmp_path_factory):
    """The dataset of the report's tests, which they only read."""
    with in_process.no_workers():
        return make_dataset(tmp_path_factory.mktemp("report") / "out")


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
