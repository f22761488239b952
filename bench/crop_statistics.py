"""Named statistics of pictures, and the measures that the comparison with real pictures uses."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.fit.statistics import Pixels, planes_of, scaled

Array = NDArray[np.float64]

Scores = Sequence[float] | NDArray[np.floating]
"""One score per picture."""

_Z95 = 1.959964
_REPLICATES = 1000
_FOLDS = 5
_DARK, _BRIGHT = 0.12, 0.95
_EDGE = 0.15
_RIDGE = 1.0


class Interval(NamedTuple):
    """A value and the ends of its 95 % confidence interval."""

    value: float
    low: float
    high: float


def wilson(right: float, count: int) -> Interval:
    """Return the share right / count with Wilson's score interval (Wilson 1927)."""
    if count == 0:
        return Interval(math.nan, math.nan, math.nan)
    share, z2 = right / count, _Z95**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = _Z95 * math.sqrt(share * (1 - share) / count + z2 / (4 * count**2)) / (1 + z2 / count)
    return Interval(share, max(middle - half, 0.0), min(middle + half, 1.0))


def auc(positive: Scores, negative: Scores) -> float:
    """Return the probability that a positive has a higher score than a negative; ties count half.

    nan if either is empty.
    """
    high, low = np.asarray(positive, float)[:, None], np.asarray(negative, float)[None]
    if not high.size or not low.size:
        return math.nan
    return float((high > low).mean() + 0.5 * (high == low).mean())


def auc_interval(positive: Scores, negative: Scores, seed: int = 0) -> Interval:
    """Return the AUC with a 95 % bootstrap interval; positives and negatives are drawn apart."""
    high, low = np.asarray(positive, float), np.asarray(negative, float)
    if not len(high) or not len(low):
        return Interval(math.nan, math.nan, math.nan)
    rng = np.random.default_rng(seed)
    drawn = [
        auc(rng.choice(high, len(high)), rng.choice(low, len(low))) for _ in range(_REPLICATES)
    ]
    return Interval(auc(high, low), *(float(v) for v in np.percentile(drawn, (2.5, 97.5))))


def statistics_of(pixels: Pixels, longest: int) -> dict[str, float]:
    """Return the named statistics of a picture, after scaling its longer side to `longest`."""
    planes = planes_of(scaled(pixels, longest))
    rgb, grey, hue, saturation = planes.rgb, planes.grey, planes.hue, planes.saturation
    local, fine, middle, flat = planes.local, planes.fine, planes.middle, planes.flat
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *way, ksize=3) / 4 for way in ((1, 0), (0, 1)))
    slope = np.hypot(across, down)
    red, green, blue = (float(rgb[..., k].mean()) + 1e-3 for k in range(3))
    brown = (hue < 40) & (saturation > 0.3) & (grey < 0.6)
    return {
        "mean brightness": float(grey.mean()),
        "contrast": float(grey.std()),
        "local contrast": float(local.mean()),
        "mean saturation": float(saturation.mean()),
        "spread of saturation": float(saturation.std()),
        "share of dark pixels": float((grey < _DARK).mean()),
        "share of bright pixels": float((grey > _BRIGHT).mean()),
        "share of red-brown": float(brown.mean()),
        "red over blue": math.log(red / blue),
        "green over red and blue": math.log(green * green / (red * blue)),
        "edge density": float((slope > _EDGE).mean()),
        "upright over level edges": math.log(
            (float(np.abs(across).mean()) + 1e-4) / (float(np.abs(down).mean()) + 1e-4)
        ),
        "finest detail": math.log(float(fine.std()) + 1e-4),
        "finest over middle detail": math.log((float(fine.std()) + 1e-4) / (middle.std() + 1e-4)),
        "noise of flat areas": math.log(float(np.median(np.abs(fine[flat]))) + 1e-4),
        "color noise of flat areas": math.log(_color_noise(rgb, flat) + 1e-4),
    }


def _color_noise(rgb: NDArray[np.float32], flat: NDArray[np.bool_]) -> float:
    chroma = rgb[..., 0] - rgb[..., 2]
    return float(np.median(np.abs(chroma - cv2.GaussianBlur(chroma, (0, 0), 1.0))[flat]))


def single_aucs(ours: Array, theirs: Array, names: Sequence[str]) -> dict[str, float]:
    """Return the AUC of each statistic alone, highest first.

    Args:
        ours: Statistics [N, K] of our pictures.
        theirs: Statistics [M, K] of the real pictures.
        names: Names of the K statistics.

    Returns:
        AUC by name, at least 0.5: an AUC below is replaced by 1 - AUC.
    """
    found = {name: auc(ours[:, k], theirs[:, k]) for k, name in enumerate(names)}
    found = {name: max(value, 1 - value) for name, value in found.items()}
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def joint_scores(ours: Array, theirs: Array, seed: int = 0) -> tuple[Array, Array]:
    """Return out-of-fold scores of a logistic regression on all statistics.

    Folds are stratified. Both groups have the same total weight.

    Args:
        ours: Statistics [N, K] of our pictures.
        theirs: Statistics [M, K] of the real pictures.
        seed: Seed of the folds.

    Returns:
        Scores [N] of ours and [M] of theirs; higher means more like ours.
    """
    rng = np.random.default_rng(seed)
    values = np.concatenate([ours, theirs])
    mine = np.arange(len(values)) < len(ours)
    fold = np.empty(len(values), int)
    for group in (mine, ~mine):
        fold[group] = rng.permutation(int(group.sum())) % _FOLDS
    scores = np.empty(len(values))
    for number in range(_FOLDS):
        held = fold == number
        train = values[~held]
        center, spread = train.mean(axis=0), train.std(axis=0) + 1e-9
        weights = _logistic((train - center) / spread, mine[~held])
        scores[held] = np.clip((values[held] - center) / spread, -5, 5) @ weights[1:] + weights[0]
    return scores[mine], scores[~mine]


def _logistic(values: Array, positive: NDArray[np.bool_]) -> Array:
    """Fit a ridge-regularized logistic regression by Newton's method; intercept first."""
    x = np.concatenate([np.ones((len(values), 1)), values], axis=1)
    share = np.where(positive, 0.5 / max(positive.sum(), 1), 0.5 / max((~positive).sum(), 1))
    share *= len(x)
    ridge = _RIDGE * np.eye(x.shape[1])
    ridge[0, 0] = 1e-6
    weights = np.zeros(x.shape[1])
    for _ in range(30):
        p = 1 / (1 + np.exp(-np.clip(x @ weights, -30, 30)))
        slope = x.T @ (share * (p - positive)) + ridge @ weights
        curve = (x * (share * p * (1 - p))[:, None]).T @ x + ridge
        weights = weights - np.linalg.solve(curve, slope)
    return weights
