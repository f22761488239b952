"""Conversion between plain values and dataclasses, and its error messages."""

import subprocess
import sys
import typing
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pytest
from annotated_types import MaxLen, MinLen

from fastgen.errors import ConfigError
from fastgen.validation import (
    UNIT,
    Bounds,
    Flag,
    Matching,
    OneOf,
    Range,
    annotation,
    check_fields,
    from_plain,
    to_plain,
)

Letters = Annotated[str, Matching("[a-z]+", "is not in small letters; write it as 'abc'")]


@dataclass(frozen=True)
class Inner:
    size: Annotated[float, Bounds(0.5, 2.0, "mm")] = 1.0
    span: Annotated[Range, Bounds(0, 10)] = Range(0, 1)


@dataclass(frozen=True)
class Outer:
    name: str
    count: Annotated[int, Bounds(0, 99)] = 3
    inner: Inner = field(default_factory=Inner)
    many: dict[str, Inner] = field(default_factory=lambda: {"a": Inner(1.5), "b": Inner()})
    pair: tuple[Annotated[float, UNIT], Annotated[float, UNIT]] = (0.0, 1.0)
    flag: Flag = False
    maybe: Annotated[float, UNIT] | None = None
    word: Letters = "x"
    pick: Annotated[tuple[Annotated[str, OneOf(("left", "right"))], ...], MinLen(1), MaxLen(2)] = (
        "left",
    )
    angle: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(0, 1)
    ends: Annotated[tuple[int, int], Bounds(0, 9)] = (1, 2)
    again: Inner | None = None


def test_round_trip_gives_an_equal_value():
    value = Outer("x", 7, Inner(0.75, Range(2, 3)), {"c": Inner()}, (0.4, 0.5), True, 0.5)
    assert from_plain(Outer, to_plain(value)) == value


def test_values_get_the_types_of_their_fields():
    values = {"name": "x", "count": 4.0, "pair": [0, 1], "ends": 3, "inner": {"span": [1, 2]}}
    made = from_plain(Outer, values)
    assert type(made.count) is int
    assert [type(item) for item in made.pair] == [float, float]
    assert made.ends == (3, 3)
    assert type(made.inner.span) is Range
    assert type(made.inner.span.lo) is float


def test_numpy_values_become_those_of_python():
    values = {"name": "x", "count": np.int64(4), "inner": {"size": np.float32(0.5)}}
    values |= {
        "pair": np.array([0.25, 0.5]),
        "many": {"new": {"span": [np.float64(1), np.int8(2)]}},
    }
    made = from_plain(Outer, values)
    assert (made.count, made.pair, made.inner.size) == (4, (0.25, 0.5), 0.5)
    assert made.many["new"].span == Range(1, 2)


def test_a_single_number_is_a_range_of_one_value():
    assert from_plain(Inner, {"span": 4}).span == Range(4, 4)


def test_missing_fields_come_from_the_base():
    base = Outer("x", inner=Inner(0.9), again=Inner(0.7))
    changed = from_plain(Outer, {"inner": {"span": [1, 2]}, "again": {"span": 3}}, base=base)
    assert changed.inner == Inner(0.9, Range(1, 2))
    assert changed.again == Inner(0.7, Range(3, 3))
    assert changed.name == "x"


def test_a_mapping_replaces_the_base_but_equal_keys_inherit():
    changed = from_plain(Outer, {"many": {"a": {"span": [2, 3]}}}, base=Outer("x"))
    assert changed.many == {"a": Inner(1.5, Range(2, 3))}


def test_numbers_are_accepted_as_names():
    assert from_plain(Outer, {"name": "x", "many": {20: {}}}).many == {"20": Inner()}


def test_a_value_that_contains_itself_is_refused():
    values = {"name": "x"}
    values["inner"] = values
    with pytest.raises(ConfigError, match=r"inner\.\w+: unknown key"):
        from_plain(Outer, values)
    endless = []
    endless.append(endless)
    with pytest.raises(ConfigError, match="count: expected a number, got "):
        from_plain(Outer, {"name": "x", "count": endless})


def test_the_path_precedes_the_field():
    with pytest.raises(ConfigError, match=r"^scene\.inner\.size: 3 is out of range"):
        from_plain(Outer, {"name": "x", "inner": {"size": 3}}, "scene")


