"""`fastgen config`: print a configuration, or the JSON Schema of configuration files."""

import argparse
import json
from typing import Any

from fastgen.cli.options import add_config, add_hdri, config_of
from fastgen.config.commented_yaml import as_yaml
from fastgen.dataset.console import tell
from fastgen.errors import ConfigError
from fastgen.generator import Generator


def add_config_command(commands: Any) -> None:
    """Add `fastgen config`."""
    command = commands.add_parser(
        "config",
        help="check a configuration and print it with every key explained",
        description="Check a configuration and print it as YAML with every key explained. Save "
        "the output, change values, and pass the file to other commands with --config.",
    )
    add_config(command)
    add_hdri(command)
    command.add_argument(
        "--schema",
        action="store_true",
        help="print the JSON Schema of configuration files instead; editors use it to complete "
        "and check keys",
    )
    command.set_defaults(run=_config)


def _config(options: argparse.Namespace) -> int:
    if options.schema:
        from fastgen.config.schema import json_schema  # imports pydantic

        tell(json.dumps(json_schema(), indent=2))
        return 0
    config = config_of(options)
    try:  # sampling checks more than the reader of the file: lenses, names of HDRIs
        Generator(config, hdri_dir=options.hdri).scene(0)
    except ConfigError as error:
        raise ConfigError(f"{options.config}: {error}" if options.config else str(error)) from None
    tell(as_yaml(config), end="")
    return 0
