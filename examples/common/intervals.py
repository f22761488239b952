"""Means of repeated trainings with 95 % confidence intervals by bootstrap."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_REPLICATES = 2000
_TAILS = (2.5, 97.5)


class Mean(NamedTuple):
    """A mean and the ends of its interval."""

    mean: float
    low: float
    high: float


def interval(values: NDArray[np.floating], scenes: NDArray[np.int64], seed: int = 0) -> Mean:
    """Mean over all trainings and test items, in percent.

    values: [S, N], of S trainings what each of N items counts, such as 1 where it is right, or
    the difference of two trainings there. scenes: [N], where each item is from. Items of a scene
    are not independent, so whole scenes are drawn with replacement, and trainings likewise (a
    two-way bootstrap; Owen 2007, The pigeonhole bootstrap).
    """
    names, group = np.unique(scenes, return_inverse=True)
    sums = np.stack([np.bincount(group, row, minlength=len(names)) for row in values])
    sizes = np.bincount(group, minlength=len(names))
    rng = np.random.default_rng(seed)
    runs = rng.multinomial(len(values), np.full(len(values), 1 / len(values)), _REPLICATES)
    drawn = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), _REPLICATES)
    drawn_mean = np.einsum("rs,sg,rg->r", runs, sums, drawn) / (len(values) * (drawn @ sizes))
    low, high = np.percentile(drawn_mean, _TAILS)
    return Mean(100 * float(values.mean()), 100 * float(low), 100 * float(high))
