"""`fastgen completion`: scripts by which shells complete commands, options and their values."""

import argparse
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from fastgen.cli.options import output_file
from fastgen.dataset.console import tell
from fastgen.errors import ConfigError
from fastgen.validation import check_known

SHELLS = ("bash", "zsh", "tcsh")

_WORDS = re.compile("[A-Za-z_]+(?:[|][A-Za-z_]+)+")

_HELP = """\
Print a script by which a shell completes commands, options and their values. It needs
fastgen[completion].

For bash:  fastgen completion bash > ~/.local/share/bash-completion/completions/fastgen
For zsh:   fastgen completion zsh > a file called _fastgen in a folder of $fpath"""


def add_completion(commands: Any, make_parser: Callable[[], argparse.ArgumentParser]) -> None:
    """Add `fastgen completion`.

    Args:
        commands: The subparsers of the command.
        make_parser: Returns a parser of the whole command.
    """
    command = commands.add_parser(
        "completion",
        help="print a script by which your shell completes this command",
        description=_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("shell", metavar="|".join(SHELLS), help="your shell")
    command.set_defaults(run=lambda options: _print(options.shell, make_parser()))


def _print(shell: str, parser: argparse.ArgumentParser) -> int:
    check_known("shell", shell, SHELLS)
    try:
        import shtab
    except ImportError:
        raise ConfigError("completion: needs shtab: pip install 'fastgen[completion]'") from None
    for action in _actions(parser):
        if action.type in (Path, output_file) or action.dest in ("out", "hdri"):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif isinstance(action.metavar, str) and _WORDS.fullmatch(action.metavar):
            # messages about wrong values are better without `choices`, so the parser has none
            action.choices = action.metavar.split("|")
    tell(shtab.complete(parser, shell))
    return 0


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the arguments of a parser and of its commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
        else:
            yield action
