"""Record of the driver displays that a process opened, to detect unusable ones after a fork.

A fork copies the memory of a driver but not its threads. A display opened before the fork hangs the
child at its first read-back, even through a new context. Displays belong to the process, so the
record is global.
"""

import os

REASON = (
    "was opened before this process was forked, and the fork has none of its driver's threads; "
    "start the process with spawn or forkserver"
)

_opened: dict[str, int | None] = {}
"""Display -> id of the process that opened it first, None if the driver has no threads."""


def opened(display: str, software: bool) -> None:
    """Record that this process opens a display. software: it uses Mesa's CPU rasterizer."""
    # llvmpipe reads this variable when it creates the first context of a display
    threadless = software and os.environ.get("LP_NUM_THREADS") == "0"
    _opened.setdefault(display, None if threadless else os.getpid())


def usable(display: str) -> bool:
    """Return whether a display works: no parent process opened it with threads before a fork."""
    return _opened.get(display) in (None, os.getpid())
