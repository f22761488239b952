"""Strategies and the number of inputs of property-based tests.

Each test tries a few inputs, always the same. This tries 100,000 in each, other ones every time:

    FASTGEN_FUZZ=100000 pytest tests/stability/test_fuzzed_input.py

test_poses.py and test_storage.py take their number of poses or kills from it, too.
"""

import os
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

COUNT = int(os.environ.get("FASTGEN_FUZZ", "0"))

SLOW_CHECKS = [
    HealthCheck.too_slow,
    HealthCheck.function_scoped_fixture,
    HealthCheck.data_too_large,
]


def inputs(few: int) -> settings:
    """Return the settings of a test that tries `few` inputs, or COUNT if it is set."""
    return settings(
        max_examples=COUNT or few,
        derandomize=not COUNT,
        database=None,
        deadline=None,
        suppress_health_check=SLOW_CHECKS,
    )


TEXTS = st.one_of(
    st.sampled_from(["", "a", "\x1b[31m", "\u202e", "\x00", "é", "🚢", "~", "20", "nan", "../x"]),
    st.text(max_size=12),
)

NUMBERS = st.one_of(
    st.sampled_from([0, -0.0, 1, -1, 0.5, 1e300, -1e300, 5e-324, 2**63, -(2**63), 10**400]),
    st.integers(),
    st.floats(),
)

SCALARS = st.one_of(st.none(), st.booleans(), NUMBERS, TEXTS)

VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=8,
)
"""JSON values, also those that JSON writes only as extensions, such as NaN."""


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of all values in nested lists and dictionaries."""
    items: Any = value.items() if isinstance(value, dict) else ()
    items = enumerate(value) if isinstance(value, list) else items
    return [path, *(each for step, item in items for each in places(item, (*path, step)))]


def changed(value: Any, path: tuple[Any, ...], change: Any) -> Any:
    """Return a copy with `change(old)` at one place."""
    if not path:
        return change(value)
    copy = value.copy()
    copy[path[0]] = changed(value[path[0]], path[1:], change)
    return copy


@st.composite
def mutated(draw: Any, value: Any, most: int = 3) -> Any:
    """Return a strategy for a value with some places replaced, removed, repeated or renamed."""
    for _ in range(draw(st.integers(1, most))):
        paths = places(value)
        path = draw(st.sampled_from(paths))
        kind = draw(st.sampled_from(["replace", "remove", "rename", "repeat", "nest"]))
        new, name = draw(VALUES), draw(TEXTS)

        def change(old: Any, kind: str = kind, new: Any = new, name: str = name) -> Any:
            if kind == "nest":
                return {name: old} if isinstance(new, dict) else [old]
            if not old or kind == "replace" or not isinstance(old, dict | list):
                return new
            if isinstance(old, list):
                return old[1:] if kind == "remove" else [*old, *old, new]
            first, *rest = old
            if kind == "remove":
                return {key: old[key] for key in rest}
            return {name: old[first], **{key: old[key] for key in rest}, name + "x": new}

        value = changed(value, path, change)
    return value
