"""Standard output and error: closed, full, or without the letters that we have."""

import contextlib
import io
import os
import sys

from fastgen.errors import OutputError


def mend_streams() -> None:
    """What is printed to a stream that was closed goes nowhere; escapes stand for letters that
    standard output has not, as standard error has it by itself."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def drop_unprinted() -> None:
    """Forget what can be printed nowhere: the interpreter would try again as it ends, and Python
    3.13 puts an exit code of its own in place of ours where it fails."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def tell(words: str, end: str = "\n") -> None:
    """Print to standard output, with all that waits there. Raises OutputError where it takes no
    more, BrokenPipeError where whoever read it has gone."""
    try:
        print(words, end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output: {error.strerror}") from None


def say(words: str) -> None:
    """A line on standard error, or none where that is a log on a full disk."""
    with contextlib.suppress(OSError):
        print(words, file=sys.stderr)
