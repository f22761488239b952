"""Content of folders, to compare the output of two runs."""

import hashlib
from pathlib import Path


def content(folder: Path) -> dict[str, str]:
    """Return the SHA-256 hash of every file in `folder` by its relative path."""
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }
