"""Door or no door: train a ResNet to tell camera Cr from Cl, scored as in Table 10 of the paper.

    python examples/door.py [--full]

Experiment 1 tests on Cl and Cr. Experiment 2 adds A and B as negatives that the model never saw.
Needs fastgen[examples]. --full trains ResNet-50 on a GPU while workers render.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import torch
from common import charts
from common.data import Kept, in_order, rendered
from common.run import Learner, Plan, Run, Table, conclude, feed_of, parameters, start, train
from torch.nn import functional
from transformers import ResNetConfig, ResNetForImageClassification

from fastgen import Config
from fastgen.torch import ContainerDataset, RenderSettings, SceneSettings, class_names

PLANS = {
    "cpu": Plan(images=1200, test_images=400, size=(192, 192), batch=16, passes=6, rate=2e-3),
    "full": Plan(
        images=7910, test_images=1240, size=(224, 224), batch=64, passes=20, rate=1e-3, workers=12
    ),
    "smoke": Plan(images=8, test_images=8, size=(64, 64), batch=4, passes=1, rate=1e-3),
}

DOOR = class_names("door").index("door")
"""Label of a door in fastgen.torch."""

PAPER = {"1: Cl, Cr": (100.0, 100.0), "2: with A, B": (90.4, 96.0)}


class Classifier(Learner):
    """ResNet-50, or a narrow ResNet-10 if `full` is false, with newly initialized weights."""

    def __init__(self, full: bool) -> None:
        super().__init__()
        settings: dict[str, Any] = {"num_labels": 2}
        if not full:
            settings |= {"embedding_size": 24, "hidden_sizes": [24, 48, 96, 192]}
            settings |= {"depths": [1, 1, 1, 1], "layer_type": "basic"}
        self.net = ResNetForImageClassification(ResNetConfig(**settings))

    def forward(self, images: list[torch.Tensor]) -> torch.Tensor:
        """Return logits [B, 2] of images uint8 [3, H, W]."""
        pixels = torch.stack(images).to(next(self.parameters()).device)
        logits: torch.Tensor = self.net(pixels.float() / 127.5 - 1).logits
        return logits

    def loss(self, images: list[torch.Tensor], targets: list[int]) -> torch.Tensor:
        """Return the cross entropy of a batch."""
        logits = self(images)
        return functional.cross_entropy(logits, torch.tensor(targets, device=logits.device))


def precision_recall(door: torch.Tensor, called_door: torch.Tensor) -> tuple[float, float]:
    """Return precision and recall of the class door in percent.

    Args:
        door: True labels, bool [N].
        called_door: Predictions, bool [N].

    Returns:
        Precision and recall; nan where there is nothing to divide by.
    """
    hits = int((door & called_door).sum())
    called, doors = int(called_door.sum()), int(door.sum())
    return (
        100 * hits / called if called else float("nan"),
        100 * hits / doors if doors else float("nan"),
    )


FROM_AFAR = {
    "distance_mm": [7200, 20000],
    "azimuth_deg": [-20, 20],
    "target_shift_mm": [-600, 600],
}
"""Distant poses of Cl and Cr for two thirds of the CPU version's training images.

Containers are then as small as in the images of A and B. A model that has only seen large ones
performs at chance level there.
"""


def training_data(run: Run) -> tuple[ContainerDataset, list[ContainerDataset]]:
    """Return the preset's images of Cl and Cr, and the distant ones that the CPU version adds."""
    plan = run.plan
    options: dict[str, Any] = {
        "render": RenderSettings(plan.size),
        "scenes": SceneSettings(split="train"),
    }
    near = ContainerDataset("door", seed=run.seed, length=plan.images, **options)
    if run.full:
        return near, []
    config = Config.from_values({"cameras": {"Cl": FROM_AFAR, "Cr": FROM_AFAR}})
    # another seed gives other scenes
    far = ContainerDataset("door", config, run.seed + 1, length=2 * plan.images, **options)
    return near, [far]


def test_data(run: Run) -> tuple[Kept, Kept]:
    """Return images of Cl and Cr with their labels, and as many of A and B with meaningless
    targets."""
    plan = run.plan
    scenes = SceneSettings(split="test", fixed=True)
    options: dict[str, Any] = {
        "seed": run.seed,
        "length": plan.test_images,
        "render": RenderSettings(plan.size),
    }
    ends = ContainerDataset("door", scenes=scenes, **options)
    # the door task has no cameras A and B
    sides = ContainerDataset("imdg", scenes=replace(scenes, cameras=("A", "B")), **options)
    return rendered(ends, run.cache), rendered(sides, run.cache)


@torch.no_grad()
def probabilities(model: Classifier, data: Kept, batch: int) -> torch.Tensor:
    """Return the probability of a door for each image, float32 [N]."""
    parts = [model(images).softmax(1)[:, DOOR].cpu() for images, _ in in_order(data, batch)]
    return torch.cat(parts)


def main(argv: Sequence[str] | None = None) -> None:
    """Train, test both experiments, and write the results."""
    run = start("door", __doc__ or "", PLANS, argv)
    plan = run.plan
    near, far = training_data(run)
    feed = feed_of(near, run, far)
    model = Classifier(run.full)
    losses = train(model, feed, run)

    ends, sides = test_data(run)
    door_of_ends = torch.tensor([ends[i][1] == DOOR for i in range(len(ends))])
    of_ends = probabilities(model, ends, plan.batch)
    of_sides = probabilities(model, sides, plan.batch)
    both = torch.cat([of_ends, of_sides])
    door_of_both = torch.cat([door_of_ends, torch.zeros(len(sides), dtype=torch.bool)])
    found = {
        "1: Cl, Cr": precision_recall(door_of_ends, of_ends > 0.5),
        "2: with A, B": precision_recall(door_of_both, both > 0.5),
    }
    rows = [
        [name, len(door_of_ends) if name[0] == "1" else len(both), *found[name], *PAPER[name]]
        for name in found
    ]
    heads = ["experiment", "images", "P", "R", "paper P", "paper R"]
    groups = {
        "Cr, door": of_ends[door_of_ends],
        "Cl": of_ends[~door_of_ends],
        # A and B alternate in the test data
        "A": of_sides[0::2],
        "B": of_sides[1::2],
    }
    called = [
        [name, len(group), 100 * float((group > 0.5).float().mean())]
        for name, group in groups.items()
    ]
    charts.loss_curve(losses, run.folder / "door_loss.png")
    charts.histogram(groups, "probability of a door", run.folder / "door_scores.png")
    conclude(
        run,
        [
            Table("Door or no door, %", heads, rows),
            Table("Called a door, %", ["camera", "images", "called a door"], called),
        ],
        {"parameters": parameters(model), "precision_recall": found, "last_loss": losses[-1]},
    )


if __name__ == "__main__":
    main()
