"""Worker processes: unexpected deaths, slow starts, thread counts and order of tasks."""

import contextlib
import os
import subprocess
import sys
import threading
import time
import tracemalloc
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from fastgen.dataset import workers
from fastgen.dataset.generate import generate, run_here
from fastgen.dataset.job import Job
from fastgen.render.settings import RenderSettings
from tests.crash_run import QuickMaker


class DiesAfterItsTask:
    """Worker that reports its task and exits 0.3 s later."""

    def __init__(self, _setup, report):
        self._report = report

    def __call__(self, task):
        self._report("images", task)
        threading.Timer(0.3, os._exit, (9,)).start()


class StartsSlowly:
    """Worker that starts slower than the limit for silence; reports that it is busy if `speaks`."""

    def __init__(self, speaks, report):
        for _ in range(24):
            time.sleep(0.25)
            if speaks:
                report("busy", None)

    def __call__(self, task):
        pass


class Reports:
    """Worker that reports each task as done."""

    def __init__(self, report):
        self._report = report

    def __call__(self, task):
        self._report("did", task)


class TellsItsThreads:
    """Worker that reports the number of threads that a product of matrices leaves."""

    def __init__(self, report):
        self._report = report

    def __call__(self, _task):
        import numpy as np

        square = np.ones((600, 600))
        _ = square @ square
        self._report("threads", len(os.listdir("/proc/self/task")) - threading.active_count())


class TellsItsVariable:
    """Worker that reports the environment variable FASTGEN_TEST."""

    def __init__(self, report):
        self._report = report

    def __call__(self, _task):
        self._report("variable", os.environ.get("FASTGEN_TEST"))


class TellsItsParent:
    """Worker that reports the process that it was forked from."""

    def __init__(self, report):
        self._report = report

    def __call__(self, _task):
        self._report("parent", os.getppid())


def heard_from(setup, count=1):
    """Return what each of `count` workers reports about one task."""
    heard = []

    def on_death(task, place, ended):
        raise AssertionError(ended)

    workers.run(setup, range(count), count, lambda _, value: heard.append(value), on_death)
    return heard


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core has no matrix threads")
@pytest.mark.parametrize(
    ("variables", "threads"),
    [({}, 0), ({"OPENBLAS_NUM_THREADS": "2"}, 1), ({"OMP_NUM_THREADS": "2"}, 1)],
)
def test_workers_start_no_matrix_threads_unless_the_user_asks_for_them(variables, threads):
    names = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS")
    others = {name: value for name, value in os.environ.items() if name not in names}
    # a process of its own, because the server of workers keeps its number of threads
    code = "from tests import test_workers as t; print(*t.heard_from(t.TellsItsThreads))"
    said = subprocess.run(
        [sys.executable, "-c", code], env={**others, **variables}, capture_output=True, check=True
    )
    assert int(said.stdout) == threads


FORKING = """
import os, sys, threading
from fastgen.dataset import workers
workers.fork_from_here()
from tests import test_workers as t
thread = threading.Thread(target=threading.Event().wait, daemon=True)
if "thread" in sys.argv:
    thread.start()
if "thread of a module" in sys.argv:
    workers.importlib.import_module = lambda _: thread.ident or thread.start()
print(t.heard_from(t.TellsItsParent, 2).count(os.getpid()))
"""


@pytest.mark.parametrize(
    ("arguments", "here"), [([], 2), (["thread"], 0), (["thread of a module"], 0)]
)
def test_a_command_without_threads_forks_workers_from_its_own_process(arguments, here):
    """The lock of a thread that a child lacks would stay locked."""
    names = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS")
    unset = {name: value for name, value in os.environ.items() if name not in names}
    said = subprocess.run(
        [sys.executable, "-c", FORKING, *arguments], env=unset, capture_output=True, check=True
    )
    assert int(said.stdout) == here


SCRIPT = """
from tests import test_workers
if __name__ == "__main__":
    print(*test_workers.heard_from(test_workers.TellsItsVariable))
"""


