"""Compare the cost of a labelled image with that of other tools.

    python bench/peers.py --install                      # once: an environment for each peer
    python bench/peers.py [--scenes 2] [--cameras A,B,Cl,Cr] [--size 640x640]

All tools, fastgen included, draw the same scenes from the same cameras at the same size in one run.
Each has its own process and virtual environment, because their pinned packages conflict. The scenes
are simpler than fastgen's own (see peer_jobs.py). The peers' labels are plain id images, while
fastgen's include boxes, masks and polygons. The overlap with fastgen's ids checks that the images
agree. The time to open a scene is not included in the cost of an image. Peers that cannot run are
listed with the reason. Writes bench/results/peers.json and docs/peers.png.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import charts
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter
from numpy.typing import NDArray
from peer_jobs import with_effort, write_jobs
from reporting import ROOT, origin, parse_size, save

from fastgen import Config, Generator

ENVIRONMENTS = ROOT / "bench" / ".peers"
SCRIPTS = ROOT / "bench" / "peer_renderers"
TIMEOUT_S = 3600


@dataclass(frozen=True)
class Peer:
    """A tool to measure.

    Attributes:
        name: Name in the table.
        script: Script in peer_renderers.
        arguments: Extra arguments of the script.
        environment: Folder of its virtual environment, or '' for the current one.
        requirements: Packages that pip installs there.
        python: The only Python version with wheels of the tool, or '' for any.
        samples: Samples per pixel, if the tool lets us choose.
        slow: Draw each view only once.
        settings: Environment variables.
    """

    name: str
    script: str
    arguments: tuple[str, ...] = ()
    environment: str = ""
    requirements: tuple[str, ...] = ()
    python: str = ""
    samples: int = 1
    slow: bool = False
    settings: tuple[tuple[str, str], ...] = ()

    @property
    def interpreter(self) -> Path:
        """The Python that runs the script."""
        if not self.environment:
            return Path(sys.executable)
        return ENVIRONMENTS / self.environment / "bin" / "python"


_CYCLES: dict[str, Any] = {
    "script": "with_cycles.py",
    "environment": "cycles",
    "requirements": ("bpy==4.5.15",),
    "python": "3.11",
    "slow": True,
}

PEERS = (
    Peer("fastgen, balanced", "with_fastgen.py", ("balanced",)),
    Peer("fastgen, draft", "with_fastgen.py", ("draft",)),
    Peer(
        "pyrender, colour + segmentation",
        "with_pyrender.py",
        environment="pyrender",
        # it uses np.infty, which numpy 2 removed
        requirements=("pyrender==0.1.45", "numpy<2", "trimesh", "pillow"),
    ),
    Peer(
        "PyVista, PBR + painted ids",
        "with_pyvista.py",
        environment="pyvista",
        requirements=("pyvista==0.49.1", "trimesh", "pillow"),
    ),
    Peer(
        "Open3D (Filament), colour + painted ids",
        "with_open3d.py",
        environment="open3d",
        requirements=("open3d==0.20.0", "trimesh", "pillow"),
        settings=(("XDG_RUNTIME_DIR", tempfile.gettempdir()),),
    ),
    Peer("Cycles 16 spp denoised + id render", arguments=("denoise",), samples=16, **_CYCLES),
    Peer("Cycles 128 spp + a mask per marker", arguments=("masks",), samples=128, **_CYCLES),
    Peer("Cycles as set up by Kubric", arguments=("kubric",), samples=128, **_CYCLES),
    Peer("Cycles as set up by BlenderProc", arguments=("blenderproc",), samples=1024, **_CYCLES),
)


def install(peer: Peer) -> str:
    """Create the peer's environment; return why that failed, or ''."""
    if not peer.environment:
        return ""
    folder = ENVIRONMENTS / peer.environment
    wanted = f"python{peer.python}" if peer.python else sys.executable
    if peer.python == f"{sys.version_info.major}.{sys.version_info.minor}":
        wanted = sys.executable
    if shutil.which(wanted) is None:
        return f"needs {wanted}, which is not on the PATH; install it and try again"
    for command in (
        [wanted, "-m", "venv", str(folder)],
        [str(peer.interpreter), "-m", "pip", "install", "--quiet", *peer.requirements],
    ):
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            return _last_words(done.stderr)
    return ""


