"""Arrays on disk that several processes share. Losing them only costs time.

An entry is one .npy file with a structured array of a single record, whose fields are the arrays.
Processes map the file read-only, so they share its pages in memory.
"""

import contextlib
import fcntl
import hashlib
import importlib.metadata
import logging
import mmap
import os
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from zlib_ng import zlib_ng

from fastgen.files.atomic_file import ASIDE_FILES, whole_file
from fastgen.files.cache_folder import default_folder
from fastgen.files.plain_file import open_lock, open_plain

LIMIT_BYTES = 4 << 30
"""Largest size of a folder, about 240 environments; the least recently read entries go first."""

_LIBRARIES = (np.__version__, cv2.__version__, importlib.metadata.version("scipy"))
"""Versions of the libraries that compute the arrays; their results differ between releases."""

_log = logging.getLogger(__name__)

_CHECKSUM = "checksum"

_HEX = 32 * "[0-9a-f]"
_OLD_FORMAT = (f"*-{_HEX}.npz", f"{_HEX}-[0-9]*.npz")
"""Globs of entries that fastgen 0.23 and earlier wrote."""

Arrays = dict[str, NDArray[Any]]

Layout = Mapping[str, str]
"""Type and shape of each array by name, such as "float32 V 3". The order counts.

The type is a dtype or "unsigned". An axis is a number, or a name that stands for one size in all
arrays.
"""


def cached(
    name: str,
    version: int,
    inputs: object,
    make: Callable[[], Mapping[str, NDArray[Any]]],
    folder: Path | None = None,
    layout: Layout | None = None,
    what: str = "",
) -> Arrays:
    """Return the arrays of an entry, and make and store them if the entry is missing or damaged.

    An entry whose arrays do not have the layout counts as missing. If several processes need a
    missing entry, one makes it and the others wait. Without a writable folder, every process makes
    it.

    Args:
        name: Name of the producer, unique in the package.
        version: Version of the producer; a new one makes all its entries again.
        inputs: Everything else that the arrays depend on; its `repr` is part of the key.
        make: Returns the arrays by name.
        folder: Folder of the entries, by default `default_folder()`.
        layout: Type and shape of each array.
        what: Description of the entry for people, by default `name`.

    Returns:
        Read-only arrays by name, mapped from the file where possible.
    """
    key = hashlib.sha256(f"{version} {_LIBRARIES} {inputs!r}".encode()).hexdigest()
    folder = folder or default_folder()

    def announced() -> Mapping[str, NDArray[Any]]:
        once = "once per machine" if folder else "again, because the cache cannot be written"
        _log.info("preparing %s, %s", what or name.replace("-", " "), once)
        return make()

    arrays = (
        _found(folder / f"{name}-{key[:32]}.npy", announced, layout)
        if folder
        else dict(announced())
    )
    for array in arrays.values():
        array.flags.writeable = False
    return arrays


def _found(
    entry: Path, make: Callable[[], Mapping[str, NDArray[Any]]], layout: Layout | None
) -> Arrays:
    """Return the arrays of an entry; make and store them if it is missing, damaged or different."""
    arrays = read(entry, layout)
    if arrays is None:
        with _alone(entry):
            arrays = read(entry, layout)
            if arrays is None:
                made = dict(make())
                write(entry, made)
                # the mapped pages are shared, the made ones are not
                arrays = read(entry, layout) or made
    return arrays


def fits(arrays: Mapping[str, NDArray[Any]], layout: Layout) -> bool:
    """Return whether arrays have the names, types and shapes of a layout."""
    if list(arrays) != list(layout):
        return False
    sizes: dict[str, int] = {}
    for name, wanted in layout.items():
        kind, *axes = wanted.split()
        dtype, shape = arrays[name].dtype, arrays[name].shape
        alike = dtype.kind == "u" if kind == "unsigned" else dtype == np.dtype(kind)
        if not alike or len(axes) != len(shape):
            return False
        for axis, size in zip(axes, shape, strict=True):
            if size != (int(axis) if axis.isdecimal() else sizes.setdefault(axis, size)):
                return False
    return True


def read(entry: Path, layout: Layout | None = None) -> Arrays | None:
    """Return the arrays of an entry by name; None if it is missing, damaged or unlike `layout`."""
    try:
        record = _mapped(entry)
        if record[_CHECKSUM][0] != _checksum(record):
            return None
        unload(record)  # the checksum has read all pages, but few may be needed
        names = [name for name in record.dtype.names or () if name != _CHECKSUM]
        arrays = {name: record[name][0, ...] for name in names}
        if layout is not None and not fits(arrays, layout):
            return None
        with contextlib.suppress(OSError):  # _trim needs the time, which few file systems record
            os.utime(entry)
        return arrays
    except Exception:  # a file can be damaged in many ways
        return None


def write(entry: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Store arrays by name as an entry, whole or not at all; do nothing if it cannot be written."""
    fields = [(name, array.dtype, array.shape) for name, array in arrays.items()]
    record = np.zeros(1, np.dtype([(_CHECKSUM, np.uint32), *fields], align=True))
    for name, array in arrays.items():
        record[name][0] = array
    record[_CHECKSUM] = _checksum(record)
    with contextlib.suppress(OSError):
        entry.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(entry, durable=False) as file:
            np.save(file, record, allow_pickle=False)
        _trim(entry.parent)


def unload(array: NDArray[Any]) -> None:
    """Take a mapped array's pages out of this process's memory; they are mapped again when read."""
    base: object = array
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, mmap.mmap):
        base.madvise(mmap.MADV_DONTNEED)


def _mapped(entry: Path) -> NDArray[np.void]:
    open_plain(entry, LIMIT_BYTES).close()
    try:
        return np.asarray(np.load(entry, mmap_mode="r", allow_pickle=False))
    except OSError:  # some network file systems cannot map files
        return np.asarray(np.load(entry, allow_pickle=False))


def _checksum(record: NDArray[np.void]) -> int:
    """Return the CRC-32 of the names, types and values of all fields after the checksum itself."""
    # zlib gives the same value but takes seven times as long
    described = zlib_ng.crc32(repr(record.dtype.descr).encode())
    return zlib_ng.crc32(record.view(np.uint8)[np.dtype(np.uint32).itemsize :].data, described)


@contextlib.contextmanager
def _alone(entry: Path) -> Iterator[None]:
    """Exclude other processes from the same entry. The lock of a process ends with the process.

    Where files cannot be locked, nobody waits.
    """
    mark = entry.with_suffix(".lock")
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):
            entry.parent.mkdir(parents=True, exist_ok=True)
            file = held.enter_context(open_lock(mark))
            held.callback(mark.unlink, missing_ok=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _trim(folder: Path) -> None:
    """Remove the least recently read entries beyond LIMIT_BYTES, and files without a use.

    These are entries in an old format, and partial files and locks of processes that were killed.
    """
    for pattern in _OLD_FORMAT:
        for old in folder.glob(pattern):
            old.unlink(missing_ok=True)
    yesterday = time.time() - 24 * 3600
    for pattern in (ASIDE_FILES, "*.lock"):
        for left in folder.glob(pattern):
            with contextlib.suppress(FileNotFoundError):
                if left.stat().st_mtime < yesterday:
                    left.unlink()
    found = [(entry, entry.lstat()) for entry in folder.glob("*.npy")]
    spare = sum(about.st_size for _, about in found) - LIMIT_BYTES
    for entry, about in sorted(found, key=lambda one: one[1].st_mtime):
        if spare <= 0:
            break
        entry.unlink(missing_ok=True)
        spare -= about.st_size
