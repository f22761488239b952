"""The folder of the disk cache, which depends on the user's home."""

import contextlib
import functools
import multiprocessing
import os
import stat
import sys
import tempfile
from pathlib import Path

from fastgen.errors import one_line


def default_folder() -> Path | None:
    """Return $XDG_CACHE_HOME/fastgen or ~/.cache/fastgen, if it can be written.

    Otherwise return a folder of this user in the directory for temporary files, or None if that is
    not safe to use. A line on standard error then says so.
    """
    base = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG base directory specification says to ignore relative paths
    if os.path.isabs(base):
        return _usable(Path(base) / "fastgen")
    try:
        return _usable(Path.home() / ".cache" / "fastgen")
    except RuntimeError:
        return _usable(None)


@functools.cache
def _usable(folder: Path | None) -> Path | None:
    """Return the folder if it can be written, else the one among temporary files, or None."""
    if folder is not None:
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                return folder
    wanted = f"{folder} cannot be written" if folder else "the user has no home"
    private = Path(tempfile.gettempdir()) / f"fastgen-{os.getuid()}"
    if _is_private(private):
        _warn(f"{wanted}: lights and meshes are cached in {private}")
        return private
    _warn(
        f"{wanted}, and {private} is not a folder that only this user can write: lights and meshes "
        "are computed again at every start; set XDG_CACHE_HOME to a folder of your own"
    )
    return None


def _is_private(folder: Path) -> bool:
    """Make a folder if it is missing, and return whether it is this user's alone.

    Anybody can make a folder or a link of any name among temporary files, and put entries there.
    """
    try:
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        about = folder.lstat()
    except OSError:
        return False
    mode = stat.S_IMODE(about.st_mode)
    return stat.S_ISDIR(about.st_mode) and about.st_uid == os.getuid() and mode == 0o700


def _warn(words: str) -> None:
    """Print a line to standard error, once and not in each worker process."""
    if sys.stderr is not None and multiprocessing.parent_process() is None:
        with contextlib.suppress(OSError):
            print(one_line(f"fastgen: {words}"), file=sys.stderr)
