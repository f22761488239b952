"""COCO metrics by size and class, precision and recall at one score, and confusion of classes.

Targets are in the loader's detection form, detections in the form of `Detector.predict`. All shares
are in percent, and nan if there is nothing to measure. In `score` and `matched`, labels with
`iscrowd` are regions to ignore, as in COCO: they need not be found, and detections inside them do
not count.
"""

import contextlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from common.boxes import iou

Found = Mapping[str, Any]
"""Detections of an image, as `Detector.predict` or `compressed` returns them."""

_SUMMARY = {
    "AP": 0,
    "AP50": 1,
    "AP75": 2,
    "AP_S": 3,
    "AP_M": 4,
    "AP_L": 5,
    "AR": 8,
    "AR_S": 9,
    "AR_M": 10,
    "AR_L": 11,
}
"""Index in COCOeval's statistics of each name in the paper's Tables 4 to 7."""

_THRESHOLDS = np.linspace(0.01, 0.99, 99)
"""Scores at which precision and recall are measured."""


@dataclass(frozen=True)
class Scores:
    """COCO scores.

    Attributes:
        names: Names of the classes.
        summary: COCO's mean scores, by the paper's names.
        class_ap50: AP50 of each class.
        class_ap: AP of each class.
        counts: Number of labels of each class.
        scored: For each class, the scores of its detections, whether each matches a label at an IoU
            of 0.5, and the number of labels.
    """

    names: Sequence[str]
    summary: dict[str, float]
    class_ap50: list[float]
    class_ap: list[float]
    counts: list[int]
    scored: list[tuple[NDArray[np.float64], NDArray[np.bool_], int]]

    @property
    def ap(self) -> float:
        """AP over IoU 0.5 to 0.95, mean over classes."""
        return self.summary["AP"]

    @property
    def ap50(self) -> float:
        """AP at an IoU of 0.5, mean over classes."""
        return self.summary["AP50"]

    def by_class(self) -> dict[str, dict[str, float]]:
        """Return labels, AP50 and AP of each class by name."""
        return {
            name: {
                "labels": self.counts[k],
                "AP50": self.class_ap50[k],
                "AP": self.class_ap[k],
            }
            for k, name in enumerate(self.names)
        }


@dataclass(frozen=True)
class OperatingPoint:
    """Precision and recall of each class for detections with at least this score."""

    score: float
    precision: list[float]
    recall: list[float]

    @property
    def mean_precision(self) -> float:
        """Mean over the classes with detections."""
        return _mean(np.array(self.precision))

    @property
    def mean_recall(self) -> float:
        """Mean over the classes with labels."""
        return _mean(np.array(self.recall))


def score(
    targets: Sequence[Mapping[str, Any]],
    found: Sequence[Found],
    names: Sequence[str],
    size: tuple[int, int],
    masks: bool = False,
) -> Scores:
    """Score detections against labels with pycocotools.

    Args:
        targets: Labels by image.
        found: Detections by image.
        names: Names of the classes.
        size: (width, height) of the images.
        masks: Compare masks instead of boxes.
    """
    measured = matched(targets, found, names, size, masks)
    with contextlib.redirect_stdout(io.StringIO()):
        measured.accumulate()
        measured.summarize()
    precision = measured.eval["precision"][..., 0, -1]  # [IoU, recall, class]
    return Scores(
        names=names,
        summary={name: _percent(float(measured.stats[i])) for name, i in _SUMMARY.items()},
        class_ap50=[_percent(float(p.mean())) for p in precision[0].T],
        class_ap=[_percent(float(precision[..., k].mean())) for k in range(len(names))],
        counts=[
            sum(int(((t["labels"] == k + 1) & (t["iscrowd"] == 0)).sum()) for t in targets)
            for k in range(len(names))
        ],
        scored=[_scored(measured, k, len(targets)) for k in range(len(names))],
    )