def run(peer: Peer, job: Path, out: Path) -> dict[str, Any]:
    """Run a peer's script on a job; return its result.json, or {'failed': reason}."""
    if not peer.interpreter.exists():
        return {"failed": "not installed: python bench/peers.py --install"}
    command = [
        str(peer.interpreter),
        str(SCRIPTS / peer.script),
        str(job),
        str(out),
    ]
    variables = {**os.environ, **dict(peer.settings)}
    if peer.environment:
        variables.pop("LP_NUM_THREADS", None)  # peers use all cores, which is their default
        variables.pop("PYTHONPATH", None)
    else:
        variables["PYTHONPATH"] = str(ROOT)
    try:
        done = subprocess.run(
            [*command, *peer.arguments],
            capture_output=True,
            text=True,
            env=variables,
            timeout=TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        return {"failed": f"took longer than {TIMEOUT_S} s"}
    # some libraries crash at exit, after the result is written
    if not (out / "result.json").exists():
        return {"failed": _last_words(done.stderr) or f"exit code {done.returncode}"}
    result: dict[str, Any] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return result


def _last_words(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:200] if lines else ""


def summary(
    result: dict[str, Any], out: Path, truths: list[tuple[int, str, NDArray[np.uint16]]]
) -> dict[str, Any]:
    """Return median times in ms, and the overlap of container and markers with fastgen's ids."""
    laps = result["laps"]
    walls, cores = (
        {stage: statistics.median(lap[i] for lap in laps[stage]) for stage in laps} for i in (0, 1)
    )
    whole: list[float] = []
    marks: list[float] = []
    for index, camera, truth in truths:
        with np.load(out / f"{index:06d}_{camera}.npz") as stored:
            ids = stored["ids"]
        if (ids == 1).any():  # binary masks contain only markers
            whole.append(_overlap(ids > 0, truth > 0))
        marks += [_overlap(ids == i, truth == i) for i in np.unique(truth[truth > 1])]
    return {
        "version": result["version"],
        "set-up": walls["set-up"],
        "colour": walls["colour"],
        "labels": walls["labels"],
        "image": walls["colour"] + walls["labels"],
        "cores": cores["colour"] + cores["labels"],
        "container overlap": statistics.fmean(whole) if whole else None,
        "marker overlap": statistics.median(marks) if marks else None,
    }


def _overlap(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Return the intersection over union of two masks."""
    return float((a & b).sum() / max((a | b).sum(), 1))


def show(found: dict[str, dict[str, Any]]) -> None:
    """Print the table."""
    columns = ("set-up", "colour", "labels", "image", "cores")
    print(f"\n{'median ms':42}" + "".join(f"{c:>10}" for c in columns) + f"{'overlap':>14}")
    for name, row in found.items():
        if "failed" in row:
            print(f"{name:42}  not measured: {row['failed']}")
            continue
        overlaps = "/".join(
            "-" if row[key] is None else f"{row[key]:.3f}"
            for key in ("container overlap", "marker overlap")
        )
        print(f"{name:42}" + "".join(f"{row[c]:10.1f}" for c in columns) + f"{overlaps:>14}")
    print("\nset-up: per scene, not part of `image`. image: colour + labels, wall time, all cores.")
    print("cores: CPU time per image. overlap: IoU of container/markers with fastgen's ids.")


def draw(figures: charts.Figures) -> Figure:
    """Return a bar chart of wall and CPU time per labelled image, on a logarithmic axis."""
    rows = {name: row for name, row in figures["peers"].items() if "failed" not in row}
    figure, axes = charts.panels(1, 1, 0.55 * len(rows) + 1.0)
    for shift, key, label in ((-0.2, "image", "wall time"), (0.2, "cores", "CPU time")):
        places = np.arange(len(rows)) + shift
        values = [row[key] for row in rows.values()]
        bars = axes.barh(places, values, height=0.38, label=label)
        axes.bar_label(bars, fmt=lambda v: f"{v:,.0f} ms", padding=3, fontsize=8)
    axes.set_yticks(np.arange(len(rows)), [textwrap.fill(name, 22) for name in rows])
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlim(1, axes.get_xlim()[1] * 5)
    axes.set_xlabel("ms per labelled image (median)")
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    axes.legend(loc="upper right")
    charts.caption(figure, figures, f"{figures['size']}, {figures['views']} views")
    return figure


def main() -> None:
    """Install or measure the peers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--install", action="store_true")
    parser.add_argument("--only", default="", help="use only peers whose name contains this")
    parser.add_argument("--scenes", type=int, default=2)
    parser.add_argument("--cameras", default="A,B,Cl,Cr")
    parser.add_argument("--size", default="640x640")
    parser.add_argument(
        "--repeats", type=int, default=5, help="draws per view; Cycles draws each once"
    )
    parser.add_argument(
        "--samples", type=int, help="samples per pixel of Cycles, instead of 16 to 1,024"
    )
    charts.add_options(parser, "peers")
    options = parser.parse_args()
    if charts.redrawn(options, "peers", draw):
        return
    peers = [peer for peer in PEERS if options.only.lower() in peer.name.lower()]
    if options.install:
        for peer in {peer.environment: peer for peer in peers if peer.environment}.values():
            print(f"{peer.environment}: {install(peer) or 'installed'}", flush=True)
        return
    cameras = options.cameras.split(",")
    found: dict[str, dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as place:
        job = Path(place) / "job"
        with Generator(Config.preset(), seed=7, size=parse_size(options.size)) as generator:
            truths = write_jobs(generator, list(range(options.scenes)), cameras, 1, job)
        for number, peer in enumerate(peers):
            samples = options.samples or peer.samples
            with_effort(job, samples, 1 if peer.slow else options.repeats)
            out = Path(place) / str(number)
            result = run(peer, job, out)
            found[peer.name] = result if "failed" in result else summary(result, out, truths)
            print(f"{peer.name}: {found[peer.name]}", file=sys.stderr, flush=True)
    figures = {**origin(), "size": options.size, "views": len(truths), "peers": found}
    print(f"{options.size}, {len(truths)} views, {figures['machine']}")
    show(found)
    if options.samples:
        print(f"trial run with {options.samples} samples per pixel in Cycles: nothing is stored")
        return
    save("peers", figures)
    charts.write(draw(figures), options.chart)


if __name__ == "__main__":
    main()
