"""Measure the CPU time of a labelled image by stage, and the images per second.

    python bench/throughput.py [--images 200] [--scenes 12] [--sizes 320x320,640x640,...]
        [--long 2000]
    python bench/throughput.py --redraw     # docs/throughput.png from the stored results

Runs every size on EGL and OSMesa, and every quality at 640x640. Stages are timed in one process
with warm caches, so every HDRI and mesh was used before. The rate of `fastgen generate` is given
for the whole run and for its last two thirds. In these short runs the workers still prepare some
meshes for the first time. For the long runs of `draft` that follow, they prepare everything in
advance.

Writes bench/results/throughput.json, docs/throughput.png and a table in docs/benchmarks.md.
`bench/peers.py` measures other tools.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

# one thread per process, like in `fastgen generate`; llvmpipe reads it at the first context
os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import charts
import numpy as np
from matplotlib.figure import Figure
from reporting import ROOT, machine, origin, parse_size, save, write_section

import fastgen
from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.dataset.storage import Folder
from fastgen.formats.format import Files, assemble
from fastgen.formats.item import Item
from fastgen.formats.registry import SEAFRONT, formats_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.labels.objects import label
from fastgen.labels.visibility import Shot
from fastgen.sample import Sample

STAGES = ("sample", "draw", "read", "label", "encode", "write")
BACKENDS = ("egl", "osmesa")
WORKERS = (1, 2)
SIZES = "320x320,640x640,1333x800,1920x1080"
USUAL = "640x640"
OTHER_QUALITIES = ("draft", "fine", "high")
LONG_RUNS = 3


def stages(
    backend: str, size: tuple[int, int], scenes: int, quality: str
) -> tuple[str, dict[str, float]]:
    """Return the driver's name, and the mean CPU ms of each stage per image, over all cameras."""
    times: dict[str, list[float]] = defaultdict(list)
    config = Config.preset()
    with (
        tempfile.TemporaryDirectory() as folder,
        Generator(config, seed=7, size=size, backend=backend, quality=quality) as generator,
    ):
        storage, formats = Folder(Path(folder)), formats_of(SEAFRONT)
        for index in range(scenes):
            for name in config.cameras:  # prepare meshes, lights and programs
                generator.render(index=index, camera=name)
        driver = generator.renderer_name
        renderer = generator.gpu.renderer()
        finish = renderer.ctx.finish
        clock = time.process_time  # CPU time of all threads: other programs do not count
        for index in range(scenes):
            began = clock()
            scene = generator.scene(index)
            times["sample"].append((clock() - began) / len(scene.cameras))
            prepared = PreparedScene(scene)
            together: Files = {}
            for camera in scene.cameras:
                t0 = clock()
                targets = renderer.draw(prepared, camera, size)
                finish()
                t1 = clock()
                frame = targets.read()
                t2 = clock()
                view = view_of(camera, size)
                objects = label(Shot(frame, prepared, view, config))
                t3 = clock()
                sample = Sample(
                    **vars(frame), scene=scene, camera=camera, view=view, objects=objects
                )
                stem = f"{index:06d}_{camera.name}"
                files, _ = assemble(Item(sample, "train", stem, 0, config.labels), formats)
                t4 = clock()
                together.update(files)
                times["draw"].append(t1 - t0)
                times["read"].append(t2 - t1)
                times["label"].append(t3 - t2)
                times["encode"].append(t4 - t3)
            began = clock()
            storage.commit(together, str(index))
            times["write"].append((clock() - began) / len(scene.cameras))
    return driver, {stage: statistics.fmean(times[stage]) * 1e3 for stage in STAGES}


def generate_command(
    out: str,
    images: int,
    workers: int,
    size: str,
    backend: str,
    quality: str = "balanced",
    device_index: int | None = None,
) -> list[str]:
    """Return the command line that writes a dataset of `images` images to the folder `out`."""
    command = [sys.executable, "-m", "fastgen", "generate", out, "--images", str(images)]
    command += ["--size", size, "--seed", "7", "--workers", str(workers)]
    command += ["--backend", backend, "--quality", quality]
    return command if device_index is None else [*command, "--device-index", str(device_index)]