def matched(
    targets: Sequence[Mapping[str, Any]],
    found: Sequence[Found],
    names: Sequence[str],
    size: tuple[int, int],
    masks: bool = False,
) -> COCOeval:
    """Return pycocotools' evaluation in which detections and labels are matched, not yet summed.

    The arguments are those of `score`.
    """
    truth = COCO()
    truth.dataset = {
        "info": {},
        "images": [
            {"id": i, "width": size[0], "height": size[1]} for i in range(1, len(targets) + 1)
        ],
        "categories": [{"id": k + 1, "name": name} for k, name in enumerate(names)],
        "annotations": [
            {**one, "area": float(area), "iscrowd": int(crowd)}
            for i, target in enumerate(targets, start=1)
            for one, area, crowd in zip(
                _entries(target, i, masks), target["area"], target["iscrowd"], strict=True
            )
        ],
    }
    for number, one in enumerate(truth.dataset["annotations"], start=1):
        one["id"] = number  # COCOeval treats a match with id 0 as no match
    with contextlib.redirect_stdout(io.StringIO()):
        truth.createIndex()
        detections = [
            {**one, "score": float(value)}
            for i, each in enumerate(found, start=1)
            for one, value in zip(_entries(each, i, masks), each["scores"], strict=True)
        ]
        guessed = truth.loadRes(detections) if detections else _nothing(truth)
        measured = COCOeval(truth, guessed, "segm" if masks else "bbox")
        measured.evaluate()
    return measured


def operating_point(scores: Scores) -> OperatingPoint:
    """Return the score with the best F1, averaged over the classes, as YOLOv7 reports P and R."""
    precision, recall, f1 = _curves(scores)
    labelled = [k for k, each in enumerate(scores.scored) if each[2]]
    best = int(f1[labelled].mean(axis=0).argmax()) if labelled else 0
    return OperatingPoint(
        score=float(_THRESHOLDS[best]),
        precision=(100 * precision[:, best]).tolist(),
        recall=(100 * recall[:, best]).tolist(),
    )


def class_scores(scores: Scores) -> list[float]:
    """Return the score of each class with its best F1; 0.99 for a class that is never found."""
    f1 = _curves(scores)[2]
    best = np.where(f1.max(axis=1) > 0, f1.argmax(axis=1), len(_THRESHOLDS) - 1)
    return [float(each) for each in _THRESHOLDS[best]]


def confusion(
    targets: Sequence[Mapping[str, Any]], found: Sequence[Found], classes: int, least_score: float
) -> NDArray[np.int64]:
    """Count the class in which each label is found.

    Detections with at least `least_score` take, best first, the free label with the largest IoU, if
    that is at least 0.5. The label may have any class, except that the first class, which contains
    the others, only matches itself.

    Returns:
        Counts [classes, classes + 1]; the last column counts missed labels.
    """
    counts = np.zeros((classes, classes + 1), np.int64)
    for target, each in zip(targets, found, strict=True):
        kept = each["scores"] >= least_score
        boxes, labels = each["boxes"][kept], each["labels"][kept]
        overlap = iou(boxes, target["boxes"])
        overlap[(labels == 1)[:, None] != (target["labels"] == 1)[None]] = 0
        free = torch.ones(len(target["labels"]), dtype=torch.bool)
        for i in range(len(boxes)):
            left = overlap[i] * free
            if len(left) and float(left.max()) >= 0.5:
                j = int(left.argmax())
                free[j] = False
                counts[int(target["labels"][j]) - 1, int(labels[i]) - 1] += 1
        for label in target["labels"][free].tolist():
            counts[label - 1, classes] += 1
    return counts


def hits(
    target: Mapping[str, Any], each: Found, least: Sequence[float], masks: bool = False
) -> NDArray[np.bool_]:
    """Return which labels of one image are found, bool [N].

    A detection must have the label's class, at least its score in `least`, and an IoU of at least
    0.5. Best detections come first, and each takes the free label with the largest overlap.
    """
    order = each["scores"].argsort(descending=True, stable=True).tolist()
    overlap = _mask_iou(each["masks"], target["masks"]) if masks else None
    if overlap is None:
        overlap = iou(each["boxes"], target["boxes"]).numpy()
    hit = np.zeros(len(target["labels"]), bool)
    for i in order:
        same = (target["labels"] == each["labels"][i]).numpy() & ~hit
        if float(each["scores"][i]) < least[int(each["labels"][i]) - 1] or not same.any():
            continue
        j = int(np.where(same, overlap[i], -1).argmax())
        hit[j] = overlap[i, j] >= 0.5
    return hit


