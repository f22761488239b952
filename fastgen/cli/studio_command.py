"""`fastgen studio`: a local page that shows what each value of a configuration does."""

import argparse
from typing import Any

from fastgen.cli.options import add_config, add_render, add_seed, config_of, render_settings
from fastgen.config.presets import DEFAULT_PRESET
from fastgen.dataset.console import tell
from fastgen.errors import ConfigError


def add_studio(commands: Any) -> None:
    """Add `fastgen studio`."""
    command = commands.add_parser(
        "studio",
        help="explore a configuration on a local page, with sliders and a live picture",
        description="Serve a page on this machine alone that shows images while you change the "
        "configuration, with their labels as layers. It shows the changed values as YAML, and the "
        "command that makes a data set of them. Ctrl-C ends it.",
    )
    add_seed(command)
    command.add_argument(
        "--port", type=int, default=0, metavar="N", help="port of the page; default: a free one"
    )
    command.add_argument(
        "--no-browser",
        dest="browser",
        action="store_false",
        help="print the address of the page without opening it",
    )
    add_config(command)
    add_render(command)
    command.set_defaults(run=_studio)


def _name(options: argparse.Namespace) -> str:
    """Return the name on the page for the configuration that files and --set describe."""
    return ", ".join([*map(str, options.config), *options.assignments])


def _studio(options: argparse.Namespace) -> int:
    try:
        from fastgen.studio import server  # here because it needs packages of an extra
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("starlette", "uvicorn"):
            raise
        raise ConfigError(
            "studio needs Starlette and uvicorn; run pip install 'fastgen[studio]'"
        ) from None
    from fastgen.studio.changes import bases

    server.run(
        render_settings(options),
        bases(options.preset or DEFAULT_PRESET, config_of(options), _name(options)),
        options.seed,
        options.port,
        lambda address: tell(f"Open {address} in a browser on this machine. Ctrl-C ends it."),
        options.browser,
    )
    return 0
