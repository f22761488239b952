"""Content hashes, and JSON files that carry one of themselves."""

import hashlib

_LAST = b'"digest": "'

_LAYOUTS = ((b"\n}", b",\n "), (b"}", b","))
"""How an object ends, and what stands before its last member: indented by one, and compact."""


def digest(data: bytes) -> str:
    """Content hash, SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def seal(text: bytes) -> bytes:
    """JSON text of an object, not an empty one, with a hash of itself as its last member."""
    end, before = next(layout for layout in _LAYOUTS if text.endswith(layout[0]))
    return text.removesuffix(end) + before + _LAST + digest(text).encode() + b'"' + end


def is_sealed(text: bytes) -> bool:
    """Whether `text` is as `seal` made it."""
    body = text.rpartition(_LAST)[0]
    return any(
        body.endswith(before) and seal(body.removesuffix(before) + end) == text
        for end, before in _LAYOUTS
    )
