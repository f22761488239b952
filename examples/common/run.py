"""The common run of an example: options, seeds, training loop and result files."""

import argparse
import json
import math
import os
import platform
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import nn

from common.data import Feed, rendered
from fastgen.errors import ConfigError
from fastgen.torch import ContainerDataset

RESULTS = Path(__file__).parent.parent / "results"

_GRADIENT_LIMIT = 10.0
_REPORT_STEPS = 50


@dataclass(frozen=True)
class Plan:
    """Amount of rendering and training.

    Attributes:
        images: Training images.
        test_images: Test images.
        size: (width, height) in pixels.
        batch: Images per batch.
        passes: Passes over the training images.
        rate: Highest learning rate.
        workers: Processes that render new scenes for every pass while the model trains. 0 renders
            the images once and caches them.
    """

    images: int
    test_images: int
    size: tuple[int, int]
    batch: int
    passes: int
    rate: float
    workers: int = 0


@dataclass(frozen=True)
class Run:
    """Settings from the command line.

    Attributes:
        name: Name of the example.
        mode: "cpu", "full" or "smoke".
        plan: Amount of rendering and training.
        full: Use the larger model.
        folder: Folder for the results.
        seed: Seed of scenes, weights and order.
        device: Device to train on.
    """

    name: str
    mode: str
    plan: Plan
    full: bool
    folder: Path
    seed: int
    device: torch.device

    @property
    def cache(self) -> Path:
        """Folder of the rendered images."""
        return self.folder / "cache"


class Learner(nn.Module, ABC):
    """A model that computes its own loss."""

    @abstractmethod
    def loss(self, images: list[torch.Tensor], targets: list[Any]) -> torch.Tensor:
        """Return the loss of a batch, a scalar."""


@dataclass(frozen=True)
class Table:
    """A table of results: title, column heads, and rows of text or numbers."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[object]]

    def markdown(self) -> str:
        """Return the table in Markdown. Floats have one decimal; nan is a dash."""
        lines = [self.heads, ["---"] * len(self.heads), *[map(_cell, row) for row in self.rows]]
        return f"**{self.title}**\n\n" + "\n".join("| " + " | ".join(c) + " |" for c in lines)


def start(
    name: str, description: str, plans: dict[str, Plan], argv: Sequence[str] | None = None
) -> Run:
    """Parse the command line, choose the plan cpu, full or smoke, and seed torch.

    Raises:
        ConfigError: The seed is negative.
    """
    first, _, rest = description.partition("\n")
    parser = argparse.ArgumentParser(
        description=first, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--full", action="store_true", help="run the version for a GPU")
    parser.add_argument("--smoke", action="store_true", help="run only a few steps, as a test")
    parser.add_argument("--seed", type=int, default=1, help="seed of scenes, weights and order")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(argv)
    if options.seed < 0:
        raise ConfigError(f"seed: {options.seed} is negative; use 0 or more")
    mode = "smoke" if options.smoke else "full" if options.full else "cpu"
    torch.manual_seed(options.seed)
    options.results.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    return Run(name, mode, plans[mode], options.full, options.results, options.seed, device)


def feed_of(
    data: ContainerDataset, run: Run, more: Sequence[ContainerDataset] = (), mirror: bool = False
) -> Feed:
    """Return batches of `data`, rendered anew for each pass or once, as the plan says.

    Images rendered once are followed by those of `more`. With `mirror`, half of the batches are
    mirrored.
    """
    plan = run.plan
    if plan.workers:
        return Feed(data, plan.batch, run.seed, plan.workers, mirror)
    kept = rendered(data, run.cache)
    for other in more:
        kept = kept.with_more(rendered(other, run.cache))
    return Feed(kept, plan.batch, run.seed, mirror=mirror)


def train(model: Learner, feed: Feed, run: Run) -> list[float]:
    """Train for all passes of the plan, with AdamW and one cycle of the learning rate.

    Returns:
        The loss of each step.
    """
    plan = run.plan
    model.to(run.device).train()
    steps = max(len(feed) * plan.passes, 2)
    optimizer = torch.optim.AdamW(model.parameters(), plan.rate, weight_decay=0.01)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, plan.rate, steps, pct_start=0.15)
    losses: list[float] = []
    began = time.perf_counter()
    for number in range(plan.passes):
        for images, targets in feed.passed(number):
            loss = model.loss(images, targets)
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(model.parameters(), _GRADIENT_LIMIT)
            optimizer.step()
            schedule.step()
            losses.append(float(loss.detach()))
            if len(losses) % _REPORT_STEPS == 0:
                mean = sum(losses[-_REPORT_STEPS:]) / _REPORT_STEPS
                spent = time.perf_counter() - began
                print(f"step {len(losses)} of {steps}: loss {mean:.3f}, {spent:.0f} s", flush=True)
    model.eval()
    return losses


def parameters(model: nn.Module) -> int:
    """Return the number of trainable parameters."""
    return sum(p.numel() for p in model.parameters() if p.requires_grad)


def conclude(run: Run, tables: Sequence[Table], found: dict[str, Any]) -> None:
    """Print the tables and write them to NAME.md, and all results to NAME.json."""
    text = "\n\n".join(table.markdown() for table in tables)
    made = {
        "example": run.name,
        "mode": run.mode,
        "seed": run.seed,
        "plan": asdict(run.plan),
        "machine": f"{os.cpu_count()} cores, {platform.machine()}, {run.device.type}",
        "torch": str(torch.__version__),
    }
    (run.folder / f"{run.name}.json").write_text(json.dumps(made | found, indent=1) + "\n")
    (run.folder / f"{run.name}.md").write_text(text + "\n")
    print(text)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.1f}"
    return str(value)