@pytest.mark.parametrize("temporary", ["short", "x" * 120])
def test_workers_start_beside_any_modules_and_temporary_folder(tmp_path, temporary):
    """Modules in the current folder do not replace installed ones, and the path of the folder for
    temporary files may be too long for a socket."""
    script, here = tmp_path / "scripts" / "run.py", tmp_path / "here"
    for folder in (script.parent, here, tmp_path / temporary):
        folder.mkdir()
    script.write_text(SCRIPT)
    for name in ("yaml", "cv2", "fastgen"):
        (here / f"{name}.py").write_text("raise RuntimeError('the wrong module')")
    paths = [str(Path(__file__).parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    variables = {
        "FASTGEN_TEST": "heard",
        "PYTHONPATH": os.pathsep.join(paths),
        "TMPDIR": str(tmp_path / temporary),
    }
    said = subprocess.run(
        [sys.executable, str(script)],
        cwd=here,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert (said.stdout, said.stderr) == ("heard\n", "")


def test_workers_have_the_environment_of_the_time_of_their_start(monkeypatch):
    for value in ("first", "second", None):
        if value is None:
            monkeypatch.delenv("FASTGEN_TEST")
        else:
            monkeypatch.setenv("FASTGEN_TEST", value)
        assert heard_from(TellsItsVariable) == [value]


@pytest.mark.parametrize("speaks", [True, False])
def test_a_slow_start_that_reports_busy_is_no_hang(speaks):
    ends = []

    def on_death(task, place, ended):
        ends.append(ended)
        raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        workers.run(partial(StartsSlowly, speaks), [1], 1, lambda *_: None, on_death, hang_s=3.0)
    assert ends == ([] if speaks else ["no sign of life for 3 s"])


@pytest.mark.parametrize("tasks", [[1], [1, 2, 3]])
def test_a_worker_that_dies_between_tasks_loses_none(tasks):
    heard = []

    def slow(_kind, value):
        heard.append(value)
        time.sleep(1.0)  # by the next read the worker has exited

    def on_death(task, place, ended):
        raise AssertionError(f"{task} at {place}: {ended}")

    workers.run(partial(DiesAfterItsTask, "setup"), tasks, 1, slow, on_death)
    assert heard == tasks


def test_tasks_are_fetched_only_when_a_worker_is_free():
    asked, done = [], []

    def tasks():
        for task in range(20):
            asked.append(task)
            yield task

    def hear(_kind, task):
        done.append(task)
        assert len(asked) <= len(done) + 2  # one task in progress per worker

    def on_death(task, place, ended):
        raise AssertionError(ended)

    workers.run(Reports, tasks(), 2, hear, on_death)
    assert sorted(done) == list(range(20))


def test_a_large_run_does_not_list_all_its_shards_in_advance(tmp_path):
    class Stopped(Exception):
        pass

    def first(job, tasks, on_report):
        assert next(iter(tasks)).shard == 0
        raise Stopped

    def peak(images, name):
        job = Job(str(tmp_path / name), images, cameras=("A",), render=RenderSettings((64, 64)))
        tracemalloc.start()
        with pytest.raises(Stopped):
            generate(job, 1, runner=first)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(4, "warm")
    assert peak(10**6, "large") < peak(4, "small") + 1e6


def test_a_task_put_back_comes_next_and_no_task_is_fetched_early():
    source = iter(range(1000))
    waiting = workers.Waiting(source)
    assert waiting.up_to(3) == 3
    assert waiting.take() == 0
    waiting.put_back("again")
    assert [waiting.take() for _ in range(3)] == ["again", 1, 2]
    assert next(source) == 3
    assert waiting.up_to(2000) == 996


@pytest.mark.parametrize(
    ("scenes", "count", "words"),
    [  # two scenes per shard
        (2, 2, "only 1 of 2 workers have work, because each shard has 2 scenes"),
        (3, 4, "only 2 of 4 workers"),
        (1, 2, ""),  # a single scene cannot be shared
        (3, 2, ""),
        (5, 4, ""),  # one of four workers would make two scenes anyway
    ],
)
def test_idle_workers_are_reported(tmp_path, monkeypatch, capsys, scenes, count, words):
    monkeypatch.setattr("fastgen.dataset.generate.run_here", partial(run_here, maker=QuickMaker))
    small = RenderSettings((64, 64))
    job = Job(str(tmp_path / "out"), scenes, cameras=("A",), render=small, shard_scenes=2)
    generate(job, count)
    said = [line for line in capsys.readouterr().err.splitlines() if "workers have" in line]
    assert len(said) == bool(words)
    for line in said:
        assert line.startswith(f"fastgen: {words}")
        assert line.endswith("use --shard 1 in another folder to share it")
    generate(replace(job, images=scenes + 2), count)
    assert "workers have work" not in capsys.readouterr().err  # existing shards keep their size
