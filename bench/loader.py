"""How much of a training step is spent waiting for data: rendered as it goes, or read as JPEG.

    python bench/loader.py [--steps 30] [--batch 8] [--size 320x320] [--channels 8,16,32,64]

Trains a small convolutional net on one core, on the same images from both sources, and prints the
share of a step that it waits for its batch, once the workers have warmed up.
"""

import argparse
import os
import platform
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
import torch
from torch import nn
from torch.utils.data import DataLoader, Dataset

from fastgen.encode import jpeg, write
from fastgen.torch import ContainerDataset, class_names, collate_yolo

WARM_STEPS = 5


class JpegDataset(Dataset[Any]):
    """Images and YOLO targets that `save` wrote."""

    def __init__(self, folder: Path, length: int) -> None:
        self._folder, self._length = folder, length

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, position: int) -> tuple[torch.Tensor, torch.Tensor]:
        pixels = simplejpeg.decode_jpeg((self._folder / f"{position}.jpg").read_bytes())
        target = torch.from_numpy(np.load(self._folder / f"{position}.npy"))
        return torch.from_numpy(pixels.transpose(2, 0, 1).copy()), target


def save(data: ContainerDataset, folder: Path) -> None:
    """Write every item as a JPEG and its target beside it."""
    for position in range(len(data)):
        image, target = data[position]
        write(folder / f"{position}.jpg", jpeg(image.permute(1, 2, 0).numpy()))
        np.save(folder / f"{position}.npy", target.numpy())


def net(channels: list[int]) -> nn.Module:
    """Strided convolutions and a head that says which classes are in the image."""
    layers: list[nn.Module] = []
    for before, after in zip([3, *channels], channels, strict=False):
        layers += [nn.Conv2d(before, after, 3, stride=2, padding=1), nn.ReLU()]
    head = nn.Linear(channels[-1], len(class_names("imdg")))
    return nn.Sequential(*layers, nn.AdaptiveAvgPool2d(1), nn.Flatten(), head)


def waiting(data: Dataset[Any], workers: int, batch: int, channels: list[int]) -> tuple[float, ...]:
    """Share of the time spent waiting, step time in ms, and images a second."""
    torch.manual_seed(0)
    model = net(channels)
    optimizer = torch.optim.SGD(model.parameters(), 0.01)
    loader = DataLoader(data, batch, num_workers=workers, collate_fn=collate_yolo)
    waits, steps = [], []
    last = time.perf_counter()
    for images, rows in loader:
        got = time.perf_counter()
        wanted = torch.zeros(len(images), len(class_names("imdg")))
        wanted[rows[:, 0].long(), rows[:, 1].long()] = 1
        loss = nn.functional.binary_cross_entropy_with_logits(model(images.float() / 255), wanted)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        now = time.perf_counter()
        waits.append(got - last)
        steps.append(now - last)
        last = now
    total = sum(steps[WARM_STEPS:])
    count = len(steps) - WARM_STEPS
    return sum(waits[WARM_STEPS:]) / total, total / count * 1e3, count * batch / total


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--size", default="320x320")
    parser.add_argument("--channels", default="8,16,32,64")
    options = parser.parse_args()
    width, height = (int(v) for v in options.size.split("x"))
    channels = [int(v) for v in options.channels.split(",")]
    torch.set_num_threads(1)
    length = (options.steps + WARM_STEPS) * options.batch
    rendered = ContainerDataset(
        "imdg", seed=7, size=(width, height), length=length, form="yolo", fixed=True
    )
    print(
        f"{platform.machine()}, {len(os.sched_getaffinity(0))} cores, {options.size}, batch "
        f"{options.batch}, net {options.channels}, {options.steps} steps\n"
    )
    print(f"{'source':10}{'workers':>9}{'waiting':>9}{'ms a step':>11}{'images/s':>10}")
    with tempfile.TemporaryDirectory() as folder:
        save(rendered, Path(folder))
        rendered.close()
        sources = {"rendered": rendered, "jpeg": JpegDataset(Path(folder), length)}
        for name, data in sources.items():
            for workers in (1, 2):
                share, step_ms, rate = waiting(data, workers, options.batch, channels)
                print(f"{name:10}{workers:9d}{share:9.1%}{step_ms:11.1f}{rate:10.1f}", flush=True)


if __name__ == "__main__":
    main()
