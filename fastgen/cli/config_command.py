"""`fastgen config` and `fastgen presets`: print a configuration, its schema, or all presets."""

import argparse
import json
from typing import Any

from fastgen.cli.options import add_config, add_hdri, add_size, config_of, sentence, size_of
from fastgen.config.commented_yaml import as_yaml
from fastgen.config.presets import preset_named, preset_names
from fastgen.dataset.console import tell
from fastgen.errors import ConfigError
from fastgen.generator import Generator


def add_config_command(commands: Any) -> None:
    """Add `fastgen config`."""
    command = commands.add_parser(
        "config",
        help="check a configuration and print it with every key explained",
        description="Check a configuration and print it as YAML with every key explained. Save "
        "the output, change values, and pass the file to other commands with --config. What "
        "`fastgen generate` refuses with the same --size and --hdri is refused here too.",
    )
    add_config(command)
    add_size(command)
    add_hdri(command)
    command.add_argument(
        "--schema",
        action="store_true",
        help="print the JSON Schema of configuration files instead; editors use it to complete "
        "and check keys",
    )
    command.set_defaults(run=_config)


def add_presets(commands: Any) -> None:
    """Add `fastgen presets`."""
    words = "list the presets of fastgen and of installed packages"
    command = commands.add_parser("presets", help=words, description=sentence(words))
    command.set_defaults(run=_presets)


def _presets(_: argparse.Namespace) -> int:
    names = preset_names()
    width = max(map(len, names))
    for name in names:
        try:
            about = preset_named(name).about
        except ConfigError as error:  # a broken package must not hide the other presets
            about = str(error)
        tell(f"{name:{width}}  {about}")
    return 0


def _config(options: argparse.Namespace) -> int:
    if options.schema:
        from fastgen.config.schema import json_schema  # imports pydantic

        tell(json.dumps(json_schema(), indent=2))
        return 0
    config = config_of(options)
    try:  # sampling checks more than the reader of the file: lenses, names of HDRIs
        Generator(config, size=size_of(options), hdri_dir=options.hdri).scene(0)
    except ConfigError as error:
        files = ", ".join(map(str, options.config))
        raise ConfigError(f"{files}: {error}" if files else str(error)) from None
    tell(as_yaml(config), end="")
    return 0
