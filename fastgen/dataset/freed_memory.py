"""Limits of the freed memory that a process keeps, and its return to the operating system.

glibc keeps freed blocks that lie between blocks in use. Frames and label files differ in size, so
over thousands of images these gaps spread over more and more pages without more memory in use.
"""

import ctypes
from collections.abc import Callable

_C = ctypes.CDLL(None)
_malloc_trim: Callable[[int], int] | None = getattr(_C, "malloc_trim", None)
_mallopt: Callable[[int, int], int] | None = getattr(_C, "mallopt", None)

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Parameters of mallopt(3)."""

_KEPT_BYTES = 64 << 20
"""Free memory at the end of the heap that a process keeps. Arrays of one image take about 30 MB."""

_MAPPED_BYTES = 32 << 20
"""Size from which blocks are mapped on their own, and returned as soon as they are free."""


def keep_freed_memory() -> None:
    """Keep the memory of an image's arrays for those of the next image.

    By default, glibc returns it after each image. The system then clears some thousand pages again.
    Has no effect with C libraries that lack the function, such as musl.
    """
    if _mallopt is not None:
        _mallopt(_MMAP_THRESHOLD, _MAPPED_BYTES)
        _mallopt(_TRIM_THRESHOLD, _KEPT_BYTES)


def return_freed_memory() -> None:
    """Return free pages to the system, which takes about 2 ms; see malloc_trim(3).

    Has no effect with C libraries that lack the function, such as musl.
    """
    if _malloc_trim is not None:
        _malloc_trim(0)
