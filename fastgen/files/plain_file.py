"""Reading of files that somebody else may have made, and lock files.

A named pipe can block for ever and a device can give bytes without end. So a file is opened only if
it is a regular file, and read only if its size is below a limit.
"""

import errno
import io
import os
import stat
from pathlib import Path

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def open_plain(path: str | Path, limit: int) -> io.BufferedReader:
    """Open a regular file, or a link to one, for reading.

    Args:
        path: The file.
        limit: Largest size in bytes.

    Raises:
        OSError: The file cannot be opened, is not a regular file, or is too large. `strerror` says
            which.
    """
    # before it is opened, because opening a device can have effects
    _check(os.stat(path), path, limit)
    # the file may have been replaced; without O_NONBLOCK, opening a named pipe waits for a writer
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        _check(os.fstat(handle), path, limit)
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def read_plain(path: str | Path, limit: int) -> bytes:
    """Return the content of a regular file; see `open_plain`."""
    with open_plain(path, limit) as stream:
        size = os.fstat(stream.fileno()).st_size
        data = stream.read(size + 1)
    if len(data) > size:
        raise OSError(errno.EBUSY, "it grows while it is read", str(path))
    return data


def open_lock(path: Path) -> io.FileIO:
    """Open a lock file, and make it if it does not exist. Its content does not change.

    Raises:
        OSError: The file cannot be opened, or is a link or another special file, which may belong
            to somebody else. `strerror` says which.
    """
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "it is a link; remove it", str(path)) from None
        if error.errno == errno.ENXIO:
            raise OSError(errno.ENXIO, "it is a socket; remove it", str(path)) from None
        raise
    mode = os.fstat(handle).st_mode
    if not stat.S_ISREG(mode):
        os.close(handle)
        raise OSError(errno.EINVAL, f"it is {_kind(mode)}; remove it", str(path))
    return io.FileIO(handle, "r+b")


def _check(about: os.stat_result, path: str | Path, limit: int) -> None:
    if stat.S_ISDIR(about.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(about.st_mode):
        words = f"it is {_kind(about.st_mode)}, not a regular file"
        raise OSError(errno.EINVAL, words, str(path))
    if about.st_size > limit:
        words = f"it has {about.st_size:,} bytes, more than the limit of {limit:,}"
        raise OSError(errno.EFBIG, words, str(path))


def _kind(mode: int) -> str:
    return _KINDS.get(stat.S_IFMT(mode), "a special file")
