"""Random generators of a scene by property, and weighted choices."""

from collections.abc import Callable, Mapping

import numpy as np

Streams = Callable[[str], np.random.Generator]
"""Function from the name of a property to its independent random generator."""


def weighted_choice(rng: np.random.Generator, weights: Mapping[str, float]) -> str:
    """Return a key, drawn in proportion to its weight.

    Args:
        rng: Random generator.
        weights: Weights of the keys; their sum is above 0.
    """
    shares = np.array(list(weights.values()))
    return str(rng.choice(list(weights), p=shares / shares.sum()))
