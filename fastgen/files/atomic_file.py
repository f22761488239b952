"""Files that are there whole or not at all: written aside, then renamed into place."""

import contextlib
import os
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

ASIDE_FILES = ".*.part"
"""Glob of what a process that was killed may leave beside its files."""


@contextlib.contextmanager
def whole_file(target: Path, durable: bool = True) -> Iterator[BinaryIO]:
    """A stream to write; what went into it stands at `target` once the block ends well, and
    nothing has changed where it does not.

    durable: whether it is on the disk before it bears its name. Raises OSError.
    """
    # several processes may write the same file: each its own, and the last rename wins
    aside = target.with_name(f".{uuid.uuid4().hex}.part")
    try:
        with aside.open("wb") as stream:
            yield stream
            if durable:
                stream.flush()
                os.fsync(stream.fileno())
        os.replace(aside, target)
    finally:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)
