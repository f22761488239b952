"""What lies in a folder, to compare one run's output with another's."""

import hashlib
from pathlib import Path


def content(folder: Path) -> dict[str, str]:
    """Hash of every file by its relative name."""
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }
