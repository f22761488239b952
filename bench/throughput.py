"""Where the time of a labelled image goes, and how many come in a second.

    python bench/throughput.py [--images 200] [--scenes 12] [--sizes 320x320,640x640,...]

For each size, on EGL and OSMesa: core-milliseconds an image by stage in one process (warm: every
HDRI and mesh was used before), and images a second of `fastgen generate` from start to finish.
Leaves bench/results/throughput.json and docs/throughput.png. `bench/peers.py` measures other tools.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

# one process a core, as `fastgen generate` runs; llvmpipe reads it at the first context
os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import matplotlib.pyplot as plt
import numpy as np
from results import ROOT, machine, parse_size, save

from fastgen import Config, Generator
from fastgen.camera import view_of
from fastgen.formats import SEAFRONT, Files, Item, assemble, formats_of
from fastgen.labels import label
from fastgen.sample import Sample
from fastgen.shapes import spreader_outline
from fastgen.storage import Folder
from fastgen.visibility import Shot

STAGES = ("sample", "draw", "read", "label", "encode", "write")
BACKENDS = ("egl", "osmesa")
WORKERS = (1, 2)
SIZES = "320x320,640x640,1333x800,1920x1080"


def stages(backend: str, size: tuple[int, int], scenes: int) -> tuple[str, dict[str, float]]:
    """The driver's name, and mean core-milliseconds an image of each stage over all cameras."""
    times: dict[str, list[float]] = defaultdict(list)
    config = Config.preset()
    with (
        tempfile.TemporaryDirectory() as folder,
        Generator(config, seed=7, size=size, backend=backend) as generator,
    ):
        storage, formats = Folder(Path(folder)), formats_of(SEAFRONT)
        for index in range(scenes):
            for name in config.cameras:  # make meshes, lights and programs
                generator.render(index=index, camera=name)
        driver = generator.renderer_name
        renderer = generator._gpu.renderer()
        finish = renderer._ctx.finish
        clock = time.process_time  # of all threads, so that other programs do not count
        for index in range(scenes):
            began = clock()
            scene = generator.scene(index)
            times["sample"].append((clock() - began) / len(scene.cameras))
            together: Files = {}
            for camera in scene.cameras:
                t0 = clock()
                targets = renderer.draw(scene, camera, size)
                finish()
                t1 = clock()
                frame = targets.read()
                t2 = clock()
                view = view_of(camera, size)
                mesh = renderer.mesh(scene.container)
                held = spreader_outline(scene, camera.lens is not None)
                objects = label(Shot(frame, scene, view, mesh, held, config))
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


def generate_command(out: str, images: int, workers: int, size: str, backend: str) -> list[str]:
    """The command line that makes a dataset of `images` images in the folder `out`."""
    command = [sys.executable, "-m", "fastgen", "generate", out, "--images", str(images)]
    command += ["--size", size, "--seed", "7", "--workers", str(workers), "--backend", backend]
    return command


def whole_run(backend: str, size: str, images: int, workers: int) -> float:
    """Images a second of the command, start-up and contact sheet included."""
    with tempfile.TemporaryDirectory() as folder:
        command = generate_command(f"{folder}/out", images, workers, size, backend)
        began = time.perf_counter()
        subprocess.run(
            command,
            check=True,
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        return images / (time.perf_counter() - began)


def fill_caches(backend: str, images: int) -> None:
    """Make the dataset once, small: the rates are not those of a machine's very first run."""
    whole_run(backend, "64x64", images, max(WORKERS))


def measure(size: str, backend: str, images: int, scenes: int) -> dict[str, Any]:
    """One row of the table, printed as soon as it is known."""
    driver, found = stages(backend, parse_size(size), scenes)
    rates = {str(workers): whole_run(backend, size, images, workers) for workers in WORKERS}
    print(
        f"{size:11}{backend:8}"
        + "".join(f"{found[stage]:9.2f}" for stage in STAGES)
        + f"{sum(found.values()):9.2f}"
        + "".join(f"{rate:11.1f}" for rate in rates.values()),
        flush=True,
    )
    return {
        "size": size,
        "backend": backend,
        "driver": driver,
        "stages_ms": found,
        "images_per_s": rates,
    }


def draw(rows: list[dict[str, Any]], caption: str, chart: Path) -> None:
    """Stacked stages on the left, images a second on the right."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4))
    names = [f"{row['size']}\n{row['backend']}" for row in rows]
    places = np.arange(len(rows))
    below = np.zeros(len(rows))
    for stage in STAGES:
        values = np.array([row["stages_ms"][stage] for row in rows])
        left.bar(places, values, bottom=below, label=stage)
        below += values
    left.set(ylabel="core-ms a labelled image", title="one process, by stage")
    for shift, workers in zip((-0.2, 0.2), WORKERS, strict=True):
        rates = [row["images_per_s"][str(workers)] for row in rows]
        bars = right.bar(places + shift, rates, width=0.38, label=f"{workers} worker(s)")
        right.bar_label(bars, fmt="%.1f", fontsize=7)
    right.set(ylabel="images a second", title="fastgen generate, start-up included")
    for axes in (left, right):
        axes.set_xticks(places, names, fontsize=7)
        axes.legend(fontsize=8)
    figure.text(0.5, 0.005, caption, ha="center", fontsize=8)
    figure.tight_layout(rect=(0, 0.03, 1, 1))
    chart.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(chart, dpi=110)


def main() -> None:
    """Print the table and draw the chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--scenes", type=int, default=12, help="for the stages, 4 images each")
    parser.add_argument("--sizes", default=SIZES)
    parser.add_argument("--chart", type=Path, default=ROOT / "docs" / "throughput.png")
    options = parser.parse_args()
    about = machine()
    print(f"{about}, no GPU unless the driver says so; {options.images} images a run\n")
    rates = "".join(f"{f'{w} worker/s':>11}" for w in WORKERS)
    print(f"{'core-ms':19}" + "".join(f"{s:>9}" for s in STAGES) + f"{'sum':>9}{rates}")
    for backend in BACKENDS:
        fill_caches(backend, options.images)
    rows = [
        measure(size, backend, options.images, options.scenes)
        for size in options.sizes.split(",")
        for backend in BACKENDS
    ]
    driver = ", ".join(sorted({row["driver"] for row in rows}))
    caption = f"{about}; {driver}; {options.images} images a run"
    print(f"\n{driver}; N worker/s: images a second with N workers")
    save("throughput", {"machine": about, "images": options.images, "rows": rows})
    draw(rows, caption, options.chart)


if __name__ == "__main__":
    main()
