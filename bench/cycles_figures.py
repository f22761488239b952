"""Errors and CPU times of Cycles itself, from bench/references/cycles.json."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from reference_set import FOLDER

Curve = list[tuple[int, float, float]]
"""(samples, error, CPU seconds), sorted by samples."""


@dataclass(frozen=True)
class Equal:
    """The number of samples at which Cycles reaches an error, and the CPU seconds they take.

    Both are 0 without a curve. Outside the curve they are those of its nearest end, and `words`
    says "fewer than" or "more than".
    """

    samples: float
    seconds: float
    words: str


@dataclass(frozen=True)
class Figures:
    """Measured errors and times of Cycles.

    Measures are FLIP, SSIM and PSNR of the whole image, then of the objects.

    Attributes:
        floor: By case and filter, the measures between renders with two seeds.
        series: By case, way ("spp" or "denoised") and samples, the CPU seconds and the measures
            against the reference with the box filter.
    """

    floor: dict[int, dict[str, list[float]]]
    series: dict[int, dict[str, dict[str, dict[str, Any]]]]

    @staticmethod
    def load(path: Path = FOLDER / "cycles.json") -> "Figures":
        """Read the packed figures, or return empty ones if the file does not exist."""
        if not path.exists():
            return Figures({}, {})
        data = json.loads(path.read_text(encoding="utf-8"))
        return Figures(*({int(n): v for n, v in data[k].items()} for k in ("floor", "series")))

    def floor_rows(self, filter_name: str) -> list[tuple[float, ...]]:
        """Return the measures of each case that was traced twice."""
        return [tuple(by_filter[filter_name]) for by_filter in self.floor.values()]

    def curve(self, numbers: Sequence[int], way: str, column: int) -> Curve:
        """Return one measure by number of samples, averaged over the cases `numbers`."""
        of_case = [self.series[n][way] for n in numbers if way in self.series.get(n, {})]
        if not of_case:
            return []
        return [
            (
                int(samples),
                float(np.mean([case[samples]["measures"][column] for case in of_case])),
                float(np.mean([case[samples]["seconds"] for case in of_case])),
            )
            for samples in of_case[0]
        ]


def equal_samples(curve: Curve, error: float) -> Equal:
    """Return where a falling curve reaches `error`.

    Interpolates samples over error with both on logarithmic scales, and seconds over samples
    likewise.
    """
    if not curve:
        return Equal(0.0, 0.0, "no known number of")
    samples, errors, seconds = (np.array(column, float) for column in zip(*curve, strict=True))
    errors = np.minimum.accumulate(errors)
    if error >= errors[0]:
        return Equal(samples[0], seconds[0], f"fewer than {samples[0]:.0f}")
    if error < errors[-1]:
        return Equal(samples[-1], seconds[-1], f"more than {samples[-1]:.0f}")
    place = np.interp(-np.log(error), -np.log(errors), np.log(samples))
    needed = float(np.exp(np.interp(place, np.log(samples), np.log(seconds))))
    count = float(np.exp(place))
    return Equal(count, needed, f"{count:.0f}" if count >= 10 else f"{count:.1f}")
