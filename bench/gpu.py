"""Images a second to disk, and into CUDA tensors where an NVIDIA GPU draws.

    python bench/gpu.py [--images 200] [--size 640x640] [--workers 2] [--device-index N]

To disk is `fastgen generate` on EGL's first device, from start to finish. To tensors is one process
that draws scenes of its own (warm: every light and program was used before) and clones image,
labels and depth, without objects. Where that cannot be, the reason is printed. Needs PyTorch.
Leaves bench/results/gpu.json.
"""

import argparse
import time

import torch
from results import machine, origin, parse_size, save
from throughput import whole_run

from fastgen import Config, Generator

CAMERAS = tuple(Config.preset().cameras)


def tensor_rate(generator: Generator, images: int) -> float:
    """Images a second into tensors of their own."""

    def run(count: int) -> None:
        for number in range(count):
            frame = generator.render_cuda(number // len(CAMERAS), CAMERAS[number % len(CAMERAS)])
            for array in (frame.image, frame.labels, frame.depth):
                torch.as_tensor(array, device="cuda").clone()
        torch.cuda.synchronize()

    generator.preload()
    run(images)
    began = time.perf_counter()
    run(images)
    return images / (time.perf_counter() - began)


def main() -> None:
    """Print both rates, or one and the reason."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--workers", type=int, default=2, help="of the run to disk")
    parser.add_argument("--device-index", type=int, help="of the run to tensors, in EGL's order")
    options = parser.parse_args()
    size = parse_size(options.size)
    about = machine()
    with Generator(
        seed=7, size=size, backend="egl", device_index=options.device_index
    ) as generator:
        driver, reason = generator.renderer_name, generator.cuda_reason()
        if not reason and not torch.cuda.is_available():
            reason = "this build of PyTorch, or its driver, has no CUDA"
        tensors = None if reason else tensor_rate(generator, options.images)
    print(f"{about}; {driver}; {options.images} images of {options.size}")
    disk = whole_run("egl", options.size, options.images, options.workers).whole
    print(f"to disk, {options.workers} worker(s)  {disk:8.1f} images/s")
    print(f"to a CUDA tensor  {f'{tensors:8.1f} images/s' if tensors else 'none: ' + reason}")
    figures = {"to_disk": disk, "to_cuda_tensor": tensors, "reason": reason}
    save("gpu", {**origin(), "driver": driver, **vars(options), "images_per_s": figures})


if __name__ == "__main__":
    main()
