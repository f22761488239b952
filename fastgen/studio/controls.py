"""Controls of the page, derived from the JSON Schema of configuration files."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import yaml

from fastgen.config.config import Config
from fastgen.config.schema import json_schema
from fastgen.config.yaml_values import Dumper
from fastgen.validation import to_plain

MOST_USED = (
    "surface.rust_coverage",
    "surface.dirt_strength",
    "surface.ageing_strength",
    "damage.probability",
    "damage.count",
    "environment.names",
    "environment.yaw_deg",
    "markings.marked_containers",
    "sensor.noise.probability",
    "weather.fog_probability",
    "weather.rain_probability",
)
"""Keys that the page shows before all others."""

_WIDE = 400
"""Width of a range of values above which a slider covers only the part around the usual values."""

_STEPS = 200
"""Fewest steps of a slider for numbers that need not be whole."""

_UNIT = re.compile(r"\s*Unit: (.+)\.$")

Schema = Mapping[str, Any]


def controls(config: Config) -> list[dict[str, Any]]:
    """Return one control for each key of a configuration, in the order of the keys.

    Args:
        config: Configuration whose values the controls show first.

    Returns:
        Records with these fields: `key`, such as "surface.rust_coverage"; `kind`, one of "number",
        "range", "choice", "choices", "weights", "color", "colors", "hdri" and "yaml"; `value` in
        plain JSON, and as YAML text for "yaml"; `help` and `unit`. Numbers also have `min`, `max`,
        `whole` and `slider`, the lowest value, highest value and step of a slider. "choice",
        "choices" and "weights" have `choices`.
    """
    schema = json_schema()
    return list(_below(schema, config, (), schema["$defs"]))


def _below(
    schema: Schema, value: Any, path: tuple[str, ...], models: Mapping[str, Schema]
) -> Iterator[dict[str, Any]]:
    """Yield the controls of a value and of all values inside it."""
    if "$ref" in schema:
        schema = {**models[schema["$ref"].rpartition("/")[2]], **schema}
    if is_dataclass(value) and "properties" in schema:
        for name in (each.name for each in fields(value)):  # files have shorthands as well
            part = schema["properties"][name]
            yield from _below(part, getattr(value, name), (*path, name), models)
    elif "patternProperties" in schema:
        (part,) = schema["patternProperties"].values()
        for name, each in value.items():
            yield from _below(part, each, (*path, name), models)
    else:
        words = schema.get("description", "")
        unit = _UNIT.search(words)
        yield {
            "key": ".".join(path),
            "help": _UNIT.sub("", words),
            "unit": unit[1] if unit else "",
            **_kind(".".join(path), schema, to_plain(value)),
        }


def _kind(key: str, schema: Schema, value: Any) -> dict[str, Any]:
    """Return the fields of a control that depend on the type of its value."""
    if key == "environment.names":
        return {"kind": "hdri", "value": value}
    if "oneOf" in schema and schema["oneOf"][0].get("type") in ("number", "integer"):
        pair = value if isinstance(value, list) else [value, value]
        return {"kind": "range", "value": pair, **_limits(schema["oneOf"][0], pair)}
    if "enum" in schema:
        return {"kind": "choice", "value": value, "choices": schema["enum"]}
    match schema.get("type"):
        case "number" | "integer":
            return {"kind": "number", "value": value, **_limits(schema, [value])}
        case "string" if _is_color(schema):
            return {"kind": "color", "value": value}
        case "array" if _is_color(schema.get("items", {})):
            return {"kind": "colors", "value": value}
        case "array" if "enum" in schema.get("items", {}):
            return {"kind": "choices", "value": value, "choices": schema["items"]["enum"]}
        case "object" if _is_weights(schema):
            names = schema["propertyNames"]["enum"]
            return {"kind": "weights", "value": value, "choices": names, "max": _most(schema)}
    text = yaml.dump(value, Dumper=Dumper, default_flow_style=True, sort_keys=False, width=math.inf)
    return {"kind": "yaml", "value": text.removesuffix("...\n").strip()}


def _is_color(schema: Schema) -> bool:
    return "[0-9a-fA-F]{6}" in schema.get("pattern", "")


def _is_weights(schema: Schema) -> bool:
    each = schema.get("additionalProperties", {})
    return each.get("type") == "number" and "enum" in schema.get("propertyNames", {})


def _most(schema: Schema) -> float:
    return float(schema["additionalProperties"]["maximum"])


def _limits(schema: Schema, values: list[float]) -> dict[str, Any]:
    low, high, is_whole = schema["minimum"], schema["maximum"], schema["type"] == "integer"
    return {
        "min": low,
        "max": high,
        "whole": is_whole,
        "slider": [*_span(low, high, values), _step(*_span(low, high, values), is_whole)],
    }


def _span(low: float, high: float, values: list[float]) -> tuple[float, float]:
    """Return the part of the valid values that a slider covers.

    A slider covers all values that span at most _WIDE. It ends at four times the usual values in
    wider ranges.
    """
    if high - low <= _WIDE:
        return low, high
    reach = 4 * max(map(abs, values)) or _WIDE
    return max(low, -reach if min(values) < 0 else 0), min(high, reach)


def _step(low: float, high: float, is_whole: bool) -> float:
    """Return the step of a slider: 1 for whole numbers, else a power of ten."""
    if is_whole:
        return 1
    return float(10 ** math.floor(math.log10((high - low) / _STEPS)))
