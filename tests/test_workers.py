"""Worker processes that end when nobody expects it."""

import contextlib
import os
import threading
import time

import pytest

from fastgen.dataset import workers


class DiesAfterItsTask:
    """Reports, does its task, and ends a little later."""

    def __init__(self, _setup, report):
        self._report = report

    def __call__(self, task):
        self._report("images", task)
        threading.Timer(0.3, os._exit, (9,)).start()


class StartsSlowly:
    """Takes longer to begin than a worker may be silent; speaks up meanwhile, or does not."""

    def __init__(self, speaks, report):
        for _ in range(24):
            time.sleep(0.25)
            if speaks:
                report("busy", None)

    def __call__(self, task):
        pass


@pytest.mark.parametrize("speaks", [True, False])
def test_a_slow_start_is_no_hang_where_it_says_so(speaks):
    ends = []

    def on_death(task, place, ended):
        ends.append(ended)
        raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        workers.run(StartsSlowly, (speaks,), [1], 1, lambda *_: None, on_death, hang_s=3.0)
    assert ends == ([] if speaks else ["no sign of life for 3 s"])


@pytest.mark.parametrize("tasks", [[1], [1, 2, 3]])
def test_a_worker_that_dies_between_tasks_costs_none(tasks):
    heard = []

    def slow(_kind, value):
        heard.append(value)
        time.sleep(1.0)  # its end is there when it is listened to again

    def on_death(task, place, ended):
        raise AssertionError(f"{task} at {place}: {ended}")

    workers.run(DiesAfterItsTask, ("setup",), tasks, 1, slow, on_death)
    assert heard == tasks
