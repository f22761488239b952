"""Silencing of libraries that print to standard error themselves."""

import contextlib
import os
import threading
from collections.abc import Iterator

_only_one = threading.Lock()


@contextlib.contextmanager
def without_native_messages() -> Iterator[None]:
    """Discard what this process writes to file descriptor 2 in this block.

    Libraries in C and C++ print there even if they report an error to their caller as well. The
    redirection counts for all threads.
    """
    with _only_one, contextlib.ExitStack() as undo:
        try:
            before = os.dup(2)
        except OSError:  # it is closed
            yield
            return
        undo.callback(os.close, before)
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        undo.callback(os.dup2, before, 2)
        yield
