"""Output to standard output and error that may be closed, full, or limited to ASCII."""

import contextlib
import io
import logging
import os
import sys
from collections.abc import Iterator
from typing import TextIO

from fastgen.errors import OutputError, one_line
from fastgen.redaction import without_secrets

LOGGER = logging.getLogger("fastgen")


class _Printer(logging.Handler):
    """Prints log records as lines on standard error, over a progress line if there is one."""

    def emit(self, record: logging.LogRecord) -> None:
        clear = "\r\x1b[K" if is_live(sys.stderr) else ""
        say(clear + one_line(f"fastgen: {record.getMessage()}"))


@contextlib.contextmanager
def printed_log(level: str) -> Iterator[None]:
    """Print what the package logs in the block.

    Args:
        level: Least level to print, a name of `logging` in lower case.
    """
    printer, before = _Printer(), LOGGER.level
    LOGGER.addHandler(printer)
    LOGGER.setLevel(level.upper())
    try:
        yield
    finally:
        LOGGER.setLevel(before)
        LOGGER.removeHandler(printer)


def shows_warnings() -> bool:
    """Return whether hints and progress are to be shown."""
    return LOGGER.isEnabledFor(logging.WARNING)


def is_live(stream: TextIO) -> bool:
    """Return whether a stream is a terminal that can overwrite a line."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def mend_streams() -> None:
    """Make both streams safe to print to.

    Text for a closed stream goes to /dev/null. Standard output escapes characters that its encoding
    lacks, as standard error does by default.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def drop_unprinted() -> None:
    """Discard text that cannot be written to its stream.

    Otherwise the interpreter tries again when it exits, and Python 3.13 replaces our exit code if
    that fails.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def tell(words: str, end: str = "\n") -> None:
    """Print to standard output, with passwords in addresses hidden, and flush it.

    Raises:
        OutputError: The stream cannot be written, for example because a disk is full.
        BrokenPipeError: The reader of a pipe has exited.
    """
    try:
        print(without_secrets(words), end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output: {error.strerror}") from None


def hint(words: str) -> None:
    """Print a line about the run to standard error, unless only errors are to be shown."""
    if shows_warnings():
        say(f"fastgen: {words}")


def say(words: str) -> None:
    """Print a line to standard error, with passwords in addresses hidden.

    Nothing happens if the stream cannot be written.
    """
    with contextlib.suppress(OSError):
        print(without_secrets(words), file=sys.stderr)
