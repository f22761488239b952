"""Runs stopped by signals: they end quietly and at once, and can be resumed."""

import argparse
import os
import re
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest

from fastgen.cli.main import main
from fastgen.dataset.workers import undisturbed
from tests.interruptible import begun

ARGUMENTS = ["--images", "8", "--size", "64x64", "--cameras", "A", "--workers", "2"]
STOPPED = "fastgen: stopped"
RESUMABLE = f"{STOPPED}; run the same command again to go on"

COMMANDS = {  # with the arguments that each requires
    "generate": ["out", "--images", "1"],
    "fit": ["photos"],
    "show": ["--index", "0", "-o", "0.png"],
    "export": ["--index", "0", "-o", "0.glb"],
    "stats": ["out"],
    "report": ["out"],
    "verify": ["out"],
    "merge": ["one", "other", "out"],
    "completion": ["bash"],
    **{name: [] for name in ("config", "presets", "studio", "doctor")},
}


def long_run(out, images="900", shards=0):
    """Start a run, and return it once it has begun to write.

    Workers of runs with more images would first load everything, which takes a while.
    """
    return begun(out, *ARGUMENTS, "--images", images, shards=shards)


def wait_for(condition):
    """Poll for up to two minutes, because the machine may be busy."""
    for _ in range(2400):
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError("the condition did not hold within two minutes")


def gone(processes):
    """Return True if all have ended. Zombies count: there may be no parent to reap them."""
    _, alive = psutil.wait_procs(processes, timeout=0)
    return all(each.status() == psutil.STATUS_ZOMBIE for each in alive)


@pytest.mark.parametrize("moment", ["workers start", "shards are made"])
def test_sigterm_stops_a_run_as_ctrl_c_does(tmp_path, moment):
    out = tmp_path / "out"
    process = long_run(out, shards=int(moment == "shards are made"))
    family = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(signal.SIGTERM)  # only to the parent, as docker does
    error = process.communicate(timeout=300)[1]
    assert process.returncode == 128 + signal.SIGTERM
    assert "Traceback" not in error
    assert error.splitlines()[-1] == RESUMABLE
    assert not [p for p in out.iterdir() if p.name.startswith(".")]
    wait_for(lambda: gone(family))


def test_a_stop_waits_until_a_process_has_started():
    """The signal may also reach a thread other than the one that starts the process."""
    heard = []
    before = signal.signal(signal.SIGTERM, lambda *_: heard.append("late" if over else "early"))
    over, done = False, threading.Event()
    threading.Thread(target=done.wait, daemon=True).start()  # it masks no signal
    try:
        with undisturbed():
            masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.2)
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
            over = True
    finally:
        done.set()
        signal.signal(signal.SIGTERM, before)
    assert heard == ["late"]


def test_workers_whose_parent_was_killed_end_silently(tmp_path):
    out = tmp_path / "out"
    process = long_run(out, shards=1)
    family = psutil.Process(process.pid).children(recursive=True)
    assert len(family) >= 2
    process.kill()
    wait_for(lambda: gone(family))
    # the stream ends only when the last process that could write to it is gone
    assert "Traceback" not in process.communicate(timeout=300)[1]


def test_a_worker_ends_with_its_parent_although_one_forked_later_hangs(tmp_path):
    out = tmp_path / "out"
    process = long_run(out, shards=1)
    first, last = sorted(psutil.Process(process.pid).children(recursive=True), key=lambda p: p.pid)
    last.suspend()
    try:
        process.kill()
        wait_for(lambda: gone([first]))
        assert not gone([last])
    finally:
        last.kill()
    process.communicate(timeout=300)


def test_a_run_stopped_by_sigterm_can_be_resumed(tmp_path):
    out = tmp_path / "out"
    process = long_run(out, "16")
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=300)
    before = signal.getsignal(signal.SIGTERM)
    assert main(["generate", str(out), *ARGUMENTS, "--images", "16"]) == 0
    assert signal.getsignal(signal.SIGTERM) == before
    assert main(["verify", str(out)]) == 0


@pytest.fixture
def ctrl_c():
    """Let this process hear Ctrl-C, which a background job of a shell ignores."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("command", [*COMMANDS, "verify --repair"])
def test_only_a_command_that_continues_its_work_asks_to_be_run_again(
    command, number, capsys, monkeypatch
):
    name, *more = command.split()
    plain = argparse.ArgumentParser.parse_args

    def with_a_signal(*arguments):
        options = plain(*arguments)
        options.run = lambda _: signal.raise_signal(number)
        return options

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", with_a_signal)
    assert main([name, *COMMANDS[name], *more]) == 128 + number
    resumes = command in ("generate", "verify --repair")
    assert capsys.readouterr().err == (f"{RESUMABLE}\n" if resumes else f"{STOPPED}\n")


def test_every_command_is_stopped_by_a_test(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    listed = re.findall(r"^    (\w+)\b", capsys.readouterr().out, re.MULTILINE)
    assert set(listed) == {*COMMANDS}


LOADING = """
import os, runpy, signal, sys

class Signalled:
    def find_spec(self, name, path=None, target=None):
        if name == MODULE:
            os.kill(os.getpid(), SIGNAL)

signal.signal(signal.SIGINT, BEFORE)
sys.meta_path.insert(0, Signalled())
sys.argv = ["fastgen", "--version"]
runpy.run_module("fastgen", run_name="__main__")
"""


@pytest.mark.parametrize("module", ["numpy", "fastgen.config", "cv2", "argparse"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_modules_load_ends_in_one_line(module, number):
    code, error = loading(module, number, "signal.default_int_handler")
    assert (code, error) == (128 + number, f"{STOPPED}\n")


def test_an_ignored_ctrl_c_stays_ignored_while_modules_load():
    assert loading("numpy", signal.SIGINT, "signal.SIG_IGN") == (0, "")


def loading(module, number, before):
    """Return exit code and stderr of a command that gets a signal while it loads a module."""
    text = LOADING.replace("MODULE", repr(module)).replace("SIGNAL", str(int(number)))
    command = [sys.executable, "-c", text.replace("BEFORE", before)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stderr
