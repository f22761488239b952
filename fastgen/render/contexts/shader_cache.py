"""Guard against Mesa's shader cache on a full disk."""

import contextlib
import os
from pathlib import Path

_ROOM_BYTES = 32 << 20
"""Free space required for the cache, several times its growth in one run."""


def spare_full_disk() -> None:
    """Disable Mesa's shader cache in this process if its disk is nearly full.

    Mesa maps a sparse index file into memory. If the disk is full when a page is written, the
    process is killed by SIGBUS. Call this before the process opens its first context.
    """
    folder = os.environ.get("MESA_SHADER_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    with contextlib.suppress(OSError, RuntimeError):  # a missing folder or no home directory
        place = Path(folder) if folder else Path.home()
        while not place.exists():
            place = place.parent
        disk = os.statvfs(place)
        if disk.f_bavail * disk.f_frsize < _ROOM_BYTES:
            os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
