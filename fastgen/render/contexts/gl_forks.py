"""Which of a driver's displays a process may use after it was forked.

A fork copies a driver's memory but not its threads, so that a display opened before it hangs the
child at its first read, through a new context too. What is open is a matter of the process, not of
any object in it, and so is this record.
"""

import os

REASON = (
    "was opened before this process was forked, and its driver's threads did not come along; "
    "start the process with spawn or forkserver"
)

_opened: dict[str, int | None] = {}
"""Display -> the process that opened it first; None where it has no threads to lose."""


def opened(display: str, software: bool) -> None:
    """Note that this process opens `display`. software: Mesa's rasterizer on the processor."""
    # llvmpipe reads this when the first context of a display is made
    threadless = software and os.environ.get("LP_NUM_THREADS") == "0"
    _opened.setdefault(display, None if threadless else os.getpid())


def usable(display: str) -> bool:
    """Whether `display` works here: no parent opened it, with threads, before the fork."""
    return _opened.get(display) in (None, os.getpid())
