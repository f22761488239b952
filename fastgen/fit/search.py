"""Black-box search for the sensor and the mix of light whose pictures resemble photographs.

Scenes are rendered once. A trial only applies another camera model to their linear light and weighs
the classes of light anew, which takes milliseconds per picture.

The optimizer is CMA-ES (Hansen 2016, "The CMA Evolution Strategy: A Tutorial") from pycma. The
objective is noisy and not separable, with about 17 variables and some hundred trials. Compared
with the alternatives: pycma needs only numpy; optuna has CMA-ES through `cmaes` and TPE, but needs
SQLAlchemy, Alembic and tqdm; scipy is a dependency already, but its global optimizers need
thousands of trials and its local ones do not average over noise.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.config.sensor import SensorConfig
from fastgen.cpus import usable_cpus
from fastgen.errors import ConfigError
from fastgen.fit.frames import LinearFrame, statistics_of_frames
from fastgen.fit.gap import gap
from fastgen.fit.space import Point, point_of, sensor_at

_POPULATION = 12
_FIRST_STEP = 0.15
_PULL = 0.04
"""Price of a squared distance from the preset, so that variables without effect stay there."""

_LOG_REACH = 3.0
"""Largest natural logarithm of the factor on the weight of a class of light."""


class Found(NamedTuple):
    """Result of a search.

    Attributes:
        point: Variables of the sensor, see `space.VARIABLES`.
        shares: Share of each class of light.
        trials: Number of trials.
    """

    point: Point
    shares: dict[str, float]
    trials: int


def search(
    photographs: NDArray[np.float64],
    frames: Sequence[LinearFrame],
    preset: SensorConfig,
    shares: Mapping[str, float],
    trials: int,
    seed: int = 0,
    on_trials: Callable[[int, float], None] = lambda done, best: None,
) -> Found:
    """Return the sensor and the shares of light with the smallest gap to photographs.

    The result depends on the arguments alone, not on the speed or the cores of the machine.

    Args:
        photographs: Statistics [M, len(NAMES)] of the photographs.
        frames: Rendered frames.
        preset: Sensor to start from.
        shares: Share of each class of light in the preset. With one class, or an empty mapping, the
            light stays as it is.
        trials: Number of trials, rounded up to whole generations of 12.
        seed: Seed of the optimizer.
        on_trials: Called after each generation with the number of trials and the smallest gap.

    Raises:
        ConfigError: The package cma is not installed.
    """
    cma = optimizer()
    lights = list(shares) if len(shares) > 1 else []
    start = np.concatenate([point_of(preset), np.full(len(lights), 0.5)])
    size = len(start) - len(lights)
    frame_lights = [each.light for each in frames]
    counts = {light: frame_lights.count(light) for light in set(frame_lights)}

    def objective(x: Point, workers: ThreadPoolExecutor) -> float:
        statistics = statistics_of_frames(frames, sensor_at(x[:size], preset), workers)
        mixed = mixed_shares(shares, x[size:]) if lights else dict(shares)
        weights = np.array([mixed.get(light, 1.0) / counts[light] for light in frame_lights])
        return gap(photographs, statistics, weights).total + _PULL * float(((x - start) ** 2).sum())

    options = {
        "bounds": [0, 1],
        "popsize": _POPULATION,
        "seed": seed + 1,  # pycma takes 0 as a request for the clock
        "verbose": -9,
        "verb_log": 0,
    }
    strategy = cma.CMAEvolutionStrategy(start, _FIRST_STEP, options)
    best, done = start, 0
    with ThreadPoolExecutor(usable_cpus()) as workers:
        smallest = objective(start, workers)
        while done < trials:
            points = strategy.ask()
            prices = [objective(np.asarray(x), workers) for x in points]
            strategy.tell(points, prices)
            done += len(points)
            if min(prices) < smallest:
                smallest = min(prices)
                best = np.asarray(points[int(np.argmin(prices))])
            on_trials(done, smallest)
        # the mean of the last generation is often better than any of its points
        mean = np.clip(strategy.mean, 0, 1)
        if objective(mean, workers) < smallest:
            best = mean
    found = mixed_shares(shares, best[size:]) if lights else dict(shares)
    return Found(best[:size], found, done)


def mixed_shares(shares: Mapping[str, float], point: Point) -> dict[str, float]:
    """Return shares of light after changing their logarithms; 0.5 leaves a class as it is."""
    factors = np.exp(_LOG_REACH * (2 * np.asarray(point) - 1))
    raw = {
        light: share * float(f) for (light, share), f in zip(shares.items(), factors, strict=True)
    }
    total = sum(raw.values())
    return {light: value / total for light, value in raw.items()}


def optimizer() -> Any:
    """Return the module of the optimizer.

    Raises:
        ConfigError: It is not installed.
    """
    try:
        import cma
    except ImportError:
        raise ConfigError("fit needs the package cma; run pip install 'fastgen[fit]'") from None
    return cma
