"""Shards made by actors of a Ray cluster, one a CPU; actors and nodes may die at any moment.

An actor tells the board, an actor beside the driver, which scene it turns to before it does, so
that the scene which ended an actor is known after its death. Files go straight from the actors to
job.out; Ray carries shard numbers and reports alone.
"""

import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import fastgen
from fastgen.dataset.dataset_json import MANIFEST
from fastgen.dataset.generate import Runner
from fastgen.dataset.seal import digest
from fastgen.dataset.shards import ATTEMPTS, Job, Maker, Strikes, Task
from fastgen.dataset.storage import storage_of
from fastgen.dataset.workers import HANG_S, Waiting, in_words
from fastgen.errors import OutputError

Reports = list[tuple[str, Any]]
"""What a maker reports, in order: see shards.Report."""

_POLL_S = 1.0
_CONNECT_S = 10.0
_STORE_BYTES = 80 * 2**20
"""Ray's object store, which holds nothing of ours, at about the smallest that it takes."""


def run_on_ray(
    address: str | None,
    count: int | None = None,
    hang_s: float = HANG_S,
    maker: Callable[..., Callable[[Task], None]] = Maker,
) -> Runner:
    """A runner on a Ray cluster.

    address: 'auto' or 'host:port' of a running cluster; None starts Ray on this machine, for as
    long as the run takes. A process that has joined a cluster already stays with it.
    count: how many actors at most; None for one on each CPU, also of nodes that come later.
    hang_s: an actor that has said nothing for so long is replaced.
    maker: called in the actor with the job, whether all cores are in use, and a report function.

    Raises OutputError where Ray is not installed. The runner raises it where no cluster answers, a
    node has another fastgen or does not see job.out, and with an actor's own words where it met an
    error that no repetition mends.
    """
    _ray()

    def run(job: Job, tasks: Iterable[Task], on_report: Callable[[str, Any], None]) -> None:
        ray = _ray()
        own = _joined(address, count)
        try:
            crew = _Crew(_everywhere(job), tasks, on_report, count, hang_s, maker)
            try:
                crew.work()
            except ray.exceptions.RayError as error:
                words = "--ray: the cluster is lost; run the same command again to go on"
                raise OutputError(f"{words} ({error})") from None
            finally:
                crew.dismiss()
        finally:
            if own:
                ray.shutdown()

    return run


def _ray() -> Any:
    try:
        import ray
    except ImportError:
        raise OutputError("--ray needs Ray: pip install 'fastgen[ray]'") from None
    return ray


def _joined(address: str | None, count: int | None) -> bool:
    """Be part of a cluster; whether it is for us to leave it."""
    ray = _ray()
    if ray.is_initialized():
        return False
    options: dict[str, Any] = {"address": address}
    if address is None:
        # 'local' never joins another's cluster by accident
        options = {"address": "local", "num_cpus": count or len(os.sched_getaffinity(0))}
        options |= {"include_dashboard": False, "object_store_memory": _STORE_BYTES}
    elif address != "auto":
        _probe(address)
    at_sigterm = signal.getsignal(signal.SIGTERM)
    try:
        ray.init(logging_level=logging.WARNING, **options)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise OutputError(f"--ray {address or ''}: no Ray cluster joined: {error}") from None
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, at_sigterm)  # Ray's own would end us in its way
    return True


def _probe(address: str) -> None:
    """Fail at once where nobody listens, as Ray tries for minutes and then ends the process."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or "/" in host:
        raise OutputError(
            f"--ray {address}: is no address; give auto, or HOST:PORT as in head:6379"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT_S).close()
    except (OSError, OverflowError) as error:
        raise OutputError(f"--ray {address}: nobody answers there ({error})") from None


def _everywhere(job: Job) -> Job:
    """The job with paths that mean the same in every working folder."""
    return replace(
        job,
        out=job.out if "://" in job.out else os.path.abspath(job.out),
        hdri_dir=job.hdri_dir and os.path.abspath(job.hdri_dir),
    )


class _Board:
    """An actor that keeps what the others report until the driver takes it."""

    def __init__(self) -> None:
        self._news: list[tuple[int, Reports]] = []

    def tell(self, number: int, reports: Reports) -> None:
        self._news.append((number, reports))

    def take(self) -> list[tuple[int, Reports]]:
        news, self._news = self._news, []
        return news


def _mark(job: Job) -> str:
    """Of dataset.json, by which a node knows the place that the driver sees."""
    return digest(storage_of(job.out).read(MANIFEST))


class _Actor:
    """Makes shards in a process of its own on some node; GL opens with the first shard.

    Its methods return reports and, where no repetition mends it, what went wrong, or ''.
    """

    def __init__(self, maker: Any, job: Job, board: Any, number: int) -> None:
        self._maker, self._job, self._board, self._number = maker, job, board, number
        self._work: Callable[[Task], None] | None = None
        self._reports: Reports = []
        self._scene: int | None = None

    def begin(self, version: str, claimed: str) -> tuple[Reports, str]:
        """Whether this node has the driver's fastgen and sees its dataset.json, by their marks."""
        if fastgen.__version__ != version:
            return [], self._here(f"has fastgen {fastgen.__version__}, the driver {version}")
        try:
            seen = _mark(self._job)
        except (OSError, OutputError, ValueError) as error:
            seen = str(error)
        if seen == claimed:
            return [], ""
        words = f"does not see {self._job.out} as the driver does"
        return [], self._here(f"{words}; give a folder that all nodes share, or s3://...")

    def make(self, task: Task) -> tuple[Reports, str]:
        """Make one shard."""
        self._scene = None
        failure = ""
        try:
            if self._work is None:
                # one actor a CPU, so that no core is idle
                self._work = self._maker(self._job, True, self._report)
            self._work(task)
        except Exception as error:
            place = "start" if self._scene is None else f"scene {self._scene}"
            failure = self._here(in_words(error, place))
        reports, self._reports = self._reports, []
        return reports, failure

    def _report(self, kind: str, value: Any) -> None:
        """Pass on at once that it turns to a scene or is busy; the rest goes along."""
        self._reports.append((kind, value))
        if kind == "at":
            self._scene = value
        if kind in ("at", "busy"):
            _ray().get(self._board.tell.remote(self._number, self._reports))
            self._reports = []

    def _here(self, words: str) -> str:
        return f"node {_ray().util.get_node_ip_address()}: {words}"


