"""Content hashes, and JSON files that contain a hash of their own content."""

import hashlib
from collections.abc import Iterable, Iterator
from typing import Any

_LAST = b'"digest": "'

_LAYOUTS = ((b"\n}", b",\n "), (b"}", b","))
"""End of an object, and the text before its last member: indented by one space, and compact."""


def digest(data: bytes) -> str:
    """Return the SHA-256 of `data` in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def seal(text: bytes) -> bytes:
    """Add a hash of itself to the JSON text of a non-empty object, as its last member "digest"."""
    end, before = next(layout for layout in _LAYOUTS if text.endswith(layout[0]))
    return text.removesuffix(end) + before + _LAST + digest(text).encode() + b'"' + end


def is_sealed(text: bytes) -> bool:
    """Return whether `text` is unchanged since `seal` made it."""
    body = text.rpartition(_LAST)[0]
    return any(
        body.endswith(before) and seal(body.removesuffix(before) + end) == text
        for end, before in _LAYOUTS
    )


class Sums:
    """Iterator that passes pieces of a file on and adds up their size and hash."""

    def __init__(self, pieces: Iterable[bytes]) -> None:
        self._pieces, self._size, self._hash = pieces, 0, hashlib.sha256()

    def __iter__(self) -> Iterator[bytes]:
        for piece in self._pieces:
            self._size += len(piece)
            self._hash.update(piece)
            yield piece

    def entry(self) -> list[Any]:
        """Return size and SHA-256 of the pieces so far, as manifests list them."""
        return [self._size, self._hash.hexdigest()]
