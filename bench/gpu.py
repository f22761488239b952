"""Measure what a GPU gains: rates to disk, to a training loop and into CUDA memory.

    python bench/gpu.py [--qualities draft,balanced] [--size 640x640] [--images 120]
        [--batch 16] [--processes N] [--device-index N]

Measures for each quality, with warm caches (lights, meshes and programs):

Labelled frames per second and CPU time per frame of `Generator.render`, and of
`Generator.render_batch` with --batch images at a time. Needs no NVIDIA GPU.

GPU time of a draw, from its first command to its last, and CPU time to issue the commands.

Frames per second into CUDA memory, with one process and with N at once. Each frame is cloned into
tensors of image, labels and depth.

Images per second through the Loader of fastgen.torch with N workers, copied to the GPU, boxes
included.

Images per second of `fastgen generate` with N workers, over the last two thirds of the run.

N defaults to the number of cores. Some frames in CUDA memory are compared with `Generator.render`.
Without an NVIDIA GPU, prints the reason, and measures only `render`, `render_batch` and the rate to
disk. Needs PyTorch. On a GPU, writes the table in docs/scale.md and bench/results/gpu.json.
"""

import argparse
import multiprocessing
import os
import statistics
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from reporting import ROOT, origin, parse_size, save, write_section
from throughput import whole_run

import fastgen
from fastgen import Config, Generator
from fastgen.errors import FastgenError
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.settings import QUALITY
from fastgen.torch import ContainerDataset, Loader, RenderSettings
from fastgen.validation import check_known

CAMERAS = tuple(Config.preset().cameras)
SEED = 7
COMPARED = 16
SHARD = 16
"""Images per Loader batch; also the default shard size of `generate`."""

LONGEST_S = 300
"""Longest wait for another process, so that nobody hangs if one has died."""


@dataclass(frozen=True)
class LabelledSpeed:
    """Speed of one process that renders labelled frames.

    Attributes:
        rate: Frames per second.
        cpu_ms: CPU time of the process per frame.
    """

    rate: float
    cpu_ms: float


@dataclass(frozen=True)
class Row:
    """Results of one quality.

    Attributes:
        single: Frames of `render`.
        batch: Frames of `render_batch`.
        gpu_ms: GPU time of a draw.
        cpu_ms: CPU time to issue the commands of a draw.
        same: Number of COMPARED frames that are bit-identical in CUDA memory and from `render`.
        alone: Frames per second into CUDA memory with one process.
        together: Frames per second into CUDA memory, all processes together.
        loader: Images per second through the Loader.
        disk: Images per second of `fastgen generate`.
    """

    quality: str
    single: LabelledSpeed
    batch: LabelledSpeed
    gpu_ms: float
    cpu_ms: float
    same: int
    alone: float
    together: float
    loader: float
    disk: float


def shown(number: int) -> tuple[int, str]:
    """Return the scene index and the camera of image `number`."""
    return number // len(CAMERAS), CAMERAS[number % len(CAMERAS)]


def in_tensors(generator: Generator, number: int) -> list[torch.Tensor]:
    """Return image, labels and depth of an image in newly allocated tensors."""
    frame = generator.render_cuda(*shown(number))
    arrays = (frame.image, frame.labels, frame.depth)
    return [torch.as_tensor(array, device="cuda").clone() for array in arrays]


def opened(options: argparse.Namespace, quality: str) -> Generator:
    """Return a generator with lights and meshes loaded."""
    generator = Generator(
        seed=SEED,
        size=parse_size(options.size),
        backend="egl",
        quality=quality,
        device_index=options.device_index,
    )
    generator.preload()
    return generator


def count_same(generator: Generator) -> int:
    """Return how many of COMPARED frames are bit-identical in CUDA memory and from `render`."""
    same = 0
    for number in range(COMPARED):
        sample = generator.render(*shown(number))
        image, labels, depth = (t.cpu().numpy() for t in in_tensors(generator, number))
        pairs = [
            (image, np.dstack([sample.image, sample.cover])),
            (labels, sample.ids | sample.damage.astype(np.uint32) << 16),
            (depth.view(np.uint32), sample.depth.view(np.uint32)),
        ]
        same += all(np.array_equal(*pair) for pair in pairs)
    return same


