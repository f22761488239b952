"""Means of repeated trainings with 95 % bootstrap confidence intervals."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_REPLICATES = 2000
_TAILS = (2.5, 97.5)


class Mean(NamedTuple):
    """A mean and the ends of its confidence interval."""

    mean: float
    low: float
    high: float


def interval(values: NDArray[np.floating], scenes: NDArray[np.int64], seed: int = 0) -> Mean:
    """Return the mean over all trainings and test items, in percent, with its interval.

    Items of a scene are not independent, so the bootstrap draws whole scenes with replacement, and
    trainings likewise (Owen 2007, The pigeonhole bootstrap).

    Args:
        values: Value of each of N items in each of S trainings [S, N], for example 1 for a correct
            answer, or the difference of two trainings.
        scenes: Scene of each item [N].
        seed: Seed of the bootstrap.
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
