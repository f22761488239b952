"""Atomic file writes: into a temporary file, which is then renamed to the target."""

import contextlib
import os
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

ASIDE_FILES = ".*.part"
"""Glob of the temporary files that a killed process may leave behind."""


@contextlib.contextmanager
def whole_file(target: Path, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a binary stream whose content replaces `target` when the block ends without an error.

    After an error `target` is unchanged.

    Args:
        target: The file.
        durable: Flush the content to disk before the file gets its name.

    Raises:
        OSError: The file cannot be written.
    """
    # processes may write the same file at the same time: the last rename wins
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