class Rate(NamedTuple):
    """Images per second of a run.

    Attributes:
        whole: Of the whole run, start-up and contact sheet included.
        steady: Of its last two thirds, or the same as `whole` if all images were written at once.
    """

    whole: float
    steady: float


def whole_run(
    backend: str,
    size: str,
    images: int,
    workers: int,
    quality: str = "balanced",
    device_index: int | None = None,
) -> Rate:
    """Make a dataset with `fastgen generate` and return its rate."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command = generate_command(str(out), images, workers, size, backend, quality, device_index)
        began = time.perf_counter()
        subprocess.run(
            command,
            check=True,
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        taken = time.perf_counter() - began
        shards = sorted((out / "shards").glob("*.json"), key=lambda path: path.stat().st_mtime)
        made = np.cumsum([len(json.loads(path.read_text())["images"]) for path in shards])
        first = int(np.searchsorted(made, images / 3))
        spent = shards[-1].stat().st_mtime - shards[first].stat().st_mtime
        whole = images / taken
        return Rate(whole, float(made[-1] - made[first]) / spent if spent > 0 else whole)


def fill_caches(backend: str, images: int) -> None:
    """Make a small dataset once, so that the rates are not those of a machine's very first run."""
    whole_run(backend, "64x64", images, max(WORKERS))


def measure(size: str, backend: str, images: int, scenes: int, quality: str) -> dict[str, Any]:
    """Measure and print one row of the table."""
    driver, found = stages(backend, parse_size(size), scenes, quality)
    rates = {str(w): whole_run(backend, size, images, w, quality) for w in WORKERS}
    print(
        f"{size:11}{backend:8}{quality:10}"
        + "".join(f"{found[stage]:8.2f}" for stage in STAGES)
        + f"{sum(found.values()):8.2f}"
        + "".join(f"{whole:9.1f}{steady:9.1f}" for whole, steady in rates.values()),
        flush=True,
    )
    return {
        "size": size,
        "backend": backend,
        "quality": quality,
        "driver": driver,
        "stages_ms": found,
        "images_per_s": {workers: rate.whole for workers, rate in rates.items()},
        "steady_images_per_s": {workers: rate.steady for workers, rate in rates.items()},
    }


def long_runs(images: int) -> Rate:
    """Return the median rates of LONG_RUNS runs of `draft`, on EGL with the most workers."""
    runs = [whole_run(BACKENDS[0], USUAL, images, max(WORKERS), "draft") for _ in range(LONG_RUNS)]
    for whole, steady in runs:
        print(f"{images} images, draft: {whole:.1f} images/s, steady {steady:.1f}", flush=True)
    return Rate(*(statistics.median(rates) for rates in zip(*runs, strict=True)))


def table(rows: list[dict[str, Any]], about: str, images: int, long: tuple[int, Rate]) -> list[str]:
    """Return a Markdown table of the rows on EGL, and a line on the long run.

    Args:
        rows: Rows from `measure`.
        about: Description of the machine.
        images: Number of images of the short runs.
        long: Number of images and rate of the long runs.
    """
    shown = [row for row in rows if row["backend"] == "egl"]
    lines = [
        "CPU time in ms of a labelled image by stage, and images per second of `fastgen generate`",
        f"with two workers: over a whole run of {images} images, and over its last two thirds",
        f"(`python bench/throughput.py`, {about}, version {fastgen.__version__}):",
        "",
        "| quality | size | scene | draw | labels | files | CPU ms | images/s, run | steady |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in sorted(
        shown, key=lambda row: (row["size"] != USUAL, sum(row["stages_ms"].values()))
    ):
        ms = row["stages_ms"]
        parts = [ms["sample"], ms["draw"] + ms["read"], ms["label"], ms["encode"] + ms["write"]]
        cells = [f"{part:.0f}" for part in (*parts, sum(parts))]
        rates = [f"{row[kind]['2']:.1f}" for kind in ("images_per_s", "steady_images_per_s")]
        lines.append("| " + " | ".join([f"`{row['quality']}`", row["size"], *cells, *rates]) + " |")
    count, rate = long
    lines += [
        "",
        f"Runs of {count:,} images with `draft` at {USUAL}, median of {LONG_RUNS}: "
        f"{rate.whole:.1f} images/s,",
        f"{rate.steady:.1f} over the last two thirds.",
    ]
    return lines


