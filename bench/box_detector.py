"""Detector of containers: its training on renders, and its scores with intervals over images."""

import contextlib
import copy
import io
from collections.abc import Sequence
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
import torch
from box_variation import CANVAS_PX, Example, fitted, varied
from common.detection_metrics import Found, matched, operating_point, score
from common.detector import Detector
from crop_networks import optimize, toned
from crop_statistics import Interval
from real_crops import BoxedImage

_NAMES = ("container",)
_SIZE = (CANVAS_PX, CANVAS_PX)
_BATCH = 8
_RATE = 2e-3
_REPLICATES = 1000


class Detections(NamedTuple):
    """Images of the detector's size with their labels, and what it finds in each."""

    examples: Sequence[Example]
    found: Sequence[Found]

    @property
    def targets(self) -> list[dict[str, Any]]:
        """Labels of each image."""
        return [target for _, target in self.examples]

    def where(self, chosen: Sequence[bool]) -> "Detections":
        """Return the images for which `chosen` is true."""
        return Detections(list(compress(self.examples, chosen)), list(compress(self.found, chosen)))


def fit_detector(images: Sequence[BoxedImage], steps: int, seed: int) -> Detector:
    """Train a detector of containers on random crops of images with varied tones.

    Args:
        images: Labelled images.
        steps: Training steps.
        seed: Seed of weights, order and variation.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    model = Detector(len(_NAMES), blocks=2)

    def loss() -> torch.Tensor:
        chosen = rng.integers(len(images), size=_BATCH)
        pixels, targets = zip(*(varied(images[k], rng) for k in chosen), strict=True)
        changed = toned(torch.stack(pixels).float() / 255).clamp(0, 1)
        return model.loss(list((255 * changed).round().byte()), list(targets))

    optimize(model, loss, steps, _RATE)
    return model


def detect(model: Detector, images: Sequence[BoxedImage]) -> Detections:
    """Return what the detector finds in whole images."""
    model.eval()
    examples = [fitted(image) for image in images]
    return Detections(examples, [model.predict([pixels])[0] for pixels, _ in examples])


def best_score(seen: Detections) -> float:
    """Return the score from which on detections have the best F1."""
    return operating_point(score(seen.targets, seen.found, _NAMES, _SIZE)).score


def counts(seen: Detections, least_score: float) -> tuple[int, int, int]:
    """Return the numbers of right detections, of all detections and of labels.

    Args:
        seen: Detections and labels.
        least_score: Lowest score of a detection that counts.
    """
    values, hit, labels = score(seen.targets, seen.found, _NAMES, _SIZE).scored[0]
    kept = values >= least_score
    return int((hit & kept).sum()), int(kept.sum()), labels


def ap50(seen: Detections, seed: int = 0) -> Interval:
    """Return COCO's AP at an IoU of 0.5, in 0..1, with a 95 % bootstrap interval over images."""
    measured = matched(seen.targets, seen.found, _NAMES, _SIZE)
    entries, count = measured.evalImgs, len(seen.examples)
    areas = len(entries) // count
    # boxes of all sizes, and all detections
    params = copy.deepcopy(measured.params)
    params.areaRng, params.maxDets = params.areaRng[:1], params.maxDets[-1:]

    def of(chosen: Sequence[int]) -> float:
        measured.evalImgs = [entries[k * count + i] for k in range(areas) for i in chosen]
        measured.accumulate(params)
        precision = measured.eval["precision"][0]  # at an IoU of 0.5; -1 without labels
        return float(precision.mean()) if precision.min() >= 0 else float("nan")

    rng = np.random.default_rng(seed)
    with contextlib.redirect_stdout(io.StringIO()):
        value = of(range(count))
        drawn = [of(rng.integers(count, size=count).tolist()) for _ in range(_REPLICATES)]
    low, high = np.nanpercentile(drawn, (2.5, 97.5))
    return Interval(value, float(low), float(high))
