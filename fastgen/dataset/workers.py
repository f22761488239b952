"""Processes that work on tasks and are replaced if they crash or hang.

Each process has its own pipe. A shared queue has a lock, which stays locked if its holder dies.

Workers are forked from a process that has imported the package, so they start at once and share
the memory of its modules. That process must have no other threads and no OpenGL context; otherwise
a child may hang. It is the process of the command itself, or for programs that call fastgen a
server process.
"""

import contextlib
import importlib
import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkContext, ForkServerContext, SpawnContext
from pathlib import Path
from typing import Any

from fastgen.errors import FastgenError, OutputError

Setup = Callable[[Callable[[str, Any], None]], Callable[[Any], None]]
"""Called in the worker with a report function; returns the function that does a task."""

HANG_S = 300.0
"""A worker without a report for this many seconds hangs. Known steps take at most 3 s."""

_NAME = "fastgen worker"
"""Name of every worker process."""

_UNGUARDED = 78
"""Exit code of a worker whose main script starts a run when it is imported."""

_POLL_S = 1.0
_STOPS = {signal.SIGINT, signal.SIGTERM}

_MATRIX_THREADS = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS")
"""Variables with the number of OpenBLAS threads; the first that is set counts.

OpenBLAS reads them when NumPy is imported, which is before any of our code runs in a new process.
"""

_WARM_START = "fastgen.dataset.warm_start"
"""Module that is imported before workers are forked."""

_forking_pid: int | None = None
"""Process that workers may be forked from; see `fork_from_here`."""


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Delay SIGINT and SIGTERM until the end of the block.

    A process interrupted during its start prints a traceback. A signal mask is not enough: the
    system may deliver a signal to any thread, and Python runs the handler in the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # handlers run in the main thread only
        return
    held: list[int] = []
    before = {each: signal.signal(each, lambda number, _: held.append(number)) for each in _STOPS}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, signal.SIG_DFL if handler is None else handler)
        if held:
            signal.raise_signal(held[0])


