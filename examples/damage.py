"""Damage: train a detector with masks, and score it as in Tables 4 to 7 of the paper.

    python examples/damage.py [--full]

Also reports recall for small and for thin damages. Needs fastgen[examples]. The CPU version trains
a small detector of its own on the end cameras at 320x320. Its training images have more damages
than the test images. --full trains a wider one on all cameras at 640x640 on a GPU while workers
render.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from common import charts, drawing
from common.data import Kept, in_order, rendered
from common.detection_metrics import Found, Scores, hits, operating_point, score
from common.detector import Detector
from common.run import Plan, Run, Table, conclude, feed_of, parameters, start, train

from fastgen import Config
from fastgen.classes import SEGMENTATION_CLASSES
from fastgen.torch import ContainerDataset, RenderSettings, SceneSettings

PLANS = {
    "cpu": Plan(images=3500, test_images=600, size=(320, 320), batch=4, passes=3, rate=1.5e-3),
    "full": Plan(
        images=7910, test_images=2480, size=(640, 640), batch=16, passes=20, rate=1e-3, workers=12
    ),
    "smoke": Plan(images=4, test_images=8, size=(128, 128), batch=2, passes=1, rate=1e-3),
}

MANY_DAMAGES = {
    "damage": {"probability": 1.0, "count": [2, 6], "faces": ["door", "no_door"]},
}
"""Damages on every container, on the faces that the end cameras see, for the CPU version."""

SMALL_PX = 32 * 32
"""Visible pixels below which COCO calls an object small."""

THIN = 3.0
"""Smallest length-to-width ratio of a thin damage, from its minimum-area rectangle."""

PAPER = {
    "box": {"AP": 71.5, "AP50": 89.9, "AP75": 79.2, "AP_S": 12.5, "AP_M": 50.3, "AP_L": 77.8}
    | {"AR": 74.7, "AR_S": 13.8, "AR_M": 53.9, "AR_L": 80.9},
    "mask": {"AP": 67.5, "AP50": 88.6, "AP75": 74.4, "AP_S": 12.6, "AP_M": 45.8, "AP_L": 73.3}
    | {"AR": 71.1, "AR_S": 14.1, "AR_M": 49.4, "AR_L": 77.0},
}
"""Results of Cascade Mask R-CNN, Tables 4 to 7."""


def training_data(run: Run) -> ContainerDataset:
    """Return the preset's images of all cameras; on a CPU, images of the ends with many damages."""
    plan = run.plan
    config = Config.preset() if run.full else Config.from_values(MANY_DAMAGES)
    cameras = None if run.full else ("Cl", "Cr")
    return ContainerDataset(
        "damage",
        config,
        run.seed,
        plan.images,
        render=RenderSettings(plan.size),
        scenes=SceneSettings(cameras, split="train"),
    )


def test_data(run: Run) -> Kept:
    """Return the preset's images of test scenes, from the same cameras as the training images."""
    plan = run.plan
    cameras = None if run.full else ("Cl", "Cr")
    data = ContainerDataset(
        "damage",
        seed=run.seed,
        length=plan.test_images,
        render=RenderSettings(plan.size),
        scenes=SceneSettings(cameras, split="test", fixed=True),
    )
    return rendered(data, run.cache)


def slenderness(mask: np.ndarray) -> float:
    """Return the length-to-width ratio of the minimum-area rectangle around a mask [H, W]."""
    rows, columns = np.nonzero(mask)
    points = np.stack([columns, rows], axis=1).astype(np.float32)
    # plus one, because pixels have a size: a row of n pixels has the ratio n
    sides = np.array(cv2.minAreaRect(points)[1]) + 1
    return float(sides.max() / sides.min())