def draw(figures: charts.Figures) -> Figure:
    """Return a chart of the stages, stacked, and of the images per second."""
    rows = figures["rows"]
    figure, (left, right) = charts.panels(1, 2, 0.36 * len(rows) + 1.6, sharey=True)
    places = np.arange(len(rows))
    before = np.zeros(len(rows))
    for stage in STAGES:
        values = np.array([row["stages_ms"][stage] for row in rows])
        left.barh(places, values, left=before, label=stage)
        before += values
    left.set(xlabel="CPU ms per labelled image", title="one process, by stage")
    left.set_yticks(places, [f"{row['quality']}, {row['size']}, {row['backend']}" for row in rows])
    for shift, workers in zip((-0.2, 0.2), WORKERS, strict=True):
        rates = [row["images_per_s"][str(workers)] for row in rows]
        name = f"{workers} worker" + "s" * (workers > 1)
        bars = right.barh(places + shift, rates, height=0.38, label=name)
        right.bar_label(bars, fmt="%.1f", fontsize=7, padding=2)
    right.set(xlabel="images per second", title="fastgen generate, start-up included")
    right.margins(x=0.15)
    left.invert_yaxis()
    left.legend(loc="upper right")
    right.legend(loc="lower right")
    driver = ", ".join(sorted({row["driver"] for row in rows}))
    charts.caption(figure, figures, f"{driver}; {figures['images']} images per run")
    return figure


def main() -> None:
    """Print the table and draw the chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument(
        "--scenes", type=int, default=12, help="scenes for the stages, 4 images each"
    )
    parser.add_argument("--sizes", default=SIZES)
    parser.add_argument("--long", type=int, default=2000, help="images of the long runs")
    charts.add_options(parser, "throughput")
    options = parser.parse_args()
    if charts.redrawn(options, "throughput", draw):
        return
    about = machine()
    print(f"{about}, no GPU unless the driver says so; {options.images} images per run\n")
    rates = "".join(f"{f'{w} work.':>9}{'steady':>9}" for w in WORKERS)
    print(f"{'CPU ms':29}" + "".join(f"{s:>8}" for s in STAGES) + f"{'sum':>8}{rates}")
    for backend in BACKENDS:
        fill_caches(backend, options.images)
    ways = [
        *((s, b, "balanced") for s in options.sizes.split(",") for b in BACKENDS),
        *((USUAL, BACKENDS[0], quality) for quality in OTHER_QUALITIES),
    ]
    rows = [
        measure(size, backend, options.images, options.scenes, quality)
        for size, backend, quality in ways
    ]
    driver = ", ".join(sorted({row["driver"] for row in rows}))
    print(f"\n{driver}; N work.: images per second with N workers; steady: last two thirds")
    long = options.long, long_runs(options.long)
    long_figures = {
        "images": long[0],
        "images_per_s": long[1].whole,
        "steady_images_per_s": long[1].steady,
    }
    figures = {**origin(), "images": options.images, "rows": rows, "long_runs": long_figures}
    save("throughput", figures)
    charts.write(draw(figures), options.chart)
    lines = table(rows, about, options.images, long)
    write_section("throughput", lines, ROOT / "docs" / "benchmarks.md")


if __name__ == "__main__":
    main()
