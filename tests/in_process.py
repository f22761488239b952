"""Datasets made in the process of the tests, which saves the start of worker processes."""

import contextlib
from collections.abc import Iterator
from functools import partial

import pytest

from fastgen.dataset import workers
from fastgen.dataset.console import LOGGER
from fastgen.errors import OutputError


@contextlib.contextmanager
def no_workers() -> Iterator[None]:
    """Let `generate` make all shards in this process, one after another.

    The files are the same. Crashes of workers are not handled, so tests of them do without this.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "run", _run)
        yield


def _run(setup, tasks, _count, on_report, *_, **__):
    """Stand in for `workers.run`."""
    place = "start"

    def report(kind, value):
        nonlocal place
        if kind == "at":
            place = f"scene {value}"
        else:
            on_report(kind, value)

    make, handlers, level = None, LOGGER.handlers, LOGGER.level
    try:
        # the settings for a process on every core would last as long as this process
        make = partial(setup.func, setup.args[0], False)(report)
        for task in tasks:
            make(task)
    except Exception as error:
        raise OutputError(workers.in_words(error, place)) from None
    finally:
        LOGGER.handlers = handlers
        LOGGER.setLevel(level)
        if make is not None:
            make._generator.close()
