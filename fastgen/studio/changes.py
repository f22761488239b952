"""Changed values as a configuration, as a configuration file, and as the command that uses it."""

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import yaml

from fastgen.config.config import Config
from fastgen.config.presets import preset_names
from fastgen.config.yaml_values import Dumper, loaded
from fastgen.errors import ConfigError, shown
from fastgen.render.settings import RenderSettings
from fastgen.validation import Range, to_plain

CONFIG_FILE = "studio.yaml"
"""File name that the command expects the changed values in."""

_IMAGES = 1000
"""Number of images in the command."""


@dataclass(frozen=True)
class Base:
    """Configuration that changes start from.

    Attributes:
        preset: Name of the preset.
        config: Its configuration, with the values of the user's file and options if there are any.
    """

    preset: str
    config: Config


def bases(preset: str, config: Config, name: str) -> dict[str, Base]:
    """Return all configurations that the page offers by name, the one to begin with first.

    Args:
        preset: Preset that `config` starts from.
        config: Configuration to begin with.
        name: Its name on the page, unless it is that of the preset.

    Raises:
        ConfigError: The preset is unknown.
    """
    own = {} if config == Config.preset(preset) else {name: Base(preset, config)}
    names = sorted(preset_names(), key=lambda each: each != preset)
    return own | {each: Base(each, Config.preset(each)) for each in names}


def values_of(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that the page sends as YAML text, such as {"damage.count": "[1, 2]"}.

    Raises:
        ConfigError: A value is not YAML text. The message begins with the key.
    """
    return {key: _value(key, text) for key, text in changes.items()}


def _value(key: str, text: Any) -> Any:
    if not isinstance(text, str):
        raise ConfigError(f"{key}: expected YAML text, got {shown(text)}")
    try:
        return loaded(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"{key}: not YAML ({error})") from None


def difference(new: Any, old: Any) -> dict[str, Any]:
    """Return the plain values that turn one dataclass instance into another.

    Args:
        new: A Config, or a part of one.
        old: What it starts from, of the same class.

    Returns:
        The values that differ, as Config.from_values takes them.
    """
    found: dict[str, Any] = {}
    for field in fields(new):
        ours, theirs = getattr(new, field.name), getattr(old, field.name)
        if repr(ours) == repr(theirs):  # unlike ==, this also compares the order of mappings
            continue
        if is_dataclass(ours) and type(ours) is type(theirs):
            found[field.name] = difference(ours, theirs)
        elif isinstance(ours, Mapping) and all(map(is_dataclass, ours.values())):
            # all names are listed, because the mapping is replaced as a whole
            found[field.name] = {
                name: difference(each, theirs[name]) if name in theirs else to_plain(each)
                for name, each in ours.items()
            }
        elif isinstance(ours, Range) and ours.lo == ours.hi:
            found[field.name] = ours.lo  # one number stands for both
        else:
            found[field.name] = to_plain(ours)
    return found


def as_file(config: Config, preset: str) -> str:
    """Return a configuration file, as YAML text, that turns a preset into a configuration.

    Returns:
        The text; "" if the configuration is that of the preset.
    """
    values = difference(config, Config.preset(preset))
    if not values:
        return ""
    text: str = yaml.dump(
        values, Dumper=Dumper, default_flow_style=None, sort_keys=False, width=math.inf
    )
    return text


def command(preset: str, has_file: bool, seed: int, settings: RenderSettings) -> str:
    """Return the command that makes a data set of a configuration.

    Args:
        preset: Preset that the configuration starts from.
        has_file: Whether changed values are in CONFIG_FILE.
        seed: Seed of the data set.
        settings: Size, quality, backend, device and HDRI folder.
    """
    words = ["fastgen", "generate", "OUT", "--images", str(_IMAGES), "--seed", str(seed)]
    words += ["--preset", preset, *(["--config", CONFIG_FILE] if has_file else [])]
    words += ["--size", "x".join(map(str, settings.size)), "--quality", settings.quality]
    if settings.hdri_dir is not None:
        words += ["--hdri", str(settings.hdri_dir)]
    return shlex.join(words)