@dataclass(eq=False)
class _Member:
    """An actor as the driver sees it. call: what it is asked for, None while idle."""

    number: int
    actor: Any
    call: Any
    ready: bool = False
    task: Task | None = None
    scene: int | None = None
    heard: float = field(default_factory=time.monotonic)

    def give(self, task: Task) -> None:
        self.task, self.scene, self.heard = task, None, time.monotonic()
        self.call = self.actor.make.remote(task)


class _Crew:
    """The actors of one run and what is left to do."""

    def __init__(
        self,
        job: Job,
        tasks: Iterable[Task],
        on_report: Callable[[str, Any], None],
        count: int | None,
        hang_s: float,
        maker: Callable[..., Any],
    ) -> None:
        ray = _ray()
        self._job, self._on_report, self._maker = job, on_report, maker
        self._count, self._hang_s = count, hang_s
        self._waiting = Waiting(tasks)
        self._strikes = Strikes(job)
        self._claimed = _mark(job)
        self._members: dict[int, _Member] = {}
        self._hired = 0
        self._false_starts = 0
        # beside the driver, so that it dies with no other node
        here = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(
            ray.get_runtime_context().get_node_id(), soft=False
        )
        self._board = ray.remote(num_cpus=0)(_Board).options(scheduling_strategy=here).remote()

    def work(self) -> None:
        """Have every task done. Raises OutputError; see run_on_ray."""
        ray = _ray()
        counted = float("-inf")
        while self._waiting or self._busy():
            if time.monotonic() - counted >= _POLL_S:
                counted = time.monotonic()
                self._hire(int(ray.cluster_resources().get("CPU", 0)))
            for member in self._members.values():
                if member.call is None and self._waiting:
                    member.give(self._waiting.take())
            calls = [member.call for member in self._members.values() if member.call is not None]
            if not calls:
                time.sleep(_POLL_S)
                continue
            ray.wait(calls, timeout=_POLL_S)
            done, _ = ray.wait(calls, num_returns=len(calls), timeout=0)
            self._hear(set(done))

    def dismiss(self) -> None:
        """End all actors."""
        for member in self._members.values():
            _ray().kill(member.actor)
        _ray().kill(self._board)

    def _busy(self) -> list[_Member]:
        return [member for member in self._members.values() if member.task is not None]

    def _hire(self, cpus: int) -> None:
        """Have an actor for each CPU, but no more than find work."""
        most = min(cpus, self._count or cpus)
        wanted = min(most, self._waiting.up_to(most) + len(self._busy()))
        renderer = _ray().remote(num_cpus=1)(_Actor)
        while len(self._members) < wanted:
            self._hired += 1
            actor = renderer.remote(self._maker, self._job, self._board, self._hired)
            call = actor.begin.remote(fastgen.__version__, self._claimed)
            self._members[self._hired] = _Member(self._hired, actor, call)

    def _hear(self, done: set[Any]) -> None:
        """Take in reports, results and deaths. done: the calls that ended, one way or another."""
        ray = _ray()
        # news of an actor that died has been here since before it died
        for number, reports in ray.get(self._board.take.remote()):
            if number in self._members:
                self._take_in(self._members[number], reports)
        for member in list(self._members.values()):
            if member.call in done:
                try:
                    reports, failure = ray.get(member.call)
                except ray.exceptions.RayError as error:
                    self._bury(member, error)
                    continue
                self._take_in(member, reports)
                if failure:
                    raise OutputError(failure)
                member.call, member.task, member.ready = None, None, True
                self._false_starts = 0
            elif member.task and time.monotonic() - member.heard > self._hang_s:
                self._replace(member, f"no sign of life for {self._hang_s:g} s")

    def _take_in(self, member: _Member, reports: Reports) -> None:
        member.heard = time.monotonic()
        for kind, value in reports:
            if kind == "at":
                member.scene = value
            else:
                self._on_report(kind, value)

    def _bury(self, member: _Member, error: Exception) -> None:
        if not member.ready:
            self._false_starts += 1
            # a node that dies takes all its beginners along, so a few failures mean nothing
            hopeless = self._false_starts > ATTEMPTS * len(self._members)
            if hopeless or getattr(error, "actor_init_failed", False):
                version = fastgen.__version__
                raise OutputError(f"no actor starts; is fastgen {version} on every node? {error}")
        self._replace(member, type(error).__name__)

    def _replace(self, member: _Member, ended: str) -> None:
        if member.task is not None:
            self._waiting.put_back(self._strikes(member.task, member.scene, ended))
        _ray().kill(member.actor)
        del self._members[member.number]
