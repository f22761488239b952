"""Distance between two sets of pictures: per statistic, per cue, and in total."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import wasserstein_distance

from fastgen.fit.statistics import NAMES, STATISTICS

Array = NDArray[np.float64]

FEWEST = 3
"""Pictures that must show a property before it is compared."""


class Gap(NamedTuple):
    """Distance of rendered pictures from photographs.

    Attributes:
        of_statistic: float64 [len(NAMES)], in spreads of the photographs; nan if not comparable.
        of_cue: Mean over the statistics of each cue.
        total: Mean over the cues.
    """

    of_statistic: Array
    of_cue: dict[str, float]
    total: float


def gap(photographs: Array, renders: Array, weights: Array | None = None) -> Gap:
    """Return the distance of rendered pictures from photographs.

    The distance of a statistic is the Wasserstein-1 distance between its two distributions, divided
    by the standard deviation over the photographs, which is at least the statistic's floor.

    Args:
        photographs: Statistics [M, len(NAMES)] as from `measured`; nan where not measurable.
        renders: Statistics [N, len(NAMES)].
        weights: Relative frequency [N] of each rendered picture; by default all are equal.
    """
    of_statistic = np.full(len(NAMES), np.nan)
    cues: dict[str, list[float]] = {}
    for k, name in enumerate(NAMES):
        theirs, ours = np.isfinite(photographs[:, k]), np.isfinite(renders[:, k])
        frequency = np.ones(ours.sum()) if weights is None else weights[ours]
        if min(theirs.sum(), ours.sum()) < FEWEST or not frequency.sum():
            continue
        real = photographs[theirs, k]
        spread = max(float(real.std()), STATISTICS[name].floor)
        away = wasserstein_distance(real, renders[ours, k], None, frequency) / spread
        of_statistic[k] = away
        cues.setdefault(STATISTICS[name].cue, []).append(away)
    of_cue = {cue: float(np.mean(values)) for cue, values in cues.items()}
    return Gap(of_statistic, of_cue, float(np.mean(list(of_cue.values()))))


def table(before: Gap, after: Gap) -> str:
    """Return the gap of each cue before and after a fit, the largest remaining one first."""
    cues = sorted(after.of_cue, key=lambda cue: -after.of_cue[cue])
    lines = [f"{'cue':24s} {'before':>7s} {'after':>7s}   largest remaining statistic"]
    for cue in cues:
        lines.append(
            f"{cue:24s} {before.of_cue.get(cue, np.nan):7.2f} {after.of_cue[cue]:7.2f}   "
            + _worst(cue, after)
        )
    return "\n".join([*lines, f"{'mean':24s} {before.total:7.2f} {after.total:7.2f}"])


def _worst(cue: str, after: Gap) -> str:
    known: Mapping[str, float] = {
        name: value
        for name, value in zip(NAMES, after.of_statistic, strict=True)
        if STATISTICS[name].cue == cue and np.isfinite(value)
    }
    name = max(known, key=lambda each: known[each])
    return f"{name} ({known[name]:.2f})"
