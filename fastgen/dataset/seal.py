"""Content hashes, and JSON files that contain a hash of their own content."""

import hashlib

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
