"""Sampling of the seals at the hasps of a door."""

from collections.abc import Callable

import numpy as np

from fastgen.config.config import SealsConfig, linear_color
from fastgen.scene import Seal

_HASP_WEIGHTS = (1.0, 1.0, 3.0, 3.0)
"""Relative frequency of each hasp. The right leaf opens first, so seals are mostly on it."""


def sample_seals(
    config: SealsConfig, streams: Callable[[str], np.random.Generator]
) -> tuple[Seal, ...]:
    """Sample the seals of a container.

    Args:
        config: Distribution of seals.
        streams: Returns the random generator of a property by its name.
    """
    rng = streams("seals")
    if rng.random() >= config.probability:
        return ()
    count = 1 + int(rng.random() < config.second)
    weights = np.array(_HASP_WEIGHTS)
    hasps = rng.choice(len(weights), count, replace=False, p=weights / weights.sum())
    kinds = np.array(list(config.kinds.values()))
    return tuple(
        Seal(
            kind=str(rng.choice(list(config.kinds), p=kinds / kinds.sum())),
            hasp=hasp,
            state="hanging" if rng.random() < config.hanging else "locked",
            albedo=linear_color(str(rng.choice(config.colors))),
        )
        for hasp in sorted(hasps.tolist())
    )