def _mask_iou(a: torch.Tensor, b: torch.Tensor) -> NDArray[np.float64]:
    shape = (len(a), len(b))
    return np.asarray(coco_mask.iou(_rle(a), _rle(b), [0] * len(b))).reshape(shape)


def compressed(found: Found) -> Found:
    """Return detections whose masks are COCO's run lengths, which take far less memory."""
    return {**found, "masks": _rle(found["masks"])}


def _rle(masks: torch.Tensor | list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return COCO's run lengths of masks bool [N, H, W]; those of `compressed` stay as they are."""
    if isinstance(masks, list):
        return masks
    return [coco_mask.encode(np.asfortranarray(m.numpy().astype(np.uint8))) for m in masks]


def _entries(one: Mapping[str, Any], image_id: int, masks: bool) -> list[dict[str, Any]]:
    """Return the class, and the mask or box, of each object of an image in COCO's JSON form.

    COCO derives the size class of a detection from its mask or box, so it must have only one.
    """
    shapes: list[dict[str, Any]]
    if masks:
        shapes = [{"segmentation": mask} for mask in _rle(one["masks"])]
    else:
        corners = one["boxes"].tolist()
        shapes = [{"bbox": [x0, y0, x1 - x0, y1 - y0]} for x0, y0, x1, y1 in corners]
    labels = one["labels"].tolist()
    return [
        {"image_id": image_id, "category_id": label, **shape}
        for label, shape in zip(labels, shapes, strict=True)
    ]


def _nothing(truth: COCO) -> COCO:
    empty = COCO()
    empty.dataset = {**truth.dataset, "annotations": []}
    empty.createIndex()
    return empty


def _scored(
    measured: COCOeval, k: int, images: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_], int]:
    """Return Scores.scored of one class, over all sizes."""
    areas = len(measured.params.areaRng)
    entries = measured.evalImgs[k * areas * images : k * areas * images + images]
    seen = [entry for entry in entries if entry is not None]
    if not seen:
        return np.zeros(0), np.zeros(0, bool), 0
    counted = np.concatenate([np.asarray(entry["dtIgnore"])[0] == 0 for entry in seen])
    values = np.concatenate([np.asarray(entry["dtScores"], float) for entry in seen])
    hit = np.concatenate([np.asarray(entry["dtMatches"])[0] > 0 for entry in seen])
    labels = sum(int(np.count_nonzero(np.asarray(entry["gtIgnore"]) == 0)) for entry in seen)
    return values[counted], hit[counted], labels


def _curves(scores: Scores) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return precision, recall and F1 in 0..1 of each class at each of _THRESHOLDS.

    Precision and recall are nan without detections or labels; F1 is 0 then.
    """
    curves = [_curve(*each) for each in scores.scored]
    precision = np.array([p for p, _ in curves])
    recall = np.array([r for _, r in curves])
    f1 = 2 * precision * recall / np.maximum(precision + recall, 1e-9)
    return precision, recall, np.nan_to_num(f1)


def _curve(
    values: NDArray[np.float64], hit: NDArray[np.bool_], labels: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    kept = values[None] >= _THRESHOLDS[:, None]
    right, called = (kept & hit).sum(axis=1), kept.sum(axis=1)
    precision = np.where(called > 0, right / np.maximum(called, 1), np.nan)
    return precision, right / labels if labels else np.full(len(_THRESHOLDS), np.nan)


def _mean(values: NDArray[np.float64]) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else float("nan")


def _percent(share: float) -> float:
    """Convert a share to percent. COCOeval reports -1 if there is nothing to measure."""
    return 100 * share if share >= 0 else float("nan")
