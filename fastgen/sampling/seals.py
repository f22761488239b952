"""Sampling of the seals at the hasps of a door."""

from collections.abc import Sequence

import numpy as np

from fastgen.config.config import SealsConfig
from fastgen.config.fields import linear_color
from fastgen.sampling.streams import Streams, one_of, weighted_choice
from fastgen.scene import Damage, Seal
from fastgen.scene.door_gear import damaged_gear

_HASP_WEIGHTS = (1.0, 1.0, 3.0, 3.0)
"""Relative frequency of each hasp. The right leaf opens first, so seals are mostly on it."""


def sample_seals(
    config: SealsConfig, damages: Sequence[Damage], streams: Streams
) -> tuple[Seal, ...]:
    """Sample the seals of a container. Locking bars with damaged gear have none.

    Args:
        config: Distribution of seals.
        damages: Damages of the container.
        streams: Returns the random generator of a property by its name.
    """
    rng, damaged = streams("seals"), damaged_gear(damages)
    if rng.random() >= config.probability:
        return ()
    count = 1 + int(rng.random() < config.second)
    weights = np.array(_HASP_WEIGHTS)
    hasps = rng.choice(len(weights), count, replace=False, p=weights / weights.sum())
    return tuple(
        Seal(
            kind=weighted_choice(rng, config.kinds),
            hasp=hasp,
            state="hanging" if rng.random() < config.hanging else "locked",
            albedo=linear_color(one_of(rng, config.colors)),
        )
        for hasp in sorted(hasps.tolist())
        if hasp not in damaged
    )
