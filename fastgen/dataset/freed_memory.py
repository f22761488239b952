"""Return of freed memory to the operating system.

glibc keeps freed blocks that lie between blocks in use. Frames and label files differ in size, so
over thousands of images these gaps spread over more and more pages without more memory in use.
"""

import ctypes
from collections.abc import Callable

_malloc_trim: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)


def return_freed_memory() -> None:
    """Return free pages to the system, which takes about 2 ms; see malloc_trim(3).

    C libraries without this function, such as musl, do nothing.
    """
    if _malloc_trim is not None:
        _malloc_trim(0)
