"""Damage: train a detector with masks, and score it as in Tables 4 to 7 of the paper.

    python examples/damage.py [--full]

Also reports how large a damage must be, and how much it must change the image, to be found. Needs
fastgen[examples]. A small detector of its own learns from pairs of images with and without damages:
first from near views of the ends, then from whole images. All training images have damages, the
test images as many as the preset. The CPU version uses the end cameras. --full trains a wider
detector on a GPU while workers render, after the near views with all cameras.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from common import charts, drawing
from common.damage_recall import Outcome, changes, recall_tables
from common.data import Kept, in_order, rendered
from common.detection_metrics import Scores, class_scores, compressed, operating_point, score
from common.detector import Detector
from common.run import Plan, Run, Table, conclude, feed_of, parameters, start, train

from fastgen import Config
from fastgen.classes import SEGMENTATION_CLASSES
from fastgen.torch import ContainerDataset, ItemSettings, RenderSettings, SceneSettings

PLANS = {
    "cpu": Plan(images=1200, test_images=600, size=(640, 640), batch=4, passes=2, rate=1e-3),
    "full": Plan(
        images=7910, test_images=2480, size=(640, 640), batch=8, passes=20, rate=1e-3, workers=12
    ),
    "smoke": Plan(images=4, test_images=8, size=(128, 128), batch=2, passes=1, rate=1e-3),
}
"""Sizes of runs, for whole images. `images` and `batch` count pairs in training."""

NEAR_PLANS = {
    "cpu": Plan(images=6000, test_images=0, size=(256, 256), batch=16, passes=20, rate=2e-3),
    "full": Plan(
        images=20_000, test_images=0, size=(256, 256), batch=32, passes=20, rate=2e-3, workers=12
    ),
    "smoke": Plan(images=4, test_images=0, size=(64, 64), batch=2, passes=1, rate=1e-3),
}
"""Sizes of runs, for near views."""

MANY_DAMAGES: dict[str, dict[str, Any]] = {
    "damage": {
        "probability": 1.0,
        "count": [2, 6],
        "faces": ["door", "no_door"],
        "toward_cameras": 1.0,
    },
}
"""Damages on the ends of every container, where cameras see them."""

NEAR_VIEWS: dict[str, dict[str, Any]] = {
    "damage": {**MANY_DAMAGES["damage"], "count": [5, 9]},
    "cameras": {
        f"{face}_{number}": {
            "face": face,
            "focal_mm": 112.5,  # as many pixels per mm in 256 pixels as 45 mm in 640
            "distance_mm": [4600, 7200],
            "aim_right": [-0.9, 0.9],
            "aim_up": [-0.9, 0.9],
        }
        for face in ("door", "no_door")
        for number in range(3)
    },
}
"""Parts of the ends at the scale of the preset's end cameras. Near views show several times as many
damages per pixel as whole images."""

_END_CAMERAS = ("Cl", "Cr")

_IMAGES_PER_PAIR = 2
"""Test images of the preset for each test pair with many damages."""

PAPER = {
    "box": {"AP": 71.5, "AP50": 89.9, "AP75": 79.2, "AP_S": 12.5, "AP_M": 50.3, "AP_L": 77.8}
    | {"AR": 74.7, "AR_S": 13.8, "AR_M": 53.9, "AR_L": 80.9},
    "mask": {"AP": 67.5, "AP50": 88.6, "AP75": 74.4, "AP_S": 12.6, "AP_M": 45.8, "AP_L": 73.3}
    | {"AR": 71.1, "AR_S": 14.1, "AR_M": 49.4, "AR_L": 77.0},
}
"""Results of Cascade Mask R-CNN, Tables 4 to 7."""


def near_data(run: Run) -> ContainerDataset:
    """Return pairs of near views."""
    config = Config.from_values(NEAR_VIEWS)
    return _data(run, config, run.plan.images, SceneSettings(split="train"), pairs=True)


def training_data(run: Run) -> ContainerDataset:
    """Return pairs from all cameras of the preset, or of ends with many damages."""
    config = Config.from_values({"damage": {"probability": 1.0}} if run.full else MANY_DAMAGES)
    scenes = SceneSettings(_cameras(run), split="train")
    return _data(run, config, run.plan.images, scenes, pairs=True)


def test_data(run: Run) -> Kept:
    """Return the preset's images of test scenes, from the cameras of `training_data`."""
    scenes = SceneSettings(_cameras(run), split="test", fixed=True)
    return rendered(_data(run, Config.preset(), run.plan.test_images, scenes), run.cache)


def damaged_data(run: Run) -> Kept:
    """Return pairs of test scenes with many damages, from the end cameras."""
    config = Config.from_values(MANY_DAMAGES)
    scenes = SceneSettings(_END_CAMERAS, split="test", fixed=True)
    count = run.plan.test_images // _IMAGES_PER_PAIR
    return rendered(_data(run, config, count, scenes, pairs=True), run.cache)


def _cameras(run: Run) -> tuple[str, ...] | None:
    return None if run.full else _END_CAMERAS


def _data(
    run: Run, config: Config, length: int, scenes: SceneSettings, pairs: bool = False
) -> ContainerDataset:
    return ContainerDataset(
        "damage",
        config,
        run.seed,
        length,
        render=RenderSettings(run.plan.size),
        scenes=scenes,
        items=ItemSettings(pairs=pairs),
    )


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


def tested(model: Detector, pairs: Kept) -> list[Outcome]:
    """Return labels, detections and visible change of each pair."""
    found = []
    for k in range(len(pairs)):
        images, (target, _) = pairs[k]
        damaged, undamaged = (compressed(model.predict([image])[0]) for image in images)
        found.append(Outcome(target, damaged, undamaged, changes(images, target)))
    return found


def main(argv: Sequence[str] | None = None) -> None:
    """Train, test, and write the results."""
    run = start("damage", __doc__ or "", PLANS, argv)
    plan = run.plan
    shape = {"width": 96, "blocks": 3} if run.full else {"width": 32, "blocks": 1}
    model = Detector(len(SEGMENTATION_CLASSES), masks=True, **shape)
    near = replace(run, plan=NEAR_PLANS[run.mode])
    losses = train(model, feed_of(near_data(near), near, mirror=True), near)
    losses += train(model, feed_of(training_data(run), run, mirror=True), run)

    test = test_data(run)
    targets = [test[i][1] for i in range(len(test))]
    batches = in_order(test, plan.batch)
    found = [compressed(one) for images, _ in batches for one in model.predict(images)]
    names = list(SEGMENTATION_CLASSES)
    boxes = score(targets, found, names, plan.size)
    masks = score(targets, found, names, plan.size, masks=True)
    least = operating_point(boxes).score

    damaged = [i for i in range(len(test)) if len(targets[i]["labels"]) > 1][:8]
    shown = [(test[i][0], model.predict([test[i][0]])[0]) for i in damaged]
    pictures = [drawing.drawn(image, one, names, least) for image, one in shown]
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
        *recall_tables(tested(model, damaged_data(run)), class_scores(boxes)),
    ]
    more = {
        "parameters": parameters(model),
        "score": least,
        "last_loss": losses[-1],
        "near_plan": asdict(near.plan),
    }
    conclude(run, tables, {"box": boxes.summary, "mask": masks.summary, **more})


if __name__ == "__main__":
    main()
