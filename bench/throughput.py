"""Where the time of a labelled image goes, and how many come in a second.

    python bench/throughput.py [--images 200] [--size 640x640]

Prints, for EGL and OSMesa, core-milliseconds an image by stage in one process (warm: every HDRI and
mesh was used before), and images a second of `fastgen generate` from start to finish.
"""

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

# one process a core, as `fastgen generate` runs; llvmpipe reads it at the first context
os.environ.setdefault("LP_NUM_THREADS", "0")

from fastgen import Config, Generator
from fastgen.camera import view_of
from fastgen.formats import SEAFRONT, Item, assemble, formats_of
from fastgen.labels import label
from fastgen.sample import Sample
from fastgen.storage import Folder
from fastgen.visibility import Shot

STAGES = ("sample", "draw", "read", "label", "encode", "write")


def stages(backend: str, size: tuple[int, int], scenes: int) -> dict[str, float]:
    """Median milliseconds an image of each stage, over the second half of the scenes."""
    times: dict[str, list[float]] = defaultdict(list)
    config = Config.preset()
    with (
        tempfile.TemporaryDirectory() as folder,
        Generator(config, seed=7, size=size, backend=backend) as generator,
    ):
        storage, formats = Folder(Path(folder)), formats_of(SEAFRONT)
        for index in range(scenes):
            for camera in config.cameras:  # make meshes, lights and programs
                generator.render(index=index, camera=camera)
        renderer = generator._open()
        finish = renderer._ctx.finish
        for index in range(scenes):
            began = time.perf_counter()
            scene = generator.scene(index)
            times["sample"].append((time.perf_counter() - began) / len(scene.cameras))
            for camera in scene.cameras:
                t0 = time.perf_counter()
                targets = renderer.draw(scene, camera, size)
                finish()
                t1 = time.perf_counter()
                frame = targets.read()
                t2 = time.perf_counter()
                view = view_of(camera, size)
                mesh = renderer.mesh(scene.container)
                held = renderer.spreader_mesh(scene)
                objects = label(Shot(frame, scene, view, mesh, held, config))
                t3 = time.perf_counter()
                sample = Sample(
                    **vars(frame), scene=scene, camera=camera, view=view, objects=objects
                )
                stem = f"{index:06d}_{camera.name}"
                files, _ = assemble(Item(sample, "train", stem, 0, config.labels), formats)
                t4 = time.perf_counter()
                storage.commit(files, stem)
                t5 = time.perf_counter()
                times["draw"].append(t1 - t0)
                times["read"].append(t2 - t1)
                times["label"].append(t3 - t2)
                times["encode"].append(t4 - t3)
                times["write"].append(t5 - t4)
    return {stage: statistics.fmean(times[stage]) * 1e3 for stage in STAGES}


def whole_run(backend: str, size: str, images: int, workers: int) -> float:
    """Images a second of the command, start-up and contact sheet included."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "fastgen", "generate", f"{folder}/out"]
        command += ["--images", str(images), "--size", size, "--seed", "7"]
        command += ["--workers", str(workers), "--backend", backend]
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return images / (time.perf_counter() - began)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--size", default="640x640")
    options = parser.parse_args()
    width, height = (int(v) for v in options.size.split("x"))
    cores = len(os.sched_getaffinity(0))
    print(
        f"{platform.machine()}, {cores} cores, {options.size}, no GPU unless the driver says so\n"
    )
    print(f"{'ms an image':12}" + "".join(f"{s:>9}" for s in STAGES) + f"{'sum':>9}")
    for backend in ("egl", "osmesa"):
        found = stages(backend, (width, height), scenes=12)
        total = sum(found.values())
        print(f"{backend:12}" + "".join(f"{found[s]:9.2f}" for s in STAGES) + f"{total:9.2f}")
    print(f"\n{'images/s':12}{'1 worker':>10}{f'{cores} workers':>12}   ({options.images} images)")
    for backend in ("egl", "osmesa"):
        rates = [
            whole_run(backend, options.size, options.images, workers) for workers in (1, cores)
        ]
        print(f"{backend:12}{rates[0]:10.1f}{rates[1]:12.1f}")


if __name__ == "__main__":
    main()
