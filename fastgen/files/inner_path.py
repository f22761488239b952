"""Paths that a manifest gives, which must stay inside the folder of its dataset.

A dataset may come from somebody else. Its manifests decide which files are read and removed, so a
path such as `../victim` must never reach the disk.
"""

import os
import re
from pathlib import Path

from fastgen.errors import OutputError

_NAME = "[A-Za-z0-9_][A-Za-z0-9_.-]{0,254}"
INNER_PATH = f"{_NAME}(?:/{_NAME})*"
"""Pattern of the paths that fastgen gives to files. They have no `..`, no hidden file, no
drive letter, no backslash and no control character, and are not absolute."""


def is_inner(path: object) -> bool:
    """Return whether a value from a manifest is a path inside its dataset."""
    return isinstance(path, str) and re.fullmatch(INNER_PATH, path) is not None


def check_inner(path: str) -> str:
    """Return `path` if it stays inside its dataset.

    Raises:
        OutputError: It leads outside, or is not a path that fastgen writes.
    """
    if not is_inner(path):
        raise OutputError(f"{path!r}: is not a path inside the dataset; fastgen never wrote it")
    return path


def place_inside(root: Path, path: str, follow: bool = False) -> Path:
    """Return `root` joined with a path that stays inside it.

    Args:
        root: Folder of the dataset; it may be a link itself.
        path: Relative path.
        follow: The file itself may be a link, if it leads to a file inside `root`. Otherwise only
            the folders matter, because the link can be replaced or removed without its target.

    Raises:
        OutputError: The path or a link in it leads out of `root`.
    """
    place = root / check_inner(path)
    inside = os.path.realpath(root)
    target = os.path.realpath(place if follow else place.parent)
    if os.path.commonpath((inside, target)) != inside:
        raise OutputError(f"{place}: leads out of the dataset through a link; remove the link")
    return place
