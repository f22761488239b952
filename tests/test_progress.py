"""Progress and messages of commands: honest times, quiet runs, JSON for other programs."""

import io
import json
import logging
import re
import time

import numpy as np
import pytest

from fastgen.cli.main import main
from fastgen.dataset.console import LOGGER, printed_log
from fastgen.dataset.generate import generate
from fastgen.dataset.job import Job
from fastgen.dataset.progress import Progress
from fastgen.dataset.shards import Maker
from fastgen.files import disk_cache
from fastgen.render.settings import RenderSettings

SMALL = ["--size", "64x64", "--cameras", "A", "--workers", "1"]


class Terminal(io.StringIO):
    def isatty(self):
        return True

    def lines(self):
        """Return each state of the progress line."""
        return self.getvalue().replace("\x1b[K", "").rstrip("\n").split("\r")[1:]


@pytest.fixture
def clock(monkeypatch):
    """A clock that tests set; the terminal is wide."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "xterm")
    return now


def seconds_left(line):
    found = re.search(r"(\d+):(\d\d) left", line)
    return None if found is None else int(found[1]) * 60 + int(found[2])


@pytest.mark.parametrize("start_s", [0.0, 60.0])
@pytest.mark.parametrize("image_s", [0.005, 0.4, 7.0])
def test_the_time_left_is_that_of_a_steady_run_however_long_the_start_was(clock, start_s, image_s):
    total, stream = 40, Terminal()
    progress = Progress(total, stream=stream)
    progress.note("starting")
    clock[0] += start_s
    for _ in range(total):
        clock[0] += image_s
        progress.add(1)
    timed = [line for line in stream.lines() if seconds_left(line) is not None]
    for line in timed:
        true_s = (total - int(re.search(r"(\d+)/40", line)[1])) * image_s
        assert max(1, true_s - 1e-6) <= seconds_left(line) < true_s + 1 + 1e-6
    assert bool(timed) == (image_s * total > 1)


def test_no_time_is_given_before_a_rate_is_known_and_none_is_left_at_the_end(clock):
    stream = Terminal()
    progress = Progress(10, done=2, stream=stream)
    progress.note("starting")
    clock[0] += 30
    progress.note("preparing light quay, once per machine")
    clock[0] += 30
    progress.add(1)
    assert stream.lines() == [
        "[#####.......................] 2/10 images, starting",
        "[#####.......................] 2/10 images, preparing light quay, once per machine",
        "[########....................] 3/10 images",
    ]
    clock[0] += 10
    progress.add(7)
    progress.close()
    assert stream.lines()[-1] == f"[{'#' * 28}] 10/10 images, 0.1/s, took 1:10"


def test_a_log_gets_a_line_every_fifteen_seconds_without_control_characters(clock):
    stream = io.StringIO()
    progress = Progress(100, stream=stream)
    for _ in range(100):
        clock[0] += 1
        progress.add(1)
    progress.close()
    lines = stream.getvalue().splitlines()
    assert len(lines) == 100 // 15 + 1
    assert all(line.isprintable() for line in lines)
    assert [re.search(r"(\d+)/100", line)[1] for line in lines[:2]] == ["15", "30"]


@pytest.mark.parametrize("variable", [("TERM", "dumb"), ("NO_COLOR", "1"), ("COLUMNS", "40")])
def test_terminals_get_no_sequence_that_they_cannot_show(clock, monkeypatch, variable):
    monkeypatch.setenv(*variable)
    stream = Terminal()
    progress = Progress(10, stream=stream)
    for _ in range(10):
        clock[0] += 20
        progress.add(1)
    text = stream.getvalue()
    assert "10/10" in text if variable[0] != "COLUMNS" else "####" in text
    assert not re.search(r"\x1b\[[0-9;]*m", text)  # colours
    if variable[0] == "TERM":
        assert "\x1b" not in text
    if variable[0] == "COLUMNS":
        assert max(map(len, stream.lines())) == 39


@pytest.mark.parametrize("level", ["warning", "error"])
def test_quiet_hides_the_progress_line(clock, level):
    stream = Terminal()
    with printed_log(level):
        progress = Progress(10, stream=stream)
        progress.add(10)
        progress.close()
    assert bool(stream.getvalue()) == (level == "warning")


def test_json_and_quiet_leave_one_line_for_other_programs(tmp_path, capfd):
    parts = [str(tmp_path / name) for name in ("a", "b")]
    for seed, out in enumerate(parts):
        command = ["generate", out, "--images", "2", "--seed", str(seed), *SMALL]
        assert main([*command, "--quiet", "--json"]) == 0
        printed = capfd.readouterr()
        assert printed.err == ""
        assert printed.out.count("\n") == 1
        result = json.loads(printed.out)
        manifest = json.loads((tmp_path / out / "dataset.json").read_text())
        assert result == {
            "out": out,
            "images": 2,
            "counts": manifest["counts"],
            "failed": [],
        }
    merged = str(tmp_path / "merged")
    assert main(["merge", *parts, merged, "--json", "--quiet"]) == 0
    assert json.loads(capfd.readouterr().out)["images"] == 4
    (tmp_path / "merged/.DS_Store").write_text("")
    next((tmp_path / "merged/images").glob("*/*")).write_text("")
    assert main(["verify", merged, "--json"]) == 1
    result = json.loads(capfd.readouterr().out)
    assert result["foreign"] == [".DS_Store"]
    assert re.fullmatch(r"images/\S+: changed \(0 bytes, \d+ were written\)", result["faults"][0])
    assert main(["verify", merged, "--quiet"]) == 1
    assert capfd.readouterr() == ("", "")
    assert main(["verify", str(tmp_path / "none"), "--quiet"]) == 2
    assert capfd.readouterr().err.startswith("fastgen: ")


def test_a_missing_cache_entry_is_announced_once(tmp_path, caplog):
    def load():
        disk_cache.cached("thing", 1, 0, lambda: {"x": np.zeros(2)}, tmp_path, what="light quay")

    caplog.set_level(logging.INFO, logger="fastgen")
    load()
    load()
    assert caplog.messages == ["preparing light quay, once per machine"]


def test_workers_report_what_they_prepare_and_the_parent_prints_it(tmp_path, capsys):
    reports = []
    job = Job(str(tmp_path / "out"), 1, cameras=("A",), render=RenderSettings((64, 64)))

    def run(job, tasks, on_report):
        def report(kind, value):
            reports.append((kind, value))
            on_report(kind, value)

        before, level = LOGGER.handlers, LOGGER.level
        maker = Maker(job, False, report)
        logging.getLogger("fastgen.files.disk_cache").info("preparing %s", "light quay")
        LOGGER.handlers = before
        LOGGER.setLevel(level)
        on_report("busy", "preparing noise")
        on_report("busy", None)
        for task in tasks:
            maker(task)

    with printed_log("info"):
        generate(job, 1, run)
    assert ("busy", "preparing light quay") in reports
    assert "fastgen: preparing noise\n" in capsys.readouterr().err


def test_an_unknown_log_level_is_refused(tmp_path, capsys):
    assert main(["verify", str(tmp_path), "--log-level", "loud"]) == 2
    assert "log-level: 'loud' is unknown" in capsys.readouterr().err