def labelled_frames(
    generator: Generator, images: int, batch: int
) -> tuple[LabelledSpeed, LabelledSpeed]:
    """Return the speed of `render` and of `render_batch`.

    Both take turns, batch by batch, so that load of other processes affects both alike.
    """
    seconds, cpu = np.zeros(2), np.zeros(2)
    for first in range(0, images, batch):
        indices, cameras = zip(*map(shown, range(first, min(first + batch, images))), strict=True)
        # loads the lights of the scenes, so that neither way is timed with that
        generator.render_batch(indices, cameras)
        for way in (0, 1) if first // batch % 2 else (1, 0):
            began, used = time.perf_counter(), time.process_time()
            if way:
                generator.render_batch(indices, cameras)
            else:
                for each in zip(indices, cameras, strict=True):
                    generator.render(*each)
            seconds[way] += time.perf_counter() - began
            cpu[way] += time.process_time() - used
    single, batched = zip((images / seconds).tolist(), (1e3 * cpu / images).tolist(), strict=True)
    return LabelledSpeed(*single), LabelledSpeed(*batched)


def draw_ms(generator: Generator, images: int) -> tuple[float, float]:
    """Return the mean milliseconds of a draw.

    Returns:
        GPU time between first and last command, and time on the CPU until all commands are issued.
    """
    gpu, cpu = [], []
    with generator.gpu.drawing() as renderer:
        query = renderer.ctx.query(time=True)
        for number in range(images):
            index, name = shown(number)
            scene = generator.scene(index)
            prepared = PreparedScene(scene)
            began = time.perf_counter()
            with query:
                renderer.draw(prepared, scene.camera(name), generator.size)
            cpu.append(time.perf_counter() - began)
            gpu.append(query.elapsed / 1e6)  # waits for the GPU
    return statistics.fmean(gpu), statistics.fmean(cpu) * 1e3


def fill_tensors(generator: Generator, images: int) -> tuple[float, float]:
    """Copy images into tensors; return the start and the end in seconds."""
    began = time.perf_counter()
    for number in range(images):
        in_tensors(generator, number)
    torch.cuda.synchronize()
    return began, time.perf_counter()


def fill_beside_others(options: argparse.Namespace, quality: str, barrier: Any, spans: Any) -> None:
    """Run one of several processes: warm up, wait for the others, then fill tensors."""
    with opened(options, quality) as generator:
        fill_tensors(generator, options.images)
        barrier.wait()
        spans.put(fill_tensors(generator, options.images))
        barrier.wait()  # no process shuts down while others still measure


def rate_together(options: argparse.Namespace, quality: str) -> float:
    """Return the frames per second of all processes together."""
    context = multiprocessing.get_context("spawn")
    barrier, spans = context.Barrier(options.processes, timeout=LONGEST_S), context.Queue()
    arguments = options, quality, barrier, spans
    started = [
        context.Process(target=fill_beside_others, args=arguments, daemon=True)
        for _ in range(options.processes)
    ]
    for process in started:
        process.start()
    starts, ends = zip(*(spans.get(timeout=LONGEST_S) for _ in started), strict=True)
    for process in started:
        process.join()
    rate: float = len(started) * options.images / (max(ends) - min(starts))
    return rate


