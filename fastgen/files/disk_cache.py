"""Arrays kept on disk from one run to the next. Losing them costs time only."""

import contextlib
import fcntl
import hashlib
import importlib.metadata
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.files.atomic_file import ASIDE_FILES, whole_file

T = TypeVar("T")

LIMIT_BYTES = 4 << 30
"""Of a folder; beyond it, what was not read for longest goes. About 240 lights."""


def default_folder() -> Path:
    """$XDG_CACHE_HOME/fastgen or ~/.cache/fastgen; for a user without a home, one of the user's
    own among temporary files."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG base directory specification asks to ignore relative paths
    if os.path.isabs(base):
        return Path(base) / "fastgen"
    try:
        return Path.home() / ".cache" / "fastgen"
    except RuntimeError:
        return Path(tempfile.gettempdir()) / f"fastgen-{os.getuid()}"


def read(entry: Path) -> dict[str, NDArray[np.generic]]:
    """The arrays of an entry by name; none where it is absent or damaged."""
    try:
        with np.load(entry, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        with contextlib.suppress(OSError):  # few disks note when a file is read, and _trim asks
            os.utime(entry)
        return arrays
    except Exception:  # an archive can be damaged in many ways
        return {}


def write(entry: Path, arrays: Mapping[str, Any], compress: bool = False) -> None:
    """Keep arrays by name as an entry, whole or not at all; none without a writable folder."""
    with contextlib.suppress(OSError):
        entry.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(entry, durable=False) as file:
            (np.savez_compressed if compress else np.savez)(file, **arrays)
        _trim(entry.parent)


def once(entry: Path, read: Callable[[], T | None], make: Callable[[], T]) -> T:
    """What `read` finds of an entry; where that is None, what `make` makes of it and writes.

    Of many workers that miss it one makes it, and the others then read it.
    """
    found = read()
    if found is None:
        with _alone(entry):
            found = read()
            if found is None:
                found = make()
    return found


def computed(
    name: str, inputs: object, make: Callable[[], Mapping[str, NDArray[Any]]]
) -> dict[str, NDArray[Any]]:
    """What `make` gives, arrays by name, read-only; read where the same code gave it before.

    inputs: all that it hangs on but for the package's own code, told apart by its repr.
    """
    key = hashlib.sha256(f"{_CODE} {inputs!r}".encode()).hexdigest()
    entry = default_folder() / f"{name}-{key[:32]}.npz"

    def made() -> dict[str, NDArray[Any]]:
        arrays = dict(make())
        write(entry, arrays)
        return arrays

    arrays = once(entry, lambda: read(entry) or None, made)
    for array in arrays.values():  # callers keep and share them
        array.flags.writeable = False
    return arrays


def _code_digest(folder: Path) -> str:
    """Of the modules in a folder and below, and of the versions of what they compute with: a number
    that somebody must raise would be forgotten. Scripts that draw assets compute nothing here."""
    versions = np.__version__, cv2.__version__, importlib.metadata.version("scipy")
    digest = hashlib.sha256(repr(versions).encode())
    for module in sorted(folder.rglob("*.py")):
        if module.relative_to(folder).parts[0] != "assets":
            digest.update(module.read_bytes())
    return digest.hexdigest()


_CODE = _code_digest(Path(__file__).parent)
"""Read with the modules: files that change later are not the code that runs."""


@contextlib.contextmanager
def _alone(entry: Path) -> Iterator[None]:
    """While inside, no other worker is inside for the same entry. A process that ends lets go.

    Where files cannot be locked, nobody waits.
    """
    mark = entry.with_suffix(".lock")
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):
            entry.parent.mkdir(parents=True, exist_ok=True)
            file = held.enter_context(mark.open("ab"))
            held.callback(mark.unlink, missing_ok=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _trim(folder: Path) -> None:
    """Remove entries, oldest first, until the rest is within LIMIT_BYTES, and what killed processes
    left."""
    yesterday = time.time() - 24 * 3600
    for pattern in (ASIDE_FILES, "*.lock"):
        for left in folder.glob(pattern):
            with contextlib.suppress(FileNotFoundError):
                if left.stat().st_mtime < yesterday:
                    left.unlink()
    found = [(entry, entry.stat()) for entry in folder.glob("*.npz")]
    spare = sum(about.st_size for _, about in found) - LIMIT_BYTES
    for entry, about in sorted(found, key=lambda one: one[1].st_mtime):
        if spare <= 0:
            break
        entry.unlink(missing_ok=True)
        spare -= about.st_size
