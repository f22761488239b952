"""Single values of a configuration as text, as in damage.probability=0.8."""

from collections.abc import Iterable
from typing import Any

import yaml

from fastgen.config.config import Config
from fastgen.config.yaml_values import loaded
from fastgen.errors import ConfigError, shown


def assigned(config: Config, texts: Iterable[str]) -> Config:
    """Return a configuration with single values changed.

    Unlike a file, which replaces a table of names as a whole, this keeps the other names: after
    `cameras.A.focal_mm=20` the rig still has its other cameras.

    Args:
        config: The configuration to start from.
        texts: Keys with their values, KEY=VALUE. A key has dots between its parts and the value is
            YAML. Later texts win. Names with a dot cannot be part of a key; give the table around
            them as the value.

    Raises:
        ConfigError: A value is missing, is not YAML, or does not fit its key.
    """
    texts = list(texts)
    if not texts:
        return config
    plain = config.to_plain()
    for text in texts:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise ConfigError(f"--set {shown(text)}: give a key and its value, as in KEY=VALUE")
        try:
            _assign(plain, key.split("."), loaded(value))
        except yaml.YAMLError as error:
            raise ConfigError(f"--set {key}: the value is not YAML ({error})") from None
    try:
        return Config.from_values(plain, config)
    except ConfigError as error:
        raise ConfigError(f"--set: {error}") from None


def _assign(plain: dict[str, Any], steps: list[str], value: Any) -> None:
    """Set a value of nested mappings. Mappings replace other values on the way to it."""
    *tables, name = steps
    for step in tables:
        inner = plain.get(step)
        plain[step] = plain = dict(inner) if isinstance(inner, dict) else {}
    plain[name] = value
