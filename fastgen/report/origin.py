"""Settings that a dataset was made with, and how its configuration differs from a preset."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.errors import shown_name

_MISSING = object()

_MOST_ROWS = 200
_LONGEST_VALUE = 200


def origins(manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what made a dataset, or each of the datasets that it was merged from.

    Args:
        manifest: Content of dataset.json.

    Returns:
        For each: `facts`, pairs of name and value; `preset`, the nearest preset; `rows`, the key of
        each value that differs from it, with the preset's value and the dataset's.
    """
    return [_origin({**manifest, **each}) for each in manifest.get("merged_from", [{}]) or [{}]]


def _origin(made: Mapping[str, Any]) -> dict[str, Any]:
    environments = made.get("environments", {})
    facts = {
        "fastgen": made["version"],
        "driver": f"{made['renderer']} ({made['backend']})",
        "layout": made["format"],
        "label formats": ", ".join(made["formats"]) or "none",
        "seed": made.get("seed"),
        "image size": "x".join(map(str, made.get("size", ()))),
        "quality": made.get("quality"),
        "cameras": ", ".join(made.get("cameras", ())),
        f"HDRIs ({len(environments)})": ", ".join(environments),
    }
    preset, rows = nearest_preset(made.get("config", {}))
    return {
        "facts": [[name, _words(value)] for name, value in facts.items()],
        "preset": preset,
        "rows": [[key, _words(old), _words(new)] for key, old, new in rows[:_MOST_ROWS]],
        "more": max(len(rows) - _MOST_ROWS, 0),
    }


def nearest_preset(config: Mapping[str, Any]) -> tuple[str, list[tuple[str, Any, Any]]]:
    """Return the preset with the fewest differences to a configuration, and these differences.

    Args:
        config: Plain values of a configuration, as in dataset.json.

    Returns:
        Name of the preset; and the key, the preset's value and the configuration's value of each
        difference. A missing value is "not set".
    """
    found = {}
    for name in PRESETS:
        preset = json.loads(json.dumps(Config.preset(name).to_plain()))
        found[name] = list(_differences("", preset, config))
    name = min(found, key=lambda each: len(found[each]))
    return name, found[name]


def _differences(key: str, old: Any, new: Any) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for name in dict.fromkeys((*old, *new)):
            inner = f"{key}.{shown_name(name)}" if key else shown_name(name)
            yield from _differences(inner, old.get(name, _MISSING), new.get(name, _MISSING))
    elif old != new:
        before, after = ("not set" if value is _MISSING else value for value in (old, new))
        yield key, before, after


def _words(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]} ..."
