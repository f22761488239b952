"""Entry point of the `fastgen` command: its parser, exit codes and the handling of signals."""

import argparse
import signal
import traceback
from collections.abc import Sequence
from typing import Any, NoReturn

import fastgen
from fastgen.cli.completion import add_completion
from fastgen.cli.config_command import add_config_command, add_presets
from fastgen.cli.dataset_commands import (
    add_generate,
    add_merge,
    add_report,
    add_stats,
    add_verify,
)
from fastgen.cli.fit_command import add_fit
from fastgen.cli.options import log_level, sentence
from fastgen.cli.scene_commands import add_export, add_show
from fastgen.cli.stopping import STOPPED, Terminated, interrupted_by_sigterm
from fastgen.cli.studio_command import add_studio
from fastgen.dataset.console import drop_unprinted, mend_streams, printed_log, say, tell
from fastgen.errors import FastgenError, one_line
from fastgen.render import doctor

_BUG = 70


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns:
        The exit code: 0 for success, 1 if faults were found, 2 for bad input or an unsuitable
        machine, 130 after Ctrl-C, 143 after SIGTERM. A bug of fastgen gives 70, which is
        EX_SOFTWARE of sysexits.h.
    """
    mend_streams()
    try:
        return _run(arguments)
    finally:
        drop_unprinted()


def _run(arguments: Sequence[str] | None) -> int:
    options = argparse.Namespace()
    try:
        try:
            options = _parser().parse_args(arguments)
            with printed_log(log_level(options)), interrupted_by_sigterm():
                code: int = options.run(options)
        finally:
            tell("", end="")  # flushes what argparse has printed
    except FastgenError as error:
        return _refused(str(error))
    except BrokenPipeError:
        return 128 + signal.SIGPIPE  # the reader of our output, such as head, has exited
    except OSError as error:
        return _refused(f"{error.filename or 'system'}: {error.strerror or error}")
    except MemoryError:
        return _refused("out of memory; use fewer workers or a smaller size")
    except KeyboardInterrupt as stop:
        say(f"{STOPPED}; run the same command again to go on" if _resumes(options) else STOPPED)
        return 128 + (signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT)
    except Exception as error:
        say("".join(traceback.format_exception(error)).rstrip())
        say(one_line(f"fastgen: {error!r} (this is a bug in fastgen: please report it)"))
        return _BUG
    return code


def _resumes(options: argparse.Namespace) -> bool:
    """Return whether the command, if run again, continues the work of a run that was stopped."""
    return getattr(options, "resumes", False) or getattr(options, "repair", False)


def _refused(words: str) -> int:
    say(one_line(f"fastgen: {words}"))
    return 2


class _Parser(argparse.ArgumentParser):
    """Parser that reports an error in one line, as every other error."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, one_line(f"fastgen: {message}; see {self.prog} --help") + "\n")

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        # argparse removes `--`, also from `--seed=--`, and passes [] on as the value
        if action.option_strings and arg_strings == ["--"]:
            raise argparse.ArgumentError(action, "'--' is not a value; give one")
        return super()._get_values(action, arg_strings)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="fastgen",
        description="Render exactly labelled synthetic images of shipping containers.",
        epilog="`fastgen COMMAND --help` describes a command.",
    )
    parser.add_argument("--version", action="version", version=f"fastgen {fastgen.__version__}")
    commands = parser.add_subparsers(required=True, title="commands", metavar="COMMAND")
    adders = (
        *(add_generate, add_config_command, add_presets, add_fit, add_studio, add_show),
        *(add_export, add_stats, add_report, add_verify, add_merge),
    )
    for add in adders:
        add(commands)
    add_completion(commands, _parser)
    words = "test the OpenGL backends and devices of this machine"
    command = commands.add_parser("doctor", help=words, description=sentence(words))
    command.set_defaults(run=_doctor)
    return parser


def _doctor(_: argparse.Namespace) -> int:
    words, works = doctor.report()
    tell(words)
    return 0 if works else 1
