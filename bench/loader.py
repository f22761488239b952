"""Measure the share of a training step spent waiting for data, rendered or read from JPEG.

    python bench/loader.py [--steps 40] [--batch 8] [--size 320x320]

Trains convolutional networks of several sizes on one core, with the same images from both sources.
Measuring starts when the workers have loaded most lights. Writes the table in docs/training.md and
bench/results/loader.json. Needs `.[torch,examples]`.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
import torch
from reporting import ROOT, heading, origin, parse_size, save, write_section
from torch import nn
from torch.utils.data import DataLoader, Dataset
from transformers import ResNetConfig, ResNetForImageClassification

from fastgen.files.images import jpeg, write
from fastgen.torch import (
    ContainerDataset,
    ItemSettings,
    RenderSettings,
    SceneSettings,
    class_names,
    collate_yolo,
)

WARM_STEPS = 40
"""Steps before measuring starts, in which workers load lights and link programs."""

WORKERS = (1, 2)


class JpegDataset(Dataset[Any]):
    """Images and YOLO targets written by `save_items`."""

    def __init__(self, folder: Path, length: int) -> None:
        self._folder, self._length = folder, length

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, position: int) -> tuple[torch.Tensor, torch.Tensor]:
        pixels = simplejpeg.decode_jpeg((self._folder / f"{position}.jpg").read_bytes())
        target = torch.from_numpy(np.load(self._folder / f"{position}.npy"))
        return torch.from_numpy(pixels.transpose(2, 0, 1).copy()), target


def save_items(data: ContainerDataset, folder: Path) -> None:
    """Write every item as a JPEG with its target next to it."""
    for position in range(len(data)):
        image, target = data[position]
        write(folder / f"{position}.jpg", jpeg(image.permute(1, 2, 0).numpy()))
        np.save(folder / f"{position}.npy", target.numpy())


def convolutions() -> nn.Module:
    """Return four strided convolutions: so little work that the data source is the limit."""
    channels = (8, 16, 32, 64)
    layers: list[nn.Module] = []
    for before, after in zip((3, *channels), channels, strict=False):
        layers += [nn.Conv2d(before, after, 3, stride=2, padding=1), nn.ReLU()]
    head = nn.Linear(channels[-1], len(class_names("imdg")))
    return nn.Sequential(*layers, nn.AdaptiveAvgPool2d(1), nn.Flatten(), head)


class ResNet(nn.Module):
    """A ResNet with basic blocks and `width` times the channels of ResNet-18."""

    def __init__(self, width: float) -> None:
        super().__init__()
        sizes = [int(width * size) for size in (64, 128, 256, 512)]
        config = ResNetConfig(  # type: ignore[call-arg] # num_labels is not in its signature
            embedding_size=sizes[0],
            hidden_sizes=sizes,
            depths=[2, 2, 2, 2],
            layer_type="basic",
            num_labels=len(class_names("imdg")),
        )
        self.net = ResNetForImageClassification(config)

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        """Return logits [N, classes] of images [N, 3, H, W]."""
        logits: torch.Tensor = self.net(pixel_values=images).logits
        return logits


NETS: dict[str, Callable[[], nn.Module]] = {
    "4 convolutions": convolutions,
    "ResNet-18, a quarter as wide": lambda: ResNet(0.25),
    "ResNet-18, half as wide": lambda: ResNet(0.5),
}


@dataclass(frozen=True)
class Row:
    """The result of one run.

    Attributes:
        waiting: Share of the time spent waiting for a batch.
        step_ms: Mean time of a step.
        images_per_s: Mean rate.
    """

    net: str
    source: str
    workers: int
    waiting: float
    step_ms: float
    images_per_s: float


def run(net: str, source: str, data: Dataset[Any], workers: int, batch: int) -> Row:
    """Train on all batches of `data`, and measure after the first WARM_STEPS steps."""
    torch.manual_seed(0)
    model = NETS[net]()
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
    waiting = sum(waits[WARM_STEPS:]) / total
    return Row(net, source, workers, waiting, total / count * 1e3, count * batch / total)


def table(rows: list[Row], options: argparse.Namespace) -> list[str]:
    """Return the rows as a Markdown table."""
    return [
        f"{heading()}; {options.size}, batch {options.batch}, {options.steps} steps.",
        "",
        "| network | images are | workers | waiting | ms per step | images/s |",
        "| --- | --- | --- | --- | --- | --- |",
        *(
            f"| {r.net} | {r.source} | {r.workers} | {r.waiting:.0%} | {r.step_ms:.0f} "
            f"| {r.images_per_s:.1f} |"
            for r in rows
        ),
    ]


def main() -> None:
    """Run all measurements and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--size", default="320x320")
    options = parser.parse_args()
    torch.set_num_threads(1)
    length = (options.steps + WARM_STEPS) * options.batch
    size = parse_size(options.size)
    rendered = ContainerDataset(
        "imdg",
        seed=7,
        length=length,
        render=RenderSettings(size),
        scenes=SceneSettings(fixed=True),
        items=ItemSettings(form="yolo"),
    )
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        save_items(rendered, Path(folder))
        rendered.close()
        sources = {"rendered": rendered, "read as JPEG": JpegDataset(Path(folder), length)}
        for net in NETS:
            for source, data in sources.items():
                for workers in WORKERS:
                    rows.append(run(net, source, data, workers, options.batch))
                    print(rows[-1], flush=True)
    save("loader", {**origin(), "rows": [asdict(row) for row in rows]})
    write_section("loader", table(rows, options), ROOT / "docs" / "training.md")


if __name__ == "__main__":
    main()
