"""Crash safety: killed processes, dead and hung workers, and full disks."""

import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from fastgen.dataset import storage
from fastgen.dataset.job import Job, Task
from fastgen.dataset.storage import Folder, storage_of
from fastgen.dataset.workers import run
from fastgen.errors import OutputError
from fastgen.formats.format import Same
from tests.crash_run import FAULTY_SCENE, QuickMaker, make
from tests.folders import content
from tests.stability.fuzzing import COUNT

SCENES = 40
KILLS = COUNT or 8
SCRIPT = str(Path(__file__).parent / "crash_run.py")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "out"
    make(out, SCENES, 2)
    return out


def is_sound(out):
    """Check that every file listed in a manifest has the listed size and hash."""
    for path in out.glob("shards/*.json"):
        for name, (size, digest) in json.loads(path.read_text())["files"].items():
            data = (out / name).read_bytes()
            assert (len(data), hashlib.sha256(data).hexdigest()) == (size, digest)


def test_each_scene_and_each_image_is_reported_once(tmp_path):
    heard = []
    job = Job(str(tmp_path), 99, seed=1, cameras=("A", "B"), shard_scenes=3)
    maker = QuickMaker(job, False, lambda *report: heard.append(report))
    maker(Task(0, {1: "given up"}))
    assert [value for kind, value in heard if kind == "at"] == [0, 2]
    assert sum(value for kind, value in heard if kind == "images") == 4
    heard.clear()
    maker(Task(1, dict.fromkeys((3, 4, 5), "given up")))
    assert not heard


def test_locks_are_forgotten_after_their_use(tmp_path):
    for _ in range(2):
        with Folder(tmp_path).locked():
            assert len(storage._locks) == 1
    assert len(storage._locks) == 0


FORKING = """
import os, sys
from pathlib import Path
from fastgen.dataset.storage import Folder
with Folder(Path(sys.argv[1])).locked():
    if os.fork() == 0:
        sys.stdin.read()  # outlives the parent
    os._exit(0)  # as if killed
"""


def test_a_forked_process_that_outlives_the_run_does_not_keep_the_lock(tmp_path):
    command = [sys.executable, "-c", FORKING, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        process.wait(timeout=300)
        with Folder(tmp_path).locked():
            pass


def test_kills_at_random_moments_end_in_the_same_bytes(whole, tmp_path):
    rng = random.Random(4)
    out = tmp_path / "out"
    kills = 0
    rounds = 0
    while kills < KILLS:
        rounds += 1
        command = [sys.executable, SCRIPT, str(out), str(SCENES), str(rng.choice([1, 2, 3]))]
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        time.sleep(rng.uniform(0.05, 2.2))
        with contextlib.suppress(psutil.NoSuchProcess, ProcessLookupError):
            if rng.random() < 0.5:
                os.killpg(process.pid, signal.SIGKILL)
                kills += 1
            else:  # kill one process: a dead worker is replaced, a dead parent ends all
                family = psutil.Process(process.pid).children(recursive=True)
                victim = rng.choice([psutil.Process(process.pid), *family])
                victim.kill()
                kills += 1
                time.sleep(rng.uniform(0.0, 0.3))
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        is_sound(out)
        if (out / "dataset.json").exists() and "digest" in (out / "dataset.json").read_text():
            assert content(out).items() >= content(whole).items()
            out = tmp_path / f"out{rounds}"
    make(out, SCENES, 2)
    assert content(out) == content(whole)


def test_a_stop_after_the_last_shard_ends_in_the_same_bytes(whole, tmp_path):
    def stop():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(tmp_path / "out", SCENES, 2, then=stop)
    make(tmp_path / "out", SCENES, 2)
    assert content(tmp_path / "out") == content(whole)


def test_only_the_scene_that_kills_its_worker_is_given_up(whole, tmp_path, monkeypatch):
    monkeypatch.setenv("FAULT", "crash")
    made = make(tmp_path / "out", SCENES, 2)
    (failed,) = made["failed"]
    assert failed["scene"] == FAULTY_SCENE
    assert "SIGABRT" in failed["error"]
    assert sum(split["images"] for split in made["counts"].values()) == SCENES - 1
    monkeypatch.delenv("FAULT")
    assert make(tmp_path / "out", SCENES, 2)["failed"] == []
    assert content(tmp_path / "out") == content(whole)


def test_a_scene_that_hangs_its_worker_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setenv("FAULT", "hang")
    # on a busy machine a worker takes seconds to start
    made = make(tmp_path / "out", 8, 2, hang_s=6.0)
    (failed,) = made["failed"]
    assert failed["scene"] == FAULTY_SCENE
    assert "no sign of life" in failed["error"]


def test_links_and_files_are_committed_together(tmp_path):
    place = Folder(tmp_path)
    for _ in range(2):
        place.commit({"a/x.bin": b"bytes", "b/y.bin": Same("a/x.bin")}, "test")
        assert (tmp_path / "b/y.bin").read_bytes() == b"bytes"
        assert place.sizes() == {"a/x.bin": 5, "b/y.bin": 5}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


def test_a_full_disk_leaves_nothing_half_written(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(storage, "_flush", full)
    with pytest.raises(OutputError, match=r"cannot be written .No space left on device"):
        Folder(tmp_path).commit({"a/x.bin": b"bytes"}, "test")
    assert not list(tmp_path.rglob("*"))
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match=r"dataset.json: cannot be written"):
        Folder(tmp_path).write("dataset.json", [b"{}"])
    assert not list(tmp_path.rglob("*"))


def test_a_small_disk_stops_the_run_with_one_line(tmp_path):
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500));"
        f"sys.argv[1:] = ['{tmp_path / 'out'}', '8', '1'];"
        f"import runpy; runpy.run_path('{SCRIPT}', run_name='__main__')"
    )
    # Python ignores SIGXFSZ, so writes fail as on a full disk
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "cannot be written" in done.stderr
    left = [p for p in (tmp_path / "out").rglob("*") if p.is_file()]
    assert not [p for p in left if p.name.endswith(".part") or ".aside" in str(p)]


def test_unknown_addresses_are_named():
    with pytest.raises(OutputError, match="nowhere://bucket"):
        storage_of("nowhere://bucket/x")


def test_tasks_are_done_once_each_by_any_number_of_workers():
    for count in (1, 2):
        seen = []

        def hear(_, value, seen=seen):
            seen.append(value)

        run(_setup, range(7), count, hear, None)
        assert sorted(seen) == list(range(7))


def _setup(report):
    return lambda task: report("images", task)


def test_a_workers_error_reaches_the_caller_in_its_own_words():
    with pytest.raises(OutputError, match=r"scene 3: .*no such luck"):
        run(_broken, [3], 1, lambda *_: None, None)


def _broken(report):
    def work(task):
        report("at", task)
        raise RuntimeError("no such luck")

    return work
