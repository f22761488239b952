"""Frozen dataclasses to and from plain JSON/YAML values, with errors that name the field.

One small engine serves both the configuration (bounds and ranges are checked) and the scenes
(exact round trip). A field may carry `metadata=bounds(lo, hi)`; every number below it is held to
these bounds, and a `Range` must also be ordered.
"""

import dataclasses
import difflib
import functools
import math
import numbers
import reprlib
import sys
import types
import typing
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from fastgen.errors import ConfigError

T = TypeVar("T")

_short = reprlib.repr


class Range(NamedTuple):
    """A closed interval that a value is drawn from, uniformly unless said otherwise."""

    lo: float
    hi: float

    def draw(self, rng: np.random.Generator) -> float:
        """A value of it, each as likely as any other."""
        return float(rng.uniform(self.lo, self.hi))


def bounds(lo: float = -math.inf, hi: float = math.inf, unit: str = "") -> dict[str, Any]:
    """Field metadata: the closed interval that all numbers of the field lie in, and their unit."""
    return {"lo": lo, "hi": hi, "unit": unit}


UNIT = bounds(0.0, 1.0)
"""Bounds of shares, probabilities and colours."""

LENGTH = bounds(0.0, 20000.0, "mm")
"""Bounds of what is measured on a container, with room to spare."""


def nearest(word: Any, choices: typing.Iterable[str]) -> str:
    """A hint ' (did you mean X?)' for a mistyped word, or the list of choices. Returns text."""
    names = sorted(choices)
    alike = [name for name in names if name.casefold() == str(word).casefold()]
    close = alike or difflib.get_close_matches(str(word), names, n=1, cutoff=0.6)
    if close:
        return f" (did you mean {close[0]}?)"
    return f" (choose from {', '.join(names)})"


def check_known(name: str, value: Any, choices: Collection[str]) -> None:
    """Raise ConfigError that calls it `name` where `value` is none of `choices`."""
    if not isinstance(value, str) or value not in choices:
        raise ConfigError(f"{name}: {value!r} is unknown{nearest(value, choices)}")


def check_order(name: str, pair: tuple[float, float]) -> None:
    """Raise ConfigError that calls it `name` where a lowest value is above its highest."""
    lo, hi = pair
    if lo > hi:
        raise ConfigError(f"{name}: the lowest value {lo:g} is above the highest {hi:g}; swap them")


def check_distinct(name: str, values: Collection[str], hint: str) -> None:
    """Raise ConfigError that calls them `name` where one stands twice; hint: what to do instead."""
    if len(set(values)) < len(values):
        raise ConfigError(f"{name}: one stands twice; {hint}")


def whole(name: str, value: Any, least: int = 0, most: int = 2**63 - 1) -> int:
    """`value` if it is a whole number within these limits, of whatever type.

    Raises ConfigError that calls it `name` if not.
    """
    is_number = _is_number(value)
    if is_number and least <= value <= most and value == int(value):
        return int(value)
    too_large = is_number and value > most
    wanted = f"{least} to {most}" if too_large or most < 2**63 - 1 else f"{least} or more"
    raise ConfigError(f"{name}: {_short(value)} is not a whole number of {wanted}")


def _is_number(value: Any) -> bool:
    """Also NumPy's; but True and False are none."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def to_plain(value: Any) -> Any:
    """Turn dataclasses, tuples and mappings into the dicts, lists and scalars of JSON and YAML."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_plain(item) for item in value]
    return value


def from_plain(cls: type[T], data: Any, path: str = "", base: T | None = None) -> T:
    """Build dataclass `cls` from plain values.

    data: mapping of field names; missing fields are taken from `base`, else from the defaults.
    path: what stands before the field names in error messages, for example 'cameras.A'.
    Raises ConfigError naming the field, the value and what would be right.
    """
    if not isinstance(data, Mapping):
        instead = "; remove the key, or write {}" if data is None and path else ""
        raise ConfigError(
            f"{path or cls.__name__}: expected a mapping of fields, got {_short(data)}{instead}"
        )
    hints = typing.get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(typing.cast(Any, cls))}
    values: dict[str, Any] = {}
    for key, item in data.items():
        where = f"{path}.{key}" if path else str(key)
        if key not in fields:
            raise ConfigError(f"{where}: unknown key{nearest(str(key), fields)}")
        old = getattr(base, key) if base is not None else None
        values[key] = _convert(hints[key], item, where, fields[key].metadata, old)
    if base is not None:
        return _made(lambda: dataclasses.replace(typing.cast(Any, base), **values), path)
    missing = [
        name
        for name, field in fields.items()
        if name not in values
        and field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
    ]
    if missing:
        raise ConfigError(f"{path or cls.__name__}: missing {', '.join(missing)}")
    return _made(lambda: cls(**values), path)


