"""Blur and overshoot of the strongest edges of a picture, from profiles across them."""

import cv2
import numpy as np
from numpy.typing import NDArray

_REACH = 8
_INNER, _OUTER = 4, 5  # overshoot lies up to the first, plateaus begin at the second
_EDGES = 300
_FEWEST = 10
_LEAST_STEP = 0.12
_STEPS_PER_PX = 2
_UNEVEN = 0.15
"""Largest standard deviation of a plateau, as a share of the step."""


def edge_blur_and_overshoot(grey: NDArray[np.float32]) -> tuple[float, float]:
    """Return the blur and the overshoot of the strongest edges.

    A profile of 17 pixels across each edge has a plateau at either end. The blur is the standard
    deviation of a Gaussian whose step rises as steeply. The overshoot is the mean excess of the
    profile over its plateaus near the edge, as a share of the step, as unsharp masks leave it.

    Args:
        grey: Luma float32 [H, W], 0..1.

    Returns:
        Median blur in pixels and median overshoot; nan for pictures with less than 10 such edges.
    """
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *way, ksize=3) / 8 for way in ((1, 0), (0, 1)))
    slope = np.hypot(across, down)
    thick = slope >= cv2.dilate(slope, np.ones((5, 5), np.uint8)) - 1e-7
    thick[: _REACH + 1], thick[-_REACH - 1 :] = False, False
    thick[:, : _REACH + 1], thick[:, -_REACH - 1 :] = False, False
    y, x = np.nonzero(thick & (slope > _LEAST_STEP / 6))
    strongest = np.argsort(-slope[y, x], kind="stable")[:_EDGES]
    y, x = y[strongest], x[strongest]
    if len(y) < _FEWEST:
        return np.nan, np.nan
    offsets = np.arange(-_REACH, _REACH + 1 / _STEPS_PER_PX, 1 / _STEPS_PER_PX)
    away = slope[y, x]
    columns = x[:, None] + offsets * (across[y, x] / away)[:, None]
    rows = y[:, None] + offsets * (down[y, x] / away)[:, None]
    profile = cv2.remap(grey, columns.astype(np.float32), rows.astype(np.float32), cv2.INTER_CUBIC)
    low = np.median(profile[:, offsets <= -_OUTER], axis=1)
    high = np.median(profile[:, offsets >= _OUTER], axis=1)
    step = high - low
    ends = profile[:, offsets <= -_OUTER], profile[:, offsets >= _OUTER]
    uneven = np.maximum(*(end.std(axis=1) for end in ends))
    good = (step > _LEAST_STEP) & (high < 0.95) & (low > 0.04) & (uneven < _UNEVEN * step)
    if good.sum() < _FEWEST:
        return np.nan, np.nan
    profile, low, high, step = profile[good], low[good], high[good], step[good]
    above = profile[:, (offsets > 0) & (offsets <= _INNER)].max(axis=1) - high
    below = low - profile[:, (offsets < 0) & (offsets >= -_INNER)].min(axis=1)
    steepest = (np.diff(profile, axis=1)[:, abs(offsets[:-1]) <= 2].max(axis=1)) * _STEPS_PER_PX
    # a step blurred by s rises by step / (s sqrt(2 pi)) per pixel
    blur = step / (np.maximum(steepest, 1e-6) * np.sqrt(2 * np.pi))
    return float(np.median(blur)), float(np.median((above + below) / (2 * step)))
