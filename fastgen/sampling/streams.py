"""Random generators of a scene by property, and choices.

`Generator.choice` takes about 10 us, mostly for checks and arrays of strings. The functions here
draw the same values in less time.
"""

import hashlib
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TypeVar

import numpy as np

Streams = Callable[[str], np.random.Generator]
"""Function from the name of a property to its independent random generator."""

T = TypeVar("T")


def stream(seed: int, index: int, name: str) -> np.random.Generator:
    """Return the random generator of one property of one scene.

    Args:
        seed: Seed of the dataset.
        index: Index of the scene.
        name: Name of the property.

    Returns:
        PCG64 generator seeded with a hash of the arguments, independent of all other generators.
    """
    key = hashlib.blake2b(f"{seed}/{index}/{name}".encode(), digest_size=16).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(key, "little")))


def one_of(rng: np.random.Generator, choices: Sequence[T]) -> T:
    """Return one of the choices; all are equally likely."""
    return choices[int(rng.integers(len(choices)))]


def weighted_choice(rng: np.random.Generator, weights: Mapping[T, float]) -> T:
    """Return a key, drawn in proportion to its weight.

    Args:
        rng: Random generator.
        weights: Weights of the keys; their sum is above 0.
    """
    return list(weights)[bisect_right(_cumulative(tuple(weights.values())), rng.random())]


@lru_cache
def _cumulative(weights: tuple[float, ...]) -> list[float]:
    """Return the upper ends of shares of [0, 1) that are proportional to the weights."""
    ends = np.cumsum(np.array(weights) / np.sum(weights))
    found: list[float] = (ends / ends[-1]).tolist()
    return found
