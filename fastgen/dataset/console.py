"""Output to standard output and error that may be closed, full, or limited to ASCII."""

import contextlib
import io
import os
import sys

from fastgen.errors import OutputError
from fastgen.redaction import without_secrets


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


def say(words: str) -> None:
    """Print a line to standard error, with passwords in addresses hidden.

    Nothing happens if the stream cannot be written.
    """
    with contextlib.suppress(OSError):
        print(without_secrets(words), file=sys.stderr)
