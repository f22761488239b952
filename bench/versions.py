"""Compare the CPU time of a labelled image with that of another version of fastgen.

    git worktree add ../other COMMIT
    python bench/versions.py ../other [--rounds 5] [--scenes 12] [--qualities draft,balanced]

Renders the same indices of `seafront` at 640x640 with both versions, in processes of their own that
alternate. Everything is rendered once before it is timed, so meshes, lights and programs are ready.
The ratio is the median over the rounds of the ratio of two neighbouring processes, because the
speed of a machine changes during a run.

The scenes of two versions differ, but the distributions that they are drawn from hardly do.
Writes bench/results/versions.json.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from reporting import ROOT, origin, save

_CHILD = """
import json, sys, time
import fastgen
quality, scenes = sys.argv[1], int(sys.argv[2])
config = fastgen.Config.preset()
with fastgen.Generator(config, seed=7, size=(640, 640), quality=quality) as generator:
    jobs = [(index, name) for index in range(scenes) for name in config.cameras]
    for index, name in jobs:
        generator.render(index=index, camera=name)
    began = time.process_time()
    for index, name in jobs:
        generator.render(index=index, camera=name).objects
    spent = time.process_time() - began
print(json.dumps([fastgen.__version__, 1e3 * spent / len(jobs)]))
"""


def measured(tree: Path, quality: str, scenes: int) -> tuple[str, float]:
    """Return the version of a checkout, and the CPU ms of an image."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "LP_NUM_THREADS": "0"}
    done = subprocess.run(
        [sys.executable, "-c", _CHILD, quality, str(scenes)],
        cwd=tree,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    version, cpu_ms = json.loads(done.stdout)
    return version, cpu_ms


def main() -> None:
    """Print and store the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("other", type=Path, help="another checkout of fastgen")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--qualities", default="draft,balanced")
    options = parser.parse_args()
    other = options.other.resolve()
    found: dict[str, dict[str, float]] = {}
    version = ""
    for quality in options.qualities.split(","):
        pairs = []
        for _ in range(options.rounds):
            _, ours = measured(ROOT, quality, options.scenes)
            version, theirs = measured(other, quality, options.scenes)
            pairs.append((ours, theirs))
            print(f"{quality:10}{ours:8.1f} ms here{theirs:8.1f} ms in {version}", flush=True)
        here, there = (statistics.median(each) for each in zip(*pairs, strict=True))
        ratio = statistics.median(ours / theirs for ours, theirs in pairs)
        print(f"{quality:10}takes {ratio:.2f} times the CPU time of {version}")
        found[quality] = {"cpu_ms": here, "other_cpu_ms": there, "ratio": ratio}
    save("versions", {**origin(), "other": version, "qualities": found})


if __name__ == "__main__":
    main()
