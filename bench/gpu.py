"""What a GPU gains: images a second to disk, to a training loop and into CUDA's memory.

    python bench/gpu.py [--qualities draft,balanced] [--size 640x640] [--images 120]
        [--processes N] [--device-index N]

For each quality: milliseconds that the GPU takes for a draw, from its first command to its last,
and that the processor takes to give these; frames a second into CUDA's memory, each cloned to
tensors of image, labels and depth, by one process and by N at once; images a second through
fastgen.torch's Loader with N workers, copied to the GPU, their boxes made beside them; and of
`fastgen generate` with N workers, once it runs. Warm: lights, shapes and programs were made before.
N is by default as many as there are cores. Some frames in CUDA's memory are compared with
`Generator.render`'s. Where no NVIDIA GPU draws, prints why and the disk's rate alone. Needs
PyTorch. On a GPU it fills the table in docs/scale.md and leaves bench/results/gpu.json.
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
from results import ROOT, origin, parse_size, save, write_section
from throughput import whole_run

import fastgen
from fastgen import Config, Generator
from fastgen.errors import FastgenError
from fastgen.generator import QUALITY
from fastgen.records import check_known
from fastgen.torch import ContainerDataset, Loader

CAMERAS = tuple(Config.preset().cameras)
SEED = 7
COMPARED = 16
SHARD = 16
"""Images of a batch of the Loader, and by default of a shard of `generate`."""

LONGEST_S = 300
"""For one process to be ready; if another has died, nobody waits longer."""


@dataclass(frozen=True)
class Row:
    """What one quality came to: milliseconds a draw, images a second, and of COMPARED frames how
    many CUDA has as `render` gives them.

    alone, together: into CUDA's memory, by one process and by all.
    """

    quality: str
    gpu_ms: float
    cpu_ms: float
    same: int
    alone: float
    together: float
    loader: float
    disk: float


def shown(number: int) -> tuple[int, str]:
    """Scene and camera of image `number`."""
    return number // len(CAMERAS), CAMERAS[number % len(CAMERAS)]


def in_tensors(generator: Generator, number: int) -> list[torch.Tensor]:
    """Image, labels and depth of an image, in tensors of their own."""
    frame = generator.render_cuda(*shown(number))
    arrays = (frame.image, frame.labels, frame.depth)
    return [torch.as_tensor(array, device="cuda").clone() for array in arrays]


def opened(options: argparse.Namespace, quality: str) -> Generator:
    """A generator whose lights and shapes are made."""
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
    """Of COMPARED frames, those that CUDA has bit for bit as `render` gives them."""
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


def draw_ms(generator: Generator, images: int) -> tuple[float, float]:
    """Mean milliseconds of a draw, of the GPU between its first command and its last, and of the
    processor until all commands are given."""
    gpu, cpu = [], []
    with generator._gpu.drawing() as renderer:
        query = renderer._ctx.query(time=True)
        for number in range(images):
            index, name = shown(number)
            scene = generator.scene(index)
            began = time.perf_counter()
            with query:
                renderer.draw(scene, scene.camera(name), generator.size)
            cpu.append(time.perf_counter() - began)
            gpu.append(query.elapsed / 1e6)  # waits for it
    return statistics.fmean(gpu), statistics.fmean(cpu) * 1e3


def fill_tensors(generator: Generator, images: int) -> tuple[float, float]:
    """From when to when images come into tensors."""
    began = time.perf_counter()
    for number in range(images):
        in_tensors(generator, number)
    torch.cuda.synchronize()
    return began, time.perf_counter()


def fill_beside_others(options: argparse.Namespace, quality: str, barrier: Any, spans: Any) -> None:
    """One process of several: warm up, then wait for the others, and fill tensors."""
    with opened(options, quality) as generator:
        fill_tensors(generator, options.images)
        barrier.wait()
        spans.put(fill_tensors(generator, options.images))
        barrier.wait()  # nobody's end disturbs the others


def rate_together(options: argparse.Namespace, quality: str) -> float:
    """Frames a second of all processes together."""
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
    return len(started) * options.images / (max(ends) - min(starts))


def loader_rate(options: argparse.Namespace, quality: str) -> float:
    """Images a second that reach the GPU through a Loader, in the second half of an epoch, when
    its workers have met most lights."""
    workers = options.processes
    length = 4 * workers * -(-options.images // SHARD) * SHARD
    data = ContainerDataset(
        "damage",
        seed=SEED,
        size=parse_size(options.size),
        length=length,
        backend="egl",
        quality=quality,
        device_index=options.device_index,
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
    return length / 2 / (time.perf_counter() - began)


def disk_rate(options: argparse.Namespace, quality: str) -> float:
    """Images a second of `fastgen generate`."""
    many = options.processes
    images, device = options.images * many, options.device_index
    return whole_run("egl", options.size, images, many, quality, device).steady


def measure(options: argparse.Namespace, quality: str) -> Row:
    """One row."""
    disk = disk_rate(options, quality)
    with opened(options, quality) as generator:
        same = count_same(generator)
        fill_tensors(generator, options.images)
        began, ended = fill_tensors(generator, options.images)
        gpu_ms, cpu_ms = draw_ms(generator, options.images)
    alone, together = options.images / (ended - began), rate_together(options, quality)
    return Row(quality, gpu_ms, cpu_ms, same, alone, together, loader_rate(options, quality), disk)


def table(rows: list[Row], about: str, options: argparse.Namespace) -> list[str]:
    """Markdown."""
    many = options.processes
    lines = [
        f"Images of {options.size} on {about}",
        f"(`python bench/gpu.py`); {many} processes where several work:",
        "",
        "| quality | GPU ms a draw | CPU ms a draw | frames/s into CUDA, 1 process | "
        f"{many} processes | Loader, images/s | to disk, images/s |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        cells = [f"{row.gpu_ms:.2f}", f"{row.cpu_ms:.1f}"]
        cells += [f"{rate:.0f}" for rate in (row.alone, row.together, row.loader, row.disk)]
        lines.append("| " + " | ".join([f"`{row.quality}`", *cells]) + " |")
    same, compared = sum(row.same for row in rows), COMPARED * len(rows)
    lines += [
        "",
        f"{same} of {compared} frames in CUDA's memory are those of `render`, bit for bit.",
    ]
    return lines


def main() -> None:
    """Print what each quality comes to, or the reason that there is no more than the disk's."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--qualities", default="draft,balanced")
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--images", type=int, default=120, help="of each process")
    parser.add_argument("--processes", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--device-index", type=int, help="in EGL's order")
    options = parser.parse_args()
    parse_size(options.size)
    if options.processes < 1 or options.images < 3 * SHARD:
        raise SystemExit(f"give --processes of 1 or more and --images of {3 * SHARD} or more")
    with Generator(backend="egl", device_index=options.device_index) as generator:
        driver, reason = generator.renderer_name, generator.cuda_reason()
    if not reason and not torch.cuda.is_available():
        reason = "this build of PyTorch, or its driver, has no CUDA"
    about = f"{driver} and {origin()['machine']}"
    print(f"{about}; {options.size}, {options.processes} processes")
    qualities = options.qualities.split(",")
    for quality in qualities:
        check_known("qualities", quality, tuple(QUALITY))
    if reason:
        print(f"nothing to CUDA: {reason}")
        for quality in qualities:
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
