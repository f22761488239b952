"""How the command ends when it is stopped before it has begun. Loads quickly, unlike the rest."""

import contextlib
import os
import signal
from collections.abc import Iterator
from types import FrameType
from typing import NoReturn

STOPPED = "fastgen: stopped; run the same command again to go on"


@contextlib.contextmanager
def ended_at_once() -> Iterator[None]:
    """Within, Ctrl-C and SIGTERM end the process with one line; where ignored, they stay so.

    For the time in which modules load: nothing is begun that would have to be cleared away, and an
    exception would leave a module half loaded, or come out as an ImportError.
    """
    # a shell has what it starts in the background ignore Ctrl-C
    heard = [s for s in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(s) != signal.SIG_IGN]
    before = {each: signal.signal(each, _end) for each in heard}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _end(number: int, _: FrameType | None) -> NoReturn:
    with contextlib.suppress(OSError):  # standard error may be closed
        os.write(2, f"{STOPPED}\n".encode())
    os._exit(128 + number)