@contextlib.contextmanager
def _set_variables(values: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for processes that are started in the block."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _one_matrix_thread() -> dict[str, str]:
    """Return the variable that gives OpenBLAS one thread, unless the user has set a number.

    Further threads spin while they wait, on the cores of other workers, and do not survive a fork.
    """
    set_by_user = any(name in os.environ for name in _MATRIX_THREADS)
    return {} if set_by_user else {_MATRIX_THREADS[0]: "1"}


@contextlib.contextmanager
def _started_quietly() -> Iterator[None]:
    """Keep Ctrl-C away from processes that are started in the block, until they are ready.

    It reaches the whole process group, but the parent decides what happens. Children inherit the
    signal mask.
    """
    with undisturbed(), _set_variables(_one_matrix_thread()):
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_server() -> bool:
    """Start the process that workers are forked from, unless it runs. Does not wait for it.

    It searches modules where this process does, and not in the current folder first, as
    `python -c` would (Python's documentation of PYTHONSAFEPATH).

    Returns:
        False if it cannot have a socket, because the path of the folder for temporary files is
        longer than about 75 characters or cannot be written.
    """
    paths = os.pathsep.join(os.path.abspath(path) for path in sys.path)
    resource_tracker.ensure_running()  # its start would lift the signal mask of `_started_quietly`
    with _started_quietly(), _set_variables({"PYTHONSAFEPATH": "1", "PYTHONPATH": paths}):
        forkserver.set_forkserver_preload([_WARM_START])
        try:
            forkserver.ensure_running()
        except OSError:
            return False
    return True


def fork_from_here() -> None:
    """Let workers be forked from this process, which saves a server and its imports.

    Call this before NumPy is imported. The process must not open OpenGL.
    """
    global _forking_pid
    os.environ.update(_one_matrix_thread())
    _forking_pid = os.getpid()


def _has_one_thread() -> bool:
    """Return True if this process certainly has no other threads."""
    # clients of object stores start threads; only Linux has this folder
    tasks = Path("/proc/self/task")
    return tasks.is_dir() and len(list(tasks.iterdir())) == 1


def _context() -> ForkContext | ForkServerContext | SpawnContext:
    """Return how a worker starts."""
    if os.getpid() == _forking_pid and _has_one_thread():
        importlib.import_module(_WARM_START)
        if _has_one_thread():  # an imported module may have started threads
            return multiprocessing.get_context("fork")
    if start_server():
        return multiprocessing.get_context("forkserver")
    return multiprocessing.get_context("spawn")


class Waiting:
    """Queue of tasks that takes them from an iterable only when needed: there may be millions."""

    def __init__(self, tasks: Iterable[Any]) -> None:
        self._rest = iter(tasks)
        self._ahead: deque[Any] = deque()

    def __bool__(self) -> bool:
        return self.up_to(1) > 0

    def up_to(self, count: int) -> int:
        """Return the number of tasks left, or `count` if there are more."""
        self._ahead.extend(islice(self._rest, max(count - len(self._ahead), 0)))
        return min(len(self._ahead), count)

    def take(self) -> Any:
        """Return the next task. There must be one."""
        self.up_to(1)
        return self._ahead.popleft()

    def put_back(self, task: Any) -> None:
        """Put a task at the front."""
        self._ahead.appendleft(task)


class _Worker:
    """One process, its current task, and the time of its last report."""

    def __init__(self, setup: Setup) -> None:
        context = _context()
        self.pipe, theirs = context.Pipe()
        forked = context.get_start_method() == "fork"
        arguments = theirs, setup, dict(os.environ), forked
        self.process = context.Process(target=_work, args=arguments, name=_NAME, daemon=True)
        with _started_quietly():
            self.process.start()
        theirs.close()
        self.task: Any = None
        self.place: Any = None
        self.heard = time.monotonic()

    def give(self, task: Any) -> None:
        self.task, self.place = task, None
        self.heard = time.monotonic()
        # a worker that has died is noticed when its pipe is read
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.pipe.send(task)

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def end_unguarded_worker() -> None:
    """End this process if it is a worker. A run calls this before it starts workers of its own.

    A process that was spawned, or forked from the server, imports the main script. Without a guard,
    the script would start a run in each worker.
    """
    if multiprocessing.current_process().name == _NAME:
        os._exit(_UNGUARDED)  # a forked process turns SystemExit into exit code 1


def run(
    setup: Setup,
    tasks: Iterable[Any],
    count: int,
    on_report: Callable[[str, Any], None],
    on_death: Callable[[Any, Any, str], Any],
    hang_s: float = HANG_S,
) -> None:
    """Let `count` processes do all tasks. No worker outlives the call.

    Args:
        setup: Called in each process; it must be picklable.
        tasks: Taken one at a time, when a process is free.
        count: Number of processes.
        on_report: Called with the kind and value of each report, except "at", whose value names
            the place a task has reached.
        on_death: Called with the task of a worker that crashed or hung, its place, and how it
            ended. Returns the task to try instead, or raises.
        hang_s: Seconds without a report after which a worker is replaced.

    Raises:
        OutputError: A worker met an error that another attempt cannot fix, in its words; or the
            main script starts a run when it is imported.
    """
    waiting = Waiting(tasks)
    workers: list[_Worker] = []
    try:
        while waiting and len(workers) < count:
            workers.append(_Worker(setup))
            workers[-1].give(waiting.take())
        while busy := [worker for worker in workers if worker.task is not None]:
            wait([worker.pipe for worker in busy], timeout=_POLL_S)
            for worker in busy:
                ended = _listen(worker, on_report, hang_s)
                if ended:
                    if worker.task is not None:  # otherwise it had finished its task
                        waiting.put_back(on_death(worker.task, worker.place, ended))
                    worker.stop()
                    workers.remove(worker)
                    if not waiting:
                        continue
                    worker = _Worker(setup)
                    workers.append(worker)
                if worker.task is None and waiting:
                    worker.give(waiting.take())
    finally:
        for worker in workers:
            worker.stop()


def _listen(worker: _Worker, on_report: Callable[[str, Any], None], hang_s: float) -> str:
    """Handle a worker's reports. Return how it ended, or '' if it is alive."""
    try:
        while worker.pipe.poll():
            kind, value = worker.pipe.recv()
            worker.heard = time.monotonic()
            if kind == "failed":
                raise OutputError(value)
            if kind == "done":
                worker.task = None
            elif kind == "at":
                worker.place = value
            else:
                on_report(kind, value)
    except (EOFError, ConnectionResetError):
        worker.process.join()
        code = worker.process.exitcode or 0
        if code == _UNGUARDED:
            raise OutputError(
                "generate: worker processes import your script, which calls generate again; move "
                'the call under `if __name__ == "__main__":`'
            ) from None
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"
    if worker.task is not None and time.monotonic() - worker.heard > hang_s:
        return f"no sign of life for {hang_s:g} s"
    return ""


def in_words(error: Exception, place: str) -> str:
    """Describe an error that stops a run. `place` says where it happened, for internal errors."""
    if isinstance(error, FastgenError | OSError):
        return str(error)
    if isinstance(error, MemoryError):
        return f"{place}: out of memory; use fewer workers or a smaller size"
    traceback.print_exception(error)
    return f"{place}: {error!r} (this is a bug in fastgen: please report it)"


def _work(pipe: Connection, setup: Setup, environment: Mapping[str, str], forked: bool) -> None:
    """Main function of a worker: do tasks from the pipe until the parent kills it or exits.

    Args:
        pipe: Receives tasks and sends reports.
        setup: Returns the function that does a task.
        environment: Environment variables of the parent.
        forked: True if this process was forked from the parent, not from the server.
    """
    os.environ.clear()  # the server may have started with other variables
    os.environ.update(environment)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # a forked worker has the handler of the command
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _STOPS)
    threading.Thread(target=_end_with_parent, args=(forked,), daemon=True).start()
    place = "start"

    def send(kind: str, value: Any) -> None:
        with _gone_with_parent():
            pipe.send((kind, value))

    def report(kind: str, value: Any) -> None:
        nonlocal place
        if kind == "at":
            place = f"scene {value}"
        send(kind, value)

    try:
        work = setup(report)
        while True:
            with _gone_with_parent():
                task = pipe.recv()
            work(task)
            send("done", None)
    except Exception as error:
        send("failed", in_words(error, place))


@contextlib.contextmanager
def _gone_with_parent() -> Iterator[None]:
    """Exit if the pipe has no other end, because then nobody can receive an error."""
    try:
        yield
    except (EOFError, BrokenPipeError, ConnectionResetError):
        os._exit(1)


def _end_with_parent(forked: bool) -> None:
    """Exit when the parent dies: at once, or within _POLL_S if later workers are still running.

    Workers that are forked later inherit the parent's end of the pipe that reports its death, so
    the pipe stays open until they have exited too. One of them may hang.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None
    while parent.is_alive() and not (forked and os.getppid() != parent.pid):
        parent.join(_POLL_S)
    os._exit(1)
