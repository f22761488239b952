"""Measure the start of `fastgen generate`, with and without caches, and the memory of its workers.

    python bench/startup.py [--images 48] [--draft-images 400] [--rounds 3] [--against DIR]

Each round begins with empty caches, those of fastgen and of Mesa, and makes `--images` images in
`balanced` twice, then `--draft-images` images in `draft` twice. `--against` names another checkout,
whose rounds alternate with those of this one. The table has medians over the rounds: wall time, CPU
time of all processes, and the largest memory of a worker. PSS divides a page by the number of
processes that share it; RSS does not.

The table is only printed, because the figures depend on the load of the machine.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from reporting import ROOT, machine
from throughput import generate_command

_POLL_S = 0.2
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_LEAST_WORKER_MB = 150.0
"""Resident memory of every worker is above this, because of OpenGL and its textures."""


class Run(NamedTuple):
    """Wall and CPU time of one run in seconds, and memory of its largest worker in MB."""

    wall_s: float
    cpu_s: float
    pss_mb: float
    rss_mb: float


def measured(tree: Path, cache: Path, images: int, quality: str) -> Run:
    """Make a dataset with the fastgen of a checkout, and with caches in a folder."""
    search = os.pathsep.join([str(tree), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": search, "XDG_CACHE_HOME": str(cache)}
    workers = len(os.sched_getaffinity(0))
    cpu_s: dict[int, float] = {}
    most = (0.0, 0.0)
    with tempfile.TemporaryDirectory() as place:
        command = generate_command(f"{place}/out", images, workers, "640x640", "auto", quality)
        began = time.perf_counter()
        process = subprocess.Popen(
            command,
            cwd=tree,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        while process.poll() is None:
            for pid in family(process.pid):
                cpu_s[pid] = max(cpu_seconds(pid), cpu_s.get(pid, 0.0))
                memory = _memory_mb(pid) if pid != process.pid else (0.0, 0.0)
                most = max(most, memory, key=lambda each: each[0])
            time.sleep(_POLL_S)
        wall_s = time.perf_counter() - began
    if process.returncode:
        raise SystemExit(f"fastgen generate of {tree} ended with exit code {process.returncode}")
    return Run(wall_s, sum(cpu_s.values()), *most)


def family(pid: int) -> list[int]:
    """Return a process and all its descendants."""
    try:
        tasks = [task / "children" for task in Path(f"/proc/{pid}/task").iterdir()]
        children = [int(child) for task in tasks for child in task.read_text("ascii").split()]
    except OSError:  # the process has ended
        return [pid]
    return [pid, *(each for child in children for each in family(child))]


def cpu_seconds(pid: int) -> float:
    """Return the CPU time of a process so far, 0 if it has ended; see proc_pid_stat(5)."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def _memory_mb(pid: int) -> tuple[float, float]:
    """Return PSS and RSS of a worker; zeros for other processes; see proc_pid_smaps_rollup(5)."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text("ascii").splitlines()[1:]
    except OSError:
        return 0.0, 0.0
    kib = {name.rstrip(":"): int(size) for name, size, _ in map(str.split, lines)}
    rss_mb = kib["Rss"] * 1024 / 1e6
    return (kib["Pss"] * 1024 / 1e6, rss_mb) if rss_mb > _LEAST_WORKER_MB else (0.0, 0.0)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=48)
    parser.add_argument("--draft-images", type=int, default=400)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--against", type=Path, help="another checkout of fastgen")
    options = parser.parse_args()
    trees = [ROOT, *([options.against.resolve()] if options.against else [])]
    runs: dict[tuple[str, Path], list[Run]] = {}
    with tempfile.TemporaryDirectory() as place:
        for number, tree in enumerate(options.rounds * trees):
            cache = Path(place) / str(number)
            for name, images, quality in (
                ("balanced cold", options.images, "balanced"),
                ("balanced warm", options.images, "balanced"),
                ("draft cold", options.draft_images, "draft"),
                ("draft warm", options.draft_images, "draft"),
            ):
                found = measured(tree, cache, images, quality)
                runs.setdefault((name, tree), []).append(found)
                print(name, tree, *(f"{value:.1f}" for value in found), flush=True)
    print(machine())
    print(f"{'run':15}{'checkout':40}{'wall s':>9}{'CPU s':>9}{'PSS MB':>9}{'RSS MB':>9}")
    for (name, tree), each in sorted(runs.items()):
        middle = [statistics.median(values) for values in zip(*each, strict=True)]
        print(f"{name:15}{str(tree)[-39:]:40}" + "".join(f"{value:9.1f}" for value in middle))


if __name__ == "__main__":
    main()
