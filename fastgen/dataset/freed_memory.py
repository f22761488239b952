"""Memory that was freed but not returned to the system.

glibc keeps freed blocks that lie between others in use. Frames and label files differ in size, so
over thousands of images such gaps spread over ever more pages, though no more is in use.
"""

import ctypes
from collections.abc import Callable

_malloc_trim: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)


def return_freed_memory() -> None:
    """Return whole free pages to the system: about 2 ms. Nothing where the C library, as musl's,
    cannot (malloc_trim(3))."""
    if _malloc_trim is not None:
        _malloc_trim(0)
