"""Messages of `fastgen.validation`: they name the field of a pydantic error and what to give."""

import dataclasses
import math
import numbers
import types
import typing
from collections.abc import Mapping
from typing import Any

from fastgen.errors import ConfigError, did_you_mean, nearest, shown, shown_name

if typing.TYPE_CHECKING:
    from pydantic_core import ErrorDetails

PAIR = "[lowest, highest]"
NUMBER = "[number]"
"""Tags in the location of pydantic's errors, for the two ways to write a range."""


def is_number(value: Any) -> bool:
    """Return whether `value` is a real number of any numeric type; False for booleans."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def in_words(cls: type, errors: "list[ErrorDetails]", root: str, base: Any) -> ConfigError:
    """Return the first of pydantic's errors as a ConfigError.

    Unknown keys come first, because a misspelt key also leaves a field missing.

    Args:
        cls: The dataclass that was validated.
        errors: Errors of pydantic, at least one.
        root: Path of the value, '' at the top.
        base: Values that the given ones change, or None; its names are suggested.
    """
    error = min(errors, key=lambda each: each["type"] != "unexpected_keyword_argument")
    kind, loc, value, context = error["type"], error["loc"], error["input"], error.get("ctx", {})
    if kind == "missing":
        loc = loc[:-1]
        missing = [e["loc"][-1] for e in errors if e["type"] == kind and e["loc"][:-1] == loc]
    if kind == "invalid_key":
        loc = (*loc, "[key]")
    is_key = loc[-1:] == ("[key]",)
    path = _path(root, loc[:-2] if is_key else loc)
    got = f"got {shown(value)}"
    match kind:
        case "value_error":  # from __post_init__; its message begins with the field
            return ConfigError(f"{path}.{context['error']}" if path else str(context["error"]))
        case "words":
            words = context["words"]
        case "unexpected_keyword_argument":
            words = f"unknown key{nearest(loc[-1], _fields_at(cls, loc[:-1]))}"
        case "tuple_type" | "too_long" | "missing" if loc[-1:] == (PAIR,):
            words = f"expected {PAIR} or one number, {got}{_unquoted(value)}"
        case "missing" if isinstance(missing[0], int):
            words = f"expected {int(missing[-1]) + 1} values, got {missing[0]}"
        case "missing":
            hint = did_you_mean(loc[-1], _names_beside(base, loc)) if loc else ""
            words = f"missing {', '.join(map(str, missing))}{hint}"
        case "too_long":
            words = f"expected at most {context['max_length']} values, got {len(value)}"
        case "too_short":
            words = f"{shown(value)} is empty; give at least one"
        case "tuple_type":
            instead = f"; write [{shown(value)}]" if isinstance(value, str) else ""
            words = f"expected a {'tuple' if isinstance(value, list) else 'list'}, {got}{instead}"
        case "dict_type":
            words = f"expected a mapping of names, {got}"
        case "dataclass_type":
            instead = "; remove the key, or write {}" if value is None and path else ""
            words = f"expected a mapping of fields, {got}{instead}"
        case "dataclass_exact_type":
            words = f"expected a {context['class_name']}, {got}"
        case "bool_type":
            words = f"expected true or false, {got}"
        case "number" if not is_number(value):
            words = f"expected a number, {got}{_unquoted(value)}"
        case "number" if not context["bounds"].lo <= value <= context["bounds"].hi:
            words = f"{shown(value)} is out of range; give {context['bounds'].words}"
        case "number":
            words = f"expected a whole number, {got}"
        case "choice":
            words = f"{shown(value)} is unknown{nearest(value, context['choices'])}"
        case "text" if isinstance(value, str):
            words = f"{shown(value)} {context['otherwise']}"
        case _ if is_key:
            words = f"expected a name, {got}; put it in quotes"
        case "text" | "string_type":
            words = f"expected text, {got}{_quoted(value)}"
        case _:
            words = f"{error['msg']}, {got}"
    return ConfigError(f"{path or cls.__name__}: {words}")


def _path(root: str, loc: tuple[int | str, ...]) -> str:
    """Return a location as users write it, for example 'cameras.A.lens.k1'."""
    path = root
    for step in loc:
        if step in (PAIR, NUMBER):
            break
        name = f"[{step}]" if isinstance(step, int) else shown_name(step)
        path += f".{name}" if path and isinstance(step, str) else name
    return path


def _names_beside(base: Any, loc: tuple[int | str, ...]) -> list[str]:
    """Return the names in the table of `base` that holds a location; [] if no table holds it."""
    for step in loc[:-1]:
        base = vars(base).get(str(step)) if dataclasses.is_dataclass(base) else None
    return list(base) if isinstance(base, Mapping) else []


def _fields_at(cls: type, loc: tuple[int | str, ...]) -> list[str]:
    """Return the field names of the dataclass at a location below `cls`."""
    hint: Any = cls
    for step in (*loc, None):
        if isinstance(hint, types.UnionType):
            hint = typing.get_args(hint)[0]
        if step is None:
            break
        if dataclasses.is_dataclass(hint):
            hint = typing.get_type_hints(hint)[str(step)]
        else:
            hint = typing.get_args(hint)[0 if isinstance(step, int) else 1]
    return [field.name for field in dataclasses.fields(hint)]


def _quoted(value: Any) -> str:
    """Return a hint for text that YAML read as another type."""
    if value is None:
        return "; if it began with #, quote it, because # begins a comment in YAML"
    return "; put it in quotes" if is_number(value) else ""


def _unquoted(value: Any) -> str:
    """Return a hint for a number that was given as text."""
    try:
        number = float(value) if isinstance(value, str) else math.nan
    except ValueError:
        return ""
    return f" (text; write {number:g} without quotes)" if math.isfinite(number) else ""
