"""Changes of single values of a configuration by key, as in damage.probability=0.8."""

from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from typing import Any

import yaml

from fastgen.config.config import Config
from fastgen.config.yaml_values import loaded
from fastgen.errors import ConfigError, shown
from fastgen.validation import to_plain


def assigned(config: Config, texts: Iterable[str]) -> Config:
    """Return a configuration changed by `--set` options, see `changed`.

    Args:
        config: The configuration to start from.
        texts: Keys with their values as YAML, KEY=VALUE. The last value of a key wins.

    Raises:
        ConfigError: A value is missing, is not YAML, or does not fit its key.
    """
    values: dict[str, Any] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise ConfigError(f"--set {shown(text)}: give a key and its value, as in KEY=VALUE")
        try:
            values[key] = loaded(value)
        except yaml.YAMLError as error:
            raise ConfigError(f"--set {key}: the value is not YAML ({error})") from None
    try:
        return changed(config, values) if values else config
    except ConfigError as error:
        raise ConfigError(f"--set: {error}") from None


def changed(config: Config, values: Mapping[str, Any]) -> Config:
    """Return a configuration with single values changed.

    Unlike a file, which replaces a table of names as a whole, this keeps the other names: after a
    change of `cameras.A.focal_mm` the rig still has its other cameras.

    Args:
        config: The configuration to start from.
        values: New plain values by key, such as {"surface.rust_coverage": [0.1, 0.2]}. A key has
            dots between its parts. Names with a dot cannot be part of a key; give the table around
            them as the value.

    Raises:
        ConfigError: A key is inside another one, or a value does not fit its key.
    """
    nested: dict[str, Any] = {}
    for key, value in values.items():
        steps = key.split(".")
        for end in range(1, len(steps)):
            outer = ".".join(steps[:end])
            if outer in values:
                raise ConfigError(f"{key}: {outer} is changed as a whole, too; change only one")
        _assign(nested, config, steps, value)
    return Config.from_values(nested, config)


def _assign(nested: dict[str, Any], base: Any, steps: list[str], value: Any) -> None:
    """Set a value of nested mappings. Tables of names on the way to it keep those of `base`."""
    *tables, name = steps
    for step in tables:
        fields = base if isinstance(base, Mapping) else vars(base) if is_dataclass(base) else {}
        base = fields.get(step)
        if not isinstance(nested.get(step), dict):
            nested[step] = _names(base) if isinstance(base, Mapping) else {}
        nested = nested[step]
    nested[name] = value


def _names(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain values that leave `table` as it is when they replace it."""
    return {name: {} if is_dataclass(value) else to_plain(value) for name, value in table.items()}