def loader_rate(options: argparse.Namespace, quality: str) -> float:
    """Return the images per second that reach the GPU through a Loader.

    Measures the second half of an epoch, when the workers have loaded most lights.
    """
    workers = options.processes
    length = 4 * workers * -(-options.images // SHARD) * SHARD
    data = ContainerDataset(
        "damage",
        seed=SEED,
        length=length,
        render=RenderSettings(
            parse_size(options.size), quality, "egl", device_index=options.device_index
        ),
    )
    loader = Loader(
        data, SHARD, num_workers=workers, pin_memory=True, multiprocessing_context="spawn"
    )
    came = 0
    for images, _ in loader:
        came += len(images)
        torch.stack(list(images)).cuda(non_blocking=True)
        torch.cuda.synchronize()
        if came * 2 == length:
            began = time.perf_counter()
    rate: float = length / 2 / (time.perf_counter() - began)
    return rate


def disk_rate(options: argparse.Namespace, quality: str) -> float:
    """Return the images per second of `fastgen generate`."""
    many = options.processes
    images, device = options.images * many, options.device_index
    return whole_run("egl", options.size, images, many, quality, device).steady


def measure(options: argparse.Namespace, quality: str) -> Row:
    """Measure one quality."""
    disk = disk_rate(options, quality)
    with opened(options, quality) as generator:
        single, batch = labelled_frames(generator, options.images, options.batch)
        same = count_same(generator)
        fill_tensors(generator, options.images)
        began, ended = fill_tensors(generator, options.images)
        gpu_ms, cpu_ms = draw_ms(generator, options.images)
    alone, together = options.images / (ended - began), rate_together(options, quality)
    loader = loader_rate(options, quality)
    return Row(quality, single, batch, gpu_ms, cpu_ms, same, alone, together, loader, disk)


def table(rows: list[Row], about: str, options: argparse.Namespace) -> list[str]:
    """Return the rows as Markdown."""
    many = options.processes
    lines = [
        f"Images of {options.size} on {about}",
        f"(`python bench/gpu.py`); {many} processes or workers where not stated otherwise:",
        "",
        "| quality | `render`, frames/s, CPU ms | `render_batch`, frames/s, CPU ms | "
        "GPU ms per draw | CPU ms per draw | frames/s into CUDA, 1 process | "
        f"{many} processes | Loader, images/s | to disk, images/s |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        cells = [f"{each.rate:.0f}, {each.cpu_ms:.1f}" for each in (row.single, row.batch)]
        cells += [f"{row.gpu_ms:.2f}", f"{row.cpu_ms:.1f}"]
        cells += [f"{rate:.0f}" for rate in (row.alone, row.together, row.loader, row.disk)]
        lines.append("| " + " | ".join([f"`{row.quality}`", *cells]) + " |")
    same, compared = sum(row.same for row in rows), COMPARED * len(rows)
    lines += [
        "",
        f"{same} of {compared} frames in CUDA memory are bit-identical to those of `render`.",
    ]
    return lines


def main() -> None:
    """Print the results of each quality, or why only the rate to disk can be measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--qualities", default="draft,balanced")
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--images", type=int, default=120, help="images per process")
    parser.add_argument("--batch", type=int, default=16, help="images per call of render_batch")
    parser.add_argument("--processes", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--device-index", type=int, help="GPU to use, in the order of EGL devices")
    options = parser.parse_args()
    parse_size(options.size)
    if min(options.processes, options.batch) < 1 or options.images < 3 * SHARD:
        raise SystemExit(
            f"--processes and --batch must be at least 1, --images at least {3 * SHARD}"
        )
    with Generator(backend="egl", device_index=options.device_index) as generator:
        driver, reason = generator.renderer_name, generator.cuda_reason()
    if not reason and not torch.cuda.is_available():
        reason = "PyTorch cannot use CUDA: its build or the driver lacks it"
    about = f"{driver} and {origin()['machine']}"
    print(f"{about}; {options.size}, {options.processes} processes")
    qualities = options.qualities.split(",")
    for quality in qualities:
        check_known("qualities", quality, tuple(QUALITY))
    if reason:
        print(f"CUDA not measured: {reason}")
        for quality in qualities:
            with opened(options, quality) as generator:
                frames = labelled_frames(generator, options.images, options.batch)
            for name, each in zip(("render", "render_batch"), frames, strict=True):
                print(
                    f"{quality}: {name} {each.rate:.1f} frames/s, {each.cpu_ms:.1f} ms of CPU time"
                )
            print(f"{quality}: {disk_rate(options, quality):.1f} images/s to disk", flush=True)
        return
    rows = []
    for quality in qualities:
        rows.append(measure(options, quality))
        print(rows[-1], flush=True)
    figures = {**origin(), "driver": driver, "options": vars(options)}
    save("gpu", {**figures, "rows": [asdict(row) for row in rows]})
    about = f"{about}, version {fastgen.__version__}"
    write_section("gpu", table(rows, about, options), ROOT / "docs" / "scale.md")


if __name__ == "__main__":
    try:
        main()
    except FastgenError as error:
        raise SystemExit(f"gpu.py: {error}") from None
