"""All label formats by name."""

import importlib
import pkgutil
from collections.abc import Sequence
from functools import cache

from fastgen import formats
from fastgen.formats.format import Format
from fastgen.validation import check_known

SEAFRONT = ("damage", "imdg", "container", "text", "door")
"""Formats that `--format seafront` always writes: the tasks of the SeaFront paper, and container
corners."""


@cache
def known_formats() -> dict[str, Format]:
    """Return every format of the package `fastgen.formats` by name."""
    found: dict[str, Format] = {}
    for module in pkgutil.iter_modules(formats.__path__, f"{formats.__name__}."):
        made = getattr(importlib.import_module(module.name), "FORMAT", None)
        if made is not None:
            found[made.name] = made
    return found


def formats_of(names: Sequence[str]) -> list[Format]:
    """Return formats by name.

    Raises:
        ConfigError: A name is unknown.
    """
    known = known_formats()
    for name in names:
        if name not in known:
            check_known("also", name, set(known) - set(SEAFRONT))
    return [known[name] for name in names]
