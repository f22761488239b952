"""Shards made by actors of a Ray cluster, one per CPU. Actors and nodes may die at any time.

Before an actor renders a scene it reports the scene's index to the board, an actor on the driver's
node. So the scene that killed an actor is known. Actors write files directly to job.out; Ray
transfers only shard numbers and reports.
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
from fastgen.cpus import usable_cpus
from fastgen.dataset.addresses import place_of
from fastgen.dataset.dataset_json import MANIFEST
from fastgen.dataset.generate import Runner
from fastgen.dataset.job import Job, Task
from fastgen.dataset.seal import digest
from fastgen.dataset.shards import ATTEMPTS, Maker, Strikes
from fastgen.dataset.storage import storage_of
from fastgen.dataset.workers import HANG_S, Waiting, in_words
from fastgen.errors import OutputError

Reports = list[tuple[str, Any]]
"""Reports of a maker in order; see shards.Report."""

_POLL_S = 1.0
_CONNECT_S = 10.0
_STORE_BYTES = 80 * 2**20
"""Size of Ray's object store, which we do not use: about the smallest that Ray accepts."""


def run_on_ray(
    address: str | None,
    count: int | None = None,
    hang_s: float = HANG_S,
    maker: Callable[..., Callable[[Task], None]] = Maker,
) -> Runner:
    """Return a runner that makes shards on a Ray cluster.

    Args:
        address: 'auto' or 'host:port' of a running cluster. None starts Ray on this machine for the
            duration of the run. A process that has already joined a cluster keeps using it.
        count: Largest number of actors; None for one on each CPU, including nodes that join later.
        hang_s: Seconds without a report after which an actor is replaced.
        maker: Called in the actor with the job, whether all cores are in use, and a report
            function.

    Raises:
        OutputError: Ray is not installed. The runner raises it if no cluster answers, if a node
            has another fastgen or does not see job.out, and with an actor's own words if another
            attempt cannot fix its error.
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
                words = "--ray: lost the cluster; run the same command again to continue"
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
    """Join a cluster. Return whether it must be left at the end of the run."""
    ray = _ray()
    if ray.is_initialized():
        return False
    options: dict[str, Any] = {"address": address}
    if address is None:
        # 'local' never joins a cluster that happens to run here
        options = {"address": "local", "num_cpus": count or usable_cpus()}
        options |= {"include_dashboard": False, "object_store_memory": _STORE_BYTES}
    elif address != "auto":
        _probe(address)
    at_sigterm = signal.getsignal(signal.SIGTERM)
    try:
        ray.init(logging_level=logging.WARNING, **options)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise OutputError(f"--ray {address or ''}: cannot join a Ray cluster: {error}") from None
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, at_sigterm)  # Ray replaces our handler
    return True


def _probe(address: str) -> None:
    """Raise OutputError if nothing listens: Ray tries for minutes and then ends the process."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or "/" in host:
        raise OutputError(
            f"--ray {address}: is not an address; give auto, or HOST:PORT as in head:6379"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT_S).close()
    except (OSError, OverflowError) as error:
        raise OutputError(f"--ray {address}: nothing answers at this address ({error})") from None


def _everywhere(job: Job) -> Job:
    """Return the job with absolute paths, which mean the same in every working directory."""
    place = place_of(job.out)
    out = place if "://" in place else os.path.abspath(place)
    hdri_dir = job.render.hdri_dir and os.path.abspath(job.render.hdri_dir)
    return replace(job, out=out, render=replace(job.render, hdri_dir=hdri_dir))


class _Board:
    """Actor that keeps the reports of the others until the driver takes them."""

    def __init__(self) -> None:
        self._news: list[tuple[int, Reports]] = []

    def tell(self, number: int, reports: Reports) -> None:
        self._news.append((number, reports))

    def take(self) -> list[tuple[int, Reports]]:
        news, self._news = self._news, []
        return news


def _mark(job: Job) -> str:
    """Hash dataset.json, so that a node can check that it sees the same folder as the driver."""
    return digest(storage_of(job.out).read(MANIFEST))


class _Actor:
    """Actor that makes shards in its own process on some node. The first shard opens OpenGL.

    Its methods return reports, and a description of an error that another attempt cannot fix, or
    ''.
    """

    def __init__(self, maker: Any, job: Job, board: Any, number: int) -> None:
        self._maker, self._job, self._board, self._number = maker, job, board, number
        self._work: Callable[[Task], None] | None = None
        self._reports: Reports = []
        self._scene: int | None = None

    def begin(self, version: str, claimed: str) -> tuple[Reports, str]:
        """Check that this node has the driver's fastgen version and sees its dataset.json."""
        if fastgen.__version__ != version:
            return [], self._here(f"has fastgen {fastgen.__version__}, the driver has {version}")
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
                # True: with one actor per CPU, no core is idle
                self._work = self._maker(self._job, True, self._report)
            self._work(task)
        except Exception as error:
            place = "start" if self._scene is None else f"scene {self._scene}"
            failure = self._here(in_words(error, place))
        reports, self._reports = self._reports, []
        return reports, failure

    def _report(self, kind: str, value: Any) -> None:
        """Send reports to the board when a scene begins or preparation takes long."""
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
    """An actor as the driver sees it. `call` is its pending call, None while idle."""

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
    """The actors of one run and the tasks that are left."""

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
        # on the driver's node, so that the loss of another node does not end it
        here = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(
            ray.get_runtime_context().get_node_id(), soft=False
        )
        self._board = ray.remote(num_cpus=0)(_Board).options(scheduling_strategy=here).remote()

    def work(self) -> None:
        """Let the actors do every task. Raises OutputError; see run_on_ray."""
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
        """Start actors until there is one per CPU, but no more than there are tasks."""
        most = min(cpus, self._count or cpus)
        wanted = min(most, self._waiting.up_to(most) + len(self._busy()))
        renderer = _ray().remote(num_cpus=1)(_Actor)
        while len(self._members) < wanted:
            self._hired += 1
            actor = renderer.remote(self._maker, self._job, self._board, self._hired)
            call = actor.begin.remote(fastgen.__version__, self._claimed)
            self._members[self._hired] = _Member(self._hired, actor, call)

    def _hear(self, done: set[Any]) -> None:
        """Handle reports, results and deaths. `done` holds the calls that have ended."""
        ray = _ray()
        # an actor waits until the board has its report, so these include those of dead actors
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
            # the loss of one node ends all its starting actors, so a few failures are normal
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
