"""Processes that work on tasks, may crash or hang, and are then replaced.

Each has a pipe of its own: a queue's lock dies with the process that holds it.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from fastgen.errors import FastgenError, OutputError

Setup = Callable[..., Callable[[Any], None]]
"""Called in the worker with its arguments and a `report` function; returns what does a task."""

HANG_S = 300.0
"""A worker that has said nothing for so long hangs; the slowest step known takes a hundredth."""

_POLL_S = 1.0
_STOPS = {signal.SIGINT, signal.SIGTERM}

_MATRIX_THREADS = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS")
"""OpenBLAS takes the first of these that is set when NumPy is imported, which is before any code of
ours runs in a process that starts."""


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Stops that come meanwhile wait until the end: a process left half started says so loudly.

    A mask does not keep them off. The system may give a signal to any thread, a matrix library's
    too, and Python then runs its handler in the main one.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # no handler runs here
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
def _one_matrix_thread() -> Iterator[None]:
    """Processes that start meanwhile multiply matrices in one thread, unless the user has set how
    many. More of them spin while they wait, and take the cores of other workers."""
    set_by_user = any(name in os.environ for name in _MATRIX_THREADS)
    if not set_by_user:
        os.environ[_MATRIX_THREADS[0]] = "1"
    try:
        yield
    finally:
        if not set_by_user:
            os.environ.pop(_MATRIX_THREADS[0], None)


class Waiting:
    """Tasks that wait to be done, taken from where they come from only as they are looked for: of a
    large run there are millions."""

    def __init__(self, tasks: Iterable[Any]) -> None:
        self._rest = iter(tasks)
        self._ahead: deque[Any] = deque()

    def __bool__(self) -> bool:
        return self.up_to(1) > 0

    def up_to(self, count: int) -> int:
        """How many there are, of which no more than `count` are looked for."""
        self._ahead.extend(islice(self._rest, max(count - len(self._ahead), 0)))
        return min(len(self._ahead), count)

    def take(self) -> Any:
        """The next one; there must be one."""
        self.up_to(1)
        return self._ahead.popleft()

    def put_back(self, task: Any) -> None:
        """Have this one done next."""
        self._ahead.appendleft(task)


class _Worker:
    """One process, what it is at and when it last said something."""

    def __init__(self, setup: Setup, arguments: tuple[Any, ...], whole_machine: bool) -> None:
        # a context made before a fork hangs its children, so processes start afresh
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, setup, arguments), daemon=True)
        # a signal may reach the whole group, and the parent decides: a worker that is not ready
        # yet takes this mask over and stays quiet. The tracker's own start would lift the mask
        resource_tracker.ensure_running()
        with undisturbed(), _one_matrix_thread() if whole_machine else contextlib.nullcontext():
            before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
            try:
                self.process.start()
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()
        self.task: Any = None
        self.place: Any = None
        self.heard = time.monotonic()

    def give(self, task: Any) -> None:
        self.task, self.place = task, None
        self.heard = time.monotonic()
        # one that has died meanwhile is found out when it is listened to
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.pipe.send(task)

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def run(
    setup: Setup,
    arguments: tuple[Any, ...],
    tasks: Iterable[Any],
    count: int,
    on_report: Callable[[str, Any], None],
    on_death: Callable[[Any, Any, str], Any],
    hang_s: float = HANG_S,
    whole_machine: bool = False,
) -> None:
    """Have `count` processes do all tasks, each of which is asked for when a process is free.

    on_report: gets what workers report, but for 'at', which names the place that a task is at.
    on_death: gets the task of a worker that crashed or hung, its place and how it ended; returns
    the task to try instead, or raises. whole_machine: there is a process on every core, so that
    matrices need no threads. Raises OutputError with a worker's own words where it met an error
    that no repetition mends. No process outlives the call.
    """
    waiting = Waiting(tasks)
    workers: list[_Worker] = []
    try:
        while waiting and len(workers) < count:
            workers.append(_Worker(setup, arguments, whole_machine))
            workers[-1].give(waiting.take())
        while busy := [worker for worker in workers if worker.task is not None]:
            wait([worker.pipe for worker in busy], timeout=_POLL_S)
            for worker in busy:
                ended = _listen(worker, on_report, hang_s)
                if ended:
                    if worker.task is not None:  # else it had just done its task
                        waiting.put_back(on_death(worker.task, worker.place, ended))
                    worker.stop()
                    workers.remove(worker)
                    if not waiting:
                        continue
                    worker = _Worker(setup, arguments, whole_machine)
                    workers.append(worker)
                if worker.task is None and waiting:
                    worker.give(waiting.take())
    finally:
        for worker in workers:
            worker.stop()


def _listen(worker: _Worker, on_report: Callable[[str, Any], None], hang_s: float) -> str:
    """Hear a worker out; how it ended, or '' while it lives."""
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
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"
    if worker.task is not None and time.monotonic() - worker.heard > hang_s:
        return f"no sign of life for {hang_s:g} s"
    return ""


def in_words(error: Exception, place: str) -> str:
    """What stops a run, for its user. place: where it happened, for mistakes of ours."""
    if isinstance(error, FastgenError | OSError):
        return str(error)
    if isinstance(error, MemoryError):
        return f"{place}: out of memory; give fewer workers or a smaller size"
    traceback.print_exception(error)
    return f"{place}: {error!r} (our mistake: please report it)"


def _work(pipe: Connection, setup: Setup, arguments: tuple[Any, ...]) -> None:
    """One worker process: tasks from the pipe until the parent ends it, or is no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _STOPS)
    threading.Thread(target=_end_with_parent, daemon=True).start()
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
        work = setup(*arguments, report)
        while True:
            with _gone_with_parent():
                task = pipe.recv()
            work(task)
            send("done", None)
    except Exception as error:
        send("failed", in_words(error, place))


@contextlib.contextmanager
def _gone_with_parent() -> Iterator[None]:
    """End this process where its pipe turns out to have no other end: nobody is left to tell."""
    try:
        yield
    except (EOFError, BrokenPipeError, ConnectionResetError):
        os._exit(1)


def _end_with_parent() -> None:
    """End this process where it stands once its parent has died, as a kill of both would."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
