"""Sealed or not: train a small network to tell hasps with a locked seal from all others.

    python examples/seal.py [--full]

A crop shows one hasp of the door. It is open if it has no seal, or one that hangs open. Needs
fastgen[examples]. --full trains on a GPU while workers render.
"""

from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import torch
from common import charts
from common.data import Kept, in_order, rendered
from common.run import Learner, Plan, Run, Table, conclude, feed_of, parameters, start, train
from torch import nn
from torch.nn import functional

from fastgen import Config, Generator
from fastgen.torch import ContainerDataset, RenderSettings, SceneSettings, class_names

PLANS = {
    "cpu": Plan(images=500, test_images=150, size=(480, 480), batch=32, passes=6, rate=4e-3),
    "full": Plan(
        images=8000, test_images=1000, size=(640, 640), batch=32, passes=20, rate=2e-3, workers=12
    ),
    "smoke": Plan(images=3, test_images=3, size=(480, 480), batch=4, passes=1, rate=1e-3),
}

SEALED = class_names("seal").index("sealed")
"""Label of a locked seal in fastgen.torch."""

CONFIG = Config.from_values(
    {
        "cameras": {
            "gate": {
                "face": "door",
                "focal_mm": 35.0,
                "distance_mm": [1900, 2900],
                "azimuth_deg": [-25, 25],
                "elevation_deg": [-12, 15],
                "target_shift_mm": [-150, 150],
            }
        },
        "seals": {"probability": 0.95, "second": 0.8, "hanging": 0.25},
        "container": {"kinds": {"20": 1, "40": 1}},
        "spreader": {"probability": 0},
    }
)
"""Doors from 2 to 3 m, most with two seals, so that a third of their hasps are sealed."""

_SIDE_PX = 56
_LIGHT = 0.2


class Classifier(Learner):
    """Convolutional network on crops of 56 x 56 pixels.

    Args:
        width: Channels of the first layer.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        widths = (3, width, 2 * width, 4 * width)
        layers: list[nn.Module] = []
        for before, after in pairwise(widths):
            layers += [nn.Conv2d(before, after, 3, padding=1, bias=False), nn.BatchNorm2d(after)]
            layers += [nn.ReLU(), nn.MaxPool2d(2)]
        # the seal's place in the crop is known, so the last layer sees all places
        self.net = nn.Sequential(*layers, nn.Flatten(), nn.Linear(4 * width * 7 * 7, 2))

    def forward(self, images: list[torch.Tensor]) -> torch.Tensor:
        """Return logits [B, 2] of crops uint8 [3, h, w] of any size."""
        device = next(self.parameters()).device
        size = (_SIDE_PX, _SIDE_PX)
        pixels = torch.cat(
            [
                functional.interpolate(crop[None].float(), size, mode="bilinear", antialias=True)
                for crop in images
            ]
        ).to(device)
        if self.training:
            pixels = _varied(pixels)
        logits: torch.Tensor = self.net(pixels / 127.5 - 1)
        return logits

    def loss(self, images: list[torch.Tensor], targets: Any) -> torch.Tensor:
        """Return the cross entropy of a batch.

        Args:
            images: Crops.
            targets: Labels int64 [B], or a list of dicts with "label".
        """
        if not isinstance(targets, torch.Tensor):
            targets = torch.tensor([target["label"] for target in targets])
        logits = self(images)
        return functional.cross_entropy(logits, targets.to(logits.device))


def _varied(pixels: torch.Tensor) -> torch.Tensor:
    """Vary the brightness of crops, and mirror every second one at random."""
    light = 1 + _LIGHT * torch.randn(len(pixels), 1, 1, 1, device=pixels.device)
    mirrored = torch.rand(len(pixels), 1, 1, 1, device=pixels.device) < 0.5
    return torch.where(mirrored, pixels.flip(3), pixels) * light


def data_of(run: Run, split: str) -> ContainerDataset:
    """Return the images of a split."""
    plan = run.plan
    return ContainerDataset(
        "seal",
        CONFIG,
        seed=run.seed,
        length=plan.images if split == "train" else plan.test_images,
        render=RenderSettings(plan.size),
        scenes=SceneSettings(split=split, fixed=split == "test"),
    )


@torch.no_grad()
def probabilities(model: Classifier, data: Kept, batch: int) -> torch.Tensor:
    """Return the probability of a locked seal for each crop, float32 [N]."""
    parts = [model(images).softmax(1)[:, SEALED].cpu() for images, _ in in_order(data, batch)]
    return torch.cat(parts)


def group_of(target: dict[str, int], scenes: Generator) -> str:
    """Return what the hasp of a crop carries, such as 'bolt, locked'."""
    # the rig has one camera, so the number of an image is that of its scene
    seals = scenes.scene(target["image_id"]).seals
    names = {seal.hasp: f"{seal.kind}, {seal.state}" for seal in seals}
    return names.get(target["hasp"], "no seal")


def precision_recall(sealed: torch.Tensor, called: torch.Tensor) -> tuple[float, float]:
    """Return precision and recall of the class sealed in percent.

    Args:
        sealed: True labels, bool [N].
        called: Predictions, bool [N].

    Returns:
        Precision and recall; nan if the divisor is 0.
    """
    hits = int((sealed & called).sum())
    found, there = int(called.sum()), int(sealed.sum())
    return (
        100 * hits / found if found else float("nan"),
        100 * hits / there if there else float("nan"),
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Train, test, and write the results."""
    run = start("seal", __doc__ or "", PLANS, argv)
    model = Classifier(32 if run.full else 16)
    losses = train(model, feed_of(data_of(run, "train"), run), run)
    test = rendered(data_of(run, "test"), run.cache)
    scores = probabilities(model, test, run.plan.batch)
    called = scores > 0.5
    targets = [test[i][1] for i in range(len(test))]
    sealed = torch.tensor([target["label"] == SEALED for target in targets])
    precision, recall = precision_recall(sealed, called)
    correct = 100 * float((sealed == called).float().mean())
    scenes = Generator(CONFIG, run.seed)
    members: dict[str, list[int]] = defaultdict(list)
    for i, target in enumerate(targets):
        members[group_of(target, scenes)].append(i)
    rows = [
        [name, len(which), 100 * float(called[which].float().mean())]
        for name, which in sorted(members.items())
    ]
    charts.loss_curve(losses, run.folder / "seal_loss.png")
    charts.histogram(
        {name: scores[which] for name, which in sorted(members.items())},
        "probability of a locked seal",
        run.folder / "seal_scores.png",
    )
    conclude(
        run,
        [
            Table(
                "Sealed or not, %",
                ["crops", "sealed", "correct", "P", "R"],
                [[len(test), int(sealed.sum()), correct, precision, recall]],
            ),
            Table("Called sealed, %", ["hasp carries", "crops", "called sealed"], rows),
        ],
        {
            "parameters": parameters(model),
            "correct": correct,
            "precision_recall": (precision, recall),
            "last_loss": losses[-1],
        },
    )


if __name__ == "__main__":
    main()
