"""Dangerous-goods markers: train a detector of 28 classes, and score it as in Tables 8 and 9.

    python examples/imdg.py [--full]

Also lists which similar classes are confused. Needs fastgen[examples]. The CPU version trains a
small detector of its own on the end cameras at 320x320, where a marker is about 25 pixels wide. Its
training images have more markers on a face than the test images. --full trains RT-DETR on all
cameras at 640x640 on a GPU while workers render.
"""

from collections.abc import Sequence

import numpy as np
from common import charts, drawing
from common.data import Kept, in_order, rendered
from common.detection_metrics import OperatingPoint, Scores, confusion, operating_point, score
from common.detector import Detector
from common.rtdetr import RtDetr
from common.run import Plan, Run, Table, conclude, feed_of, parameters, start, train

from fastgen import Config
from fastgen.classes import DETECTION_CLASSES
from fastgen.torch import ContainerDataset, RenderSettings, SceneSettings

PLANS = {
    "cpu": Plan(images=4000, test_images=500, size=(320, 320), batch=4, passes=4, rate=1.5e-3),
    "full": Plan(
        images=7910, test_images=2480, size=(640, 640), batch=16, passes=20, rate=2e-4, workers=12
    ),
    "smoke": Plan(images=4, test_images=4, size=(128, 128), batch=2, passes=1, rate=1e-3),
}

MANY_MARKERS = {"markings": {"markers_per_face": [8, 24]}}
"""More examples of each class per image than the preset's 1 to 6, for the CPU version."""

PAPER = {"P": 79.9, "R": 95.3, "AP50": 83.0, "AP": 79.6}
"""Results of YOLOv7, Table 8."""


def training_data(run: Run) -> ContainerDataset:
    """Return the preset's images of all cameras; on a CPU, images of the ends with many markers."""
    plan = run.plan
    config = Config.preset() if run.full else Config.from_values(MANY_MARKERS)
    cameras = None if run.full else ("Cl", "Cr")
    return ContainerDataset(
        "imdg",
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
        "imdg",
        seed=run.seed,
        length=plan.test_images,
        render=RenderSettings(plan.size),
        scenes=SceneSettings(cameras, split="test", fixed=True),
    )
    return rendered(data, run.cache)


def class_table(scores: Scores, point: OperatingPoint) -> Table:
    """Return precision, recall, AP50 and AP in percent, of all classes and of each."""
    rows: list[list[str | float]] = [
        ["all", sum(scores.counts), point.mean_precision, point.mean_recall, scores.ap50, scores.ap]
    ]
    for k, name in enumerate(DETECTION_CLASSES):
        measured = [point.precision[k], point.recall[k], scores.class_ap50[k], scores.class_ap[k]]
        rows.append([name, scores.counts[k], *measured])
    heads = ["class", "labels", "P", "R", "AP50", "AP"]
    return Table("Markers by class, %", heads, rows)


def confused_table(counts: np.ndarray, most: int = 12) -> Table:
    """Return the most frequent confusions of two classes."""
    square = counts[:, : len(counts)].copy()
    np.fill_diagonal(square, 0)
    order = np.argsort(square, axis=None)[::-1][:most]
    rows = []
    for true, found in zip(*np.unravel_index(order, square.shape), strict=True):
        if square[true, found]:
            share = 100 * float(square[true, found]) / max(int(counts[true].sum()), 1)
            rows.append(
                [DETECTION_CLASSES[true], DETECTION_CLASSES[found], int(square[true, found]), share]
            )
    return Table("Confused classes", ["true class", "found as", "times", "% of the class"], rows)


def main(argv: Sequence[str] | None = None) -> None:
    """Train, test, and write the results."""
    run = start("imdg", __doc__ or "", PLANS, argv)
    plan = run.plan
    feed = feed_of(training_data(run), run)
    classes = len(DETECTION_CLASSES)
    model = RtDetr(classes, small=run.mode == "smoke") if run.full else Detector(classes)
    losses = train(model, feed, run)

    test = test_data(run)
    targets = [test[i][1] for i in range(len(test))]
    found = [one for images, _ in in_order(test, plan.batch) for one in model.predict(images)]
    scores = score(targets, found, DETECTION_CLASSES, plan.size)
    point = operating_point(scores)
    counts = confusion(targets, found, classes, point.score)

    names = list(DETECTION_CLASSES)
    bars = {"AP50": scores.class_ap50, "AP": scores.class_ap}
    charts.loss_curve(losses, run.folder / "imdg_loss.png")
    charts.bars(names, bars, run.folder / "imdg_classes.png")
    charts.confusion(counts, names, run.folder / "imdg_confusion.png")
    drawing.found_pictures(test, found, names, point.score, run.folder / "imdg_pictures.png")
    measured = {
        "P": point.mean_precision,
        "R": point.mean_recall,
        "AP50": scores.ap50,
        "AP": scores.ap,
    }
    rows = [["here", *measured.values()], ["paper, YOLOv7", *PAPER.values()]]
    tables = [
        Table("Markers, %", ["model", *measured], rows),
        class_table(scores, point),
        confused_table(counts),
    ]
    more = {"parameters": parameters(model), "score": point.score, "last_loss": losses[-1]}
    conclude(run, tables, {"mean": measured, "classes": scores.by_class(), **more})


if __name__ == "__main__":
    main()
