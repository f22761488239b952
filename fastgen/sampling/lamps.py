"""Sampling of floodlights in scenes that their environment leaves dark."""

import numpy as np

from fastgen.config.fields import linear_color
from fastgen.config.lamps import LampsConfig
from fastgen.sampling.streams import one_of
from fastgen.scene.optics import Lamp


def sample_lamps(
    config: LampsConfig, illuminance_lx: float, rng: np.random.Generator
) -> tuple[Lamp, ...]:
    """Sample the lamps of a scene.

    Args:
        config: Probability and ranges.
        illuminance_lx: Light of the environment on level ground.
        rng: Random generator.
    """
    if illuminance_lx >= config.below_lx or rng.random() >= config.probability:
        return ()
    color = linear_color(one_of(rng, config.colors))
    return tuple(
        Lamp(
            azimuth_deg=round(config.azimuth_deg.draw(rng), 2),
            elevation_deg=round(config.elevation_deg.draw(rng), 2),
            illuminance_lx=round(config.illuminance_lx.draw(rng), 1),
            color=color,
        )
        for _ in range(int(rng.integers(*config.count, endpoint=True)))
    )