def _made(make: Callable[[], Any], path: str) -> Any:
    """What `make` gives; what its __post_init__ refuses, it names by its own fields alone."""
    try:
        return make()
    except ConfigError as error:
        raise ConfigError(f"{path}.{error}" if path else str(error)) from None


def _convert(hint: Any, value: Any, path: str, meta: Mapping[str, Any], old: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        choices = [arg for arg in typing.get_args(hint) if arg is not type(None)]
        return None if value is None else _convert(choices[0], value, path, meta, old)
    if dataclasses.is_dataclass(hint):
        return from_plain(typing.cast(type, hint), value, path, old)
    if hint is Range:
        return _range(value, path, meta)
    if origin is tuple:
        return _tuple(hint, value, path, meta)
    if origin in (dict, Mapping):
        return _mapping(hint, value, path, meta, old)
    return _scalar(hint, value, path, meta)


def _range(value: Any, path: str, meta: Mapping[str, Any]) -> Range:
    pair = _both(value)
    if not isinstance(pair, (list, tuple)) or len(pair) != 2:
        got = f"{_short(value)}{_as_number(value)}"
        raise ConfigError(f"{path}: expected [lowest, highest] or one number, got {got}")
    lo, hi = (_convert(float, item, path, meta, None) for item in pair)
    if lo > hi and meta.get("unit") == "degrees" and lo - 360 >= meta["lo"]:
        raise ConfigError(
            f"{path}: the lowest value {lo:g} is above the highest {hi:g}; swap them, or write "
            f"[{lo - 360:g}, {hi:g}]"
        )
    check_order(path, (lo, hi))
    return Range(lo, hi)


def _both(value: Any) -> Any:
    """One number stands for both of a pair."""
    return [value, value] if _is_number(value) else value


def _tuple(hint: Any, value: Any, path: str, meta: Mapping[str, Any]) -> tuple[Any, ...]:
    args = typing.get_args(hint)
    any_length = len(args) == 2 and args[1] is Ellipsis
    if args == (int, int):
        value = _both(value)
    if not isinstance(value, (list, tuple)):
        many = "" if any_length else f" of {len(args)} values"
        instead = f"; write [{value!r}]" if any_length and isinstance(value, str) else ""
        raise ConfigError(f"{path}: expected a list{many}, got {_short(value)}{instead}")
    if any_length:
        args = (args[0],) * len(value)
    if len(args) != len(value):
        raise ConfigError(f"{path}: expected {len(args)} values, got {len(value)}")
    return tuple(
        _convert(arg, item, f"{path}[{i}]", meta, None)
        for i, (arg, item) in enumerate(zip(args, value, strict=True))
    )


def _mapping(hint: Any, value: Any, path: str, meta: Mapping[str, Any], old: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"{path}: expected a mapping, got {_short(value)}")
    item_hint = typing.get_args(hint)[1]
    for key in value:
        if isinstance(key, bool) or not isinstance(key, (str, int, float)):  # YAML 1.1's no, off, ~
            raise ConfigError(f"{path}: expected a name, got {_short(key)}; put it in quotes")
    old = old or {}
    # what is given is the whole mapping; an item with a namesake inherits what it leaves out
    return {
        str(key): _convert(item_hint, item, f"{path}.{key}", meta, old.get(str(key)))
        for key, item in value.items()
    }


def _scalar(hint: Any, value: Any, path: str, meta: Mapping[str, Any]) -> Any:
    if hint is bool or hint is str:
        if not isinstance(value, hint):
            kind = "true or false" if hint is bool else "text"
            lost = _unquoted(value) if hint is str else ""
            raise ConfigError(f"{path}: expected {kind}, got {_short(value)}{lost}")
        return value
    if not _is_number(value):
        raise ConfigError(f"{path}: expected a number, got {_short(value)}{_as_number(value)}")
    lo, hi, wanted = _limits(meta)
    if not lo <= value <= hi:
        raise ConfigError(f"{path}: {_short(value)} is out of range; give {wanted}")
    if hint is int and value != int(value):
        raise ConfigError(f"{path}: expected a whole number, got {_short(value)}")
    return hint(value)


def _limits(meta: Mapping[str, Any]) -> tuple[float, float, str]:
    """Lowest and highest number that a field may hold, and the two in words."""
    lo, hi = meta.get("lo", -math.inf), meta.get("hi", math.inf)
    unit = f" {meta['unit']}" if meta.get("unit") else ""
    wanted = f"{lo:g} to {hi:g}{unit}" if math.isfinite(hi - lo) else "a finite number"
    # an int may be too large for a float, and infinity lies within bounds that have no end
    return max(lo, -sys.float_info.max), min(hi, sys.float_info.max), wanted


def check_fields(value: Any, cls: type, path: str, most: float = math.inf) -> None:
    """Hold an instance of dataclass `cls` that Python code made to its annotations and bounds.

    Everything below it is looked at: types, lengths of tuples, finite numbers. most: how far from 0
    numbers without bounds may lie. Raises ConfigError that names the field below `path`.
    """
    try:
        _check_of(cls, most)(value)
    except ConfigError as error:
        raise ConfigError(f"{path}{error}") from None


_Check = Callable[[Any], None]
"""Raises ConfigError whose words begin with what stands behind the name of the value."""


@functools.cache
def _check_of(cls: type, most: float) -> _Check:
    hints = typing.get_type_hints(cls)
    parts = tuple(
        (f.name, _check(hints[f.name], {"lo": -most, "hi": most, **f.metadata}, most))
        for f in dataclasses.fields(typing.cast(Any, cls))
    )

    def check(value: Any) -> None:
        if not isinstance(value, cls):
            raise ConfigError(f": expected a {cls.__name__}, got {_short(value)}")
        for name, part in parts:
            try:
                part(getattr(value, name))
            except ConfigError as error:
                raise ConfigError(f".{name}{error}") from None

    return check


def _check(hint: Any, meta: Mapping[str, Any], most: float) -> _Check:
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        inner = _check(args[0], meta, most)
        return lambda value: None if value is None else inner(value)
    if dataclasses.is_dataclass(hint):
        return _check_of(typing.cast(type, hint), most)
    if origin is tuple:
        return _check_tuple(args, meta, most)
    if hint is bool or hint is str:
        return functools.partial(_check_kind, hint)
    kind = numbers.Integral if hint is int else numbers.Real
    lo, hi, wanted = _limits(meta)

    def check(value: Any) -> None:
        exact = type(value)
        if not (exact is hint or (isinstance(value, kind) and exact is not bool)):
            what = "whole number" if hint is int else "number"
            raise ConfigError(f": expected a {what}, got {_short(value)}")
        if not lo <= value <= hi:
            raise ConfigError(f": {_short(value)} is out of range; give {wanted}")

    return check


def _check_tuple(args: tuple[Any, ...], meta: Mapping[str, Any], most: float) -> _Check:
    any_length = args[-1] is Ellipsis
    parts = [_check(arg, meta, most) for arg in args if arg is not Ellipsis]

    def check(value: Any) -> None:
        if not isinstance(value, tuple):
            raise ConfigError(f": expected a tuple, got {_short(value)}")
        if not any_length and len(value) != len(parts):
            raise ConfigError(f": expected {len(parts)} values, got {len(value)}")
        for i, item in enumerate(value):
            try:
                parts[0 if any_length else i](item)
            except ConfigError as error:
                raise ConfigError(f"[{i}]{error}") from None

    return check


def _check_kind(kind: type, value: Any) -> None:
    if not isinstance(value, kind):
        what = "True or False" if kind is bool else "text"
        raise ConfigError(f": expected {what}, got {_short(value)}")


def _unquoted(value: Any) -> str:
    """A hint for text that YAML took for something else."""
    if value is None:
        return "; if it began with #, quote it: YAML takes that for a comment"
    return "; put it in quotes" if _is_number(value) else ""


def _as_number(value: Any) -> str:
    """A hint for text that reads as a number: YAML 1.1 takes 1e-2 for text, and quotes make it."""
    try:
        number = float(value) if isinstance(value, str) else math.nan
    except ValueError:
        return ""
    return f" (a text; write {number:g} without quotes)" if math.isfinite(number) else ""