def test_annotations_are_found_inside_a_type():
    hints = typing.get_type_hints(Outer, include_extras=True)
    assert annotation(Bounds, hints["pair"]) == UNIT
    assert annotation(OneOf, hints["pick"]) == OneOf(("left", "right"))
    assert annotation(Bounds, hints["name"]) is None


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"cuont": 1}, r"cuont: unknown key \(did you mean count\?\)"),
        ({"NAME": "y"}, r"NAME: unknown key \(did you mean name\?\)"),
        ({"inner": {"sice": 1}}, r"inner.sice: unknown key \(did you mean size\?\)"),
        ({"again": {"q": 1}}, r"again.q: unknown key \(choose from size, span\)"),
        ({"many": {"a": {"sice": 1}}}, r"many.a.sice: unknown key \(did you mean size\?\)"),
        ({False: 1}, "Outer: expected a name, got False; put it in quotes"),
        ({"many": {None: {}}}, "many: expected a name, got None; put it in quotes"),
        ({"name": 3}, "name: expected text, got 3; put it in quotes"),
        ({"name": None}, "name: expected text, got None; if it began with #, quote it"),
        ({"count": 1.5}, "count: expected a whole number, got 1.5"),
        ({"count": True}, "count: expected a number, got True"),
        ({"count": "3"}, r"count: expected a number, got '3' \(text; write 3 without quotes\)"),
        ({"count": 100}, "count: 100 is out of range; give 0 to 99"),
        ({"flag": 1}, "flag: expected true or false, got 1"),
        ({"inner": {"size": 3}}, "inner.size: 3 is out of range; give 0.5 to 2 mm"),
        ({"inner": {"size": float("nan")}}, "inner.size: nan is out of range"),
        ({"inner": {"size": 10**400}}, "inner.size: 1000.* is out of range"),
        ({"inner": {"size": "1e0"}}, r"inner.size: .* \(text; write 1 without quotes\)"),
        ({"inner": {"span": [3, 2]}}, "inner.span: the lowest value 3 is above the highest 2"),
        ({"inner": {"span": [3, 2, 1]}}, r"inner.span: expected \[lowest, highest\] or one number"),
        ({"inner": {"span": [3]}}, r"inner.span: expected \[lowest, highest\] or one number"),
        ({"inner": {"span": "4"}}, r"inner.span: .* got '4' \(text; write 4 without quotes\)"),
        ({"inner": {"span": [3, 20]}}, "inner.span: 20 is out of range; give 0 to 10"),
        ({"inner": {"span": 20}}, "inner.span: 20 is out of range; give 0 to 10"),
        ({"angle": [170, -170]}, "angle: the lowest value 170 .* the highest -170; swap them$"),
        ({"angle": [180, 10]}, r"angle: .* swap them, or write \[-180, 10\]"),
        ({"ends": [4, 2.5]}, "ends: expected a whole number, got 2.5"),
        ({"ends": [4, 2]}, "ends: the lowest value 4 is above the highest 2"),
        ({"inner": 4}, "inner: expected a mapping of fields, got 4"),
        ({"inner": None}, "inner: .*, got None; remove the key, or write {}"),
        ({"many": []}, r"many: expected a mapping of names, got \[\]"),
        ({"many": {"z": {"size": 9}}}, "many.z.size: 9 is out of range"),
        ({"pair": [1]}, "pair: expected 2 values, got 1"),
        ({"pair": [1, 1, 1]}, "pair: expected at most 2 values, got 3"),
        ({"pair": [0, 2]}, r"pair\[1\]: 2 is out of range"),
        ({"maybe": "y"}, "maybe: expected a number, got 'y'$"),
        ({"word": "X"}, "word: 'X' is not in small letters; write it as 'abc'"),
        ({"word": 3}, "word: expected text, got 3; put it in quotes"),
        ({"pick": ["lefd"]}, r"pick\[0\]: 'lefd' is unknown \(did you mean left\?\)"),
        ({"pick": "left"}, r"pick: expected a list, got 'left'; write \['left'\]"),
        ({"pick": []}, r"pick: \[\] is empty; give at least one"),
    ],
)
def test_errors_name_the_field_and_what_to_do(data, message):
    with pytest.raises(ConfigError, match=f"^{message}"):
        from_plain(Outer, {"name": "x"} | data)


def test_missing_fields_are_listed():
    with pytest.raises(ConfigError, match=r"^Outer: missing name$"):
        from_plain(Outer, {})
    with pytest.raises(ConfigError, match=r"nmae: unknown key \(did you mean name\?\)"):
        from_plain(Outer, {"nmae": "x"})


def test_checking_an_instance_converts_nothing():
    check_fields(Outer("x", again=Inner()), Outer, "it")
    for value, message in (
        (Outer("x", pair=[0.0, 1.0]), r"it\.pair: expected a tuple, got \[0\.0, 1\.0\]"),
        (Outer("x", inner={"size": 1.0}), r"it\.inner: expected a Inner, got {'size': 1\.0}"),
        (Outer("x", count=4.0), r"it\.count: expected a whole number, got 4\.0"),
        (Outer("x", inner=Inner(9.0)), r"it\.inner\.size: 9\.0 is out of range"),
        (Inner(), r"it: expected a Outer, got Inner"),
    ):
        with pytest.raises(ConfigError, match=f"^{message}"):
            check_fields(value, Outer, "it")


def test_pydantic_is_imported_by_the_first_validation():
    code = "import sys, fastgen.config.config; sys.exit('pydantic' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