def groups_of(target: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return for each kind of damage which labels of an image belong to it, bool [N] by name."""
    labels = target["labels"].numpy()
    damages = labels > 1
    small = damages & (target["area"].numpy() < SMALL_PX)
    slender = np.array([slenderness(mask) >= THIN for mask in target["masks"].numpy()], bool)
    kinds = {name: labels == k for k, name in enumerate(SEGMENTATION_CLASSES, start=1) if k > 1}
    thin = damages & slender
    sorts = {"small": small, "larger": damages & ~small, "thin": thin, "not thin": damages & ~thin}
    return {"all damages": damages, **kinds, **sorts, "small and thin": small & thin}


def recall_table(
    targets: Sequence[Mapping[str, Any]], found: Sequence[Found], least: float
) -> Table:
    """Return how many damages of each kind are found, by box and by mask.

    Args:
        targets: Labels by image, in the loader's detection form.
        found: Detections by image.
        least: Smallest score that counts.
    """
    tally: dict[str, np.ndarray] = {}
    for target, each in zip(targets, found, strict=True):
        boxes, masks = hits(target, each, least), hits(target, each, least, masks=True)
        for name, chosen in groups_of(target).items():
            counted = np.array([chosen.sum(), boxes[chosen].sum(), masks[chosen].sum()])
            tally[name] = tally.get(name, 0) + counted
    rows = [
        [
            name,
            int(n),
            100 * by_box / n if n else float("nan"),
            100 * by_mask / n if n else float("nan"),
        ]
        for name, (n, by_box, by_mask) in tally.items()
    ]
    title = f"Damages found at an IoU of 0.5 and a score of {least:.2f}, %"
    return Table(title, ["damages", "labels", "by box", "by mask"], rows)


def summary_table(kind: str, scores: Scores) -> Table:
    """Return COCO's mean scores next to the paper's, for the kind "box" or "mask"."""
    names = list(scores.summary)
    rows = [
        ["here", *scores.summary.values()],
        ["paper, Cascade Mask R-CNN", *(PAPER[kind][name] for name in names)],
    ]
    return Table(f"By {kind}, %", ["model", *names], rows)


def class_table(boxes: Scores, masks: Scores) -> Table:
    """Return AP50 and AP of each class by box and by mask."""
    rows = [
        [name, boxes.counts[k], boxes.class_ap50[k], boxes.class_ap[k]]
        + [masks.class_ap50[k], masks.class_ap[k]]
        for k, name in enumerate(SEGMENTATION_CLASSES)
    ]
    heads = ["class", "labels", "box AP50", "box AP", "mask AP50", "mask AP"]
    return Table("By class, %", heads, rows)


def main(argv: Sequence[str] | None = None) -> None:
    """Train, test, and write the results."""
    run = start("damage", __doc__ or "", PLANS, argv)
    plan = run.plan
    feed = feed_of(training_data(run), run)
    shape = {"width": 96, "blocks": 3} if run.full else {"width": 32, "blocks": 1}
    model = Detector(len(SEGMENTATION_CLASSES), masks=True, **shape)
    losses = train(model, feed, run)

    test = test_data(run)
    targets = [test[i][1] for i in range(len(test))]
    found = [one for images, _ in in_order(test, plan.batch) for one in model.predict(images)]
    names = list(SEGMENTATION_CLASSES)
    boxes = score(targets, found, names, plan.size)
    masks = score(targets, found, names, plan.size, masks=True)
    least = operating_point(boxes).score

    damaged = [i for i in range(len(test)) if len(targets[i]["labels"]) > 1][:8]
    pictures = [drawing.drawn(test[i][0], found[i], names, least) for i in damaged]
    bars = {"box AP50": boxes.class_ap50, "mask AP50": masks.class_ap50}
    charts.loss_curve(losses, run.folder / "damage_loss.png")
    charts.bars(names, bars, run.folder / "damage_classes.png")
    if pictures:
        titles = [f"test image {i}" for i in damaged]
        charts.pictures(pictures, titles, run.folder / "damage_pictures.png")
    tables = [
        summary_table("box", boxes),
        summary_table("mask", masks),
        class_table(boxes, masks),
        recall_table(targets, found, least),
    ]
    more = {"parameters": parameters(model), "score": least, "last_loss": losses[-1]}
    conclude(run, tables, {"box": boxes.summary, "mask": masks.summary, **more})


if __name__ == "__main__":
    main()
