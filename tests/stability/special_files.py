"""Special files that block or never end when they are read, and a guard against waiting."""

import contextlib
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

KINDS = ("pipe", "endless", "socket", "huge")
"""Kinds of `put`."""

_GUARD_S = 60


class Waited(BaseException):
    """A test waits for a special file. No `except Exception` of the tested code hides this."""


def put(kind: str, path: Path) -> None:
    """Replace `path` by a named pipe, a link to /dev/zero, a socket, or a sparse file of 100 TB."""
    path.unlink(missing_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "endless":
        path.symlink_to("/dev/zero")
    elif kind == "socket":
        # a relative name, because addresses of sockets have at most 108 bytes
        with contextlib.chdir(path.parent), socket.socket(socket.AF_UNIX) as opened:
            opened.bind(path.name)
    else:
        with path.open("wb") as file:
            # the largest size of a file differs between file systems
            for size in (100 << 40, 8 << 40):
                with contextlib.suppress(OSError):
                    file.truncate(size)
                    break


@contextlib.contextmanager
def not_waiting() -> Iterator[None]:
    """Raise Waited if the block waits for a special file."""

    def stop(*_: object) -> None:
        raise Waited

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(_GUARD_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
