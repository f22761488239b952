"""Draws what a camera and its weather do to an image; each part from a stream of its own."""

import itertools
from collections.abc import Iterator

import numpy as np

from fastgen.records import Range
from fastgen.sensor.parts import Lens
from fastgen.sensor_config import LensConfig


def sample_lens(config: LensConfig, rng: np.random.Generator) -> Lens:
    """One lens of the kind that `config` describes; coefficients to a millionth."""
    drawn = {name: _between(rng, getattr(config, name)) for name in sorted(config.names)}
    return Lens(config.model, tuple(round(drawn[name], 6) for name in config.names))


def extreme_lenses(config: LensConfig) -> Iterator[Lens]:
    """The lenses at the ends of all ranges."""
    ends = [sorted({*getattr(config, name)}) for name in config.names]
    return (Lens(config.model, values) for values in itertools.product(*ends))


def _between(rng: np.random.Generator, values: Range) -> float:
    return float(rng.uniform(values.lo, values.hi))
