"""Conversion between plain values and dataclasses, and its error messages."""

from dataclasses import dataclass, field

import pytest

from fastgen.errors import ConfigError
from fastgen.validation import Range, bounds, from_plain, to_plain


@dataclass(frozen=True)
class Inner:
    size: float = field(default=1.0, metadata=bounds(0.5, 2.0, "mm"))
    span: Range = field(default=Range(0, 1), metadata=bounds(0, 10))


@dataclass(frozen=True)
class Outer:
    name: str
    count: int = 3
    inner: Inner = field(default_factory=Inner)
    many: dict[str, Inner] = field(default_factory=lambda: {"a": Inner(1.5), "b": Inner()})
    pair: tuple[float, float] = (1.0, 2.0)
    flag: bool = False
    maybe: float | None = None


def test_round_trip_gives_an_equal_value():
    value = Outer("x", 7, Inner(0.75, Range(2, 3)), {"c": Inner()}, (4.0, 5.0), True, 1.5)
    assert from_plain(Outer, to_plain(value)) == value


def test_a_single_number_is_a_range_of_one_value():
    assert from_plain(Inner, {"span": 4}).span == Range(4, 4)


def test_missing_fields_come_from_the_base():
    base = Outer("x", inner=Inner(0.9))
    changed = from_plain(Outer, {"inner": {"span": [1, 2]}}, base=base)
    assert changed.inner == Inner(0.9, Range(1, 2))
    assert changed.name == "x"


def test_a_mapping_replaces_the_base_but_equal_keys_inherit():
    changed = from_plain(Outer, {"many": {"a": {"span": [2, 3]}}}, base=Outer("x"))
    assert changed.many == {"a": Inner(1.5, Range(2, 3))}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"name": "x", "cuont": 1}, r"cuont: unknown key \(did you mean count\?\)"),
        ({"name": "x", "NAME": "y"}, r"NAME: unknown key \(did you mean name\?\)"),
        ({}, "missing name"),
        ({"name": 3}, "name: expected text, got 3"),
        ({"name": "x", "count": 1.5}, "count: expected a whole number"),
        ({"name": "x", "count": True}, "count: expected a number"),
        ({"name": "x", "flag": 1}, "flag: expected true or false"),
        ({"name": "x", "inner": {"size": 3}}, r"inner.size: 3 is out of range; give 0.5 to 2 mm"),
        ({"name": "x", "inner": {"size": float("nan")}}, "inner.size: nan is out of range"),
        ({"name": "x", "inner": {"span": [3, 2]}}, "inner.span: the lowest value 3 is above"),
        ({"name": "x", "inner": {"span": [3, 2, 1]}}, "inner.span: expected"),
        ({"name": "x", "inner": {"span": [3, 20]}}, "inner.span: 20 is out of range"),
        ({"name": "x", "inner": 4}, "inner: expected a mapping"),
        ({"name": "x", "many": {"z": {"size": 9}}}, "many.z.size: 9 is out of range"),
        ({"name": "x", "pair": [1]}, "pair: expected 2 values, got 1"),
        ({"name": "x", "maybe": "y"}, "maybe: expected a number"),
    ],
)
def test_errors_name_the_field_and_what_to_do(data, message):
    with pytest.raises(ConfigError, match=message):
        from_plain(Outer, data)
