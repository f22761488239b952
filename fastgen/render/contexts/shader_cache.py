"""Mesa's cache of compiled shaders, kept off a disk that is too full for it."""

import contextlib
import os
from pathlib import Path

_ROOM_BYTES = 32 << 20
"""What it may grow by in a run, several times over."""


def spare_full_disk() -> None:
    """Switch the cache off for this process where its disk is nearly full.

    Mesa maps an index file into memory that is allocated as it is written to: where that fails, the
    process dies by SIGBUS. Call before the first context of a process.
    """
    folder = os.environ.get("MESA_SHADER_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    with contextlib.suppress(OSError, RuntimeError):  # a folder that is not there, or no home
        place = Path(folder) if folder else Path.home()
        while not place.exists():
            place = place.parent
        disk = os.statvfs(place)
        if disk.f_bavail * disk.f_frsize < _ROOM_BYTES:
            os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
