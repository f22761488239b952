"""Handling of Ctrl-C and SIGTERM. This module loads quickly, unlike the rest of the package."""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import NoReturn

STOPPED = "fastgen: stopped"


class Terminated(KeyboardInterrupt):
    """SIGTERM was received. Docker and Slurm send it to stop a run."""


@contextlib.contextmanager
def ended_at_once() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM end the process with one line, unless they are ignored.

    This is for the time in which modules load: there is nothing to clean up yet, and an exception
    would leave a module half loaded or turn into an ImportError.
    """
    # a shell lets background jobs ignore Ctrl-C
    heard = [s for s in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(s) != signal.SIG_IGN]
    before = {each: signal.signal(each, _end) for each in heard}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


@contextlib.contextmanager
def interrupted_by_sigterm() -> Iterator[None]:
    """Raise Terminated on SIGTERM, so that the run cleans up as after Ctrl-C."""
    if threading.current_thread() is not threading.main_thread():  # only it receives signals
        yield
        return

    received = False

    def stop(*_: object) -> None:
        nonlocal received
        received = True
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would disturb the cleanup
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    except KeyboardInterrupt:
        if received:  # not in the handler: compiled code passes only KeyboardInterrupt on
            raise Terminated from None
        raise
    finally:
        signal.signal(signal.SIGTERM, before)


def _end(number: int, _: FrameType | None) -> NoReturn:
    with contextlib.suppress(OSError):  # standard error may be closed
        os.write(2, f"{STOPPED}\n".encode())
    os._exit(128 + number)
