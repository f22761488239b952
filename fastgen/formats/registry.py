"""All label formats by name."""

import importlib
import pkgutil
from collections.abc import Sequence
from functools import cache

from fastgen import formats
from fastgen.formats.format import Format
from fastgen.validation import check_known

SEAFRONT = ("damage", "imdg", "container", "text", "door")
"""Formats that are written unless others are chosen: the tasks of the SeaFront paper, and container
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


def formats_of(names: Sequence[str], option: str = "also") -> list[Format]:
    """Return formats by name.

    Args:
        names: Names of the formats.
        option: Option that gave the names, for the error message.

    Raises:
        ConfigError: A name is unknown.
    """
    known = known_formats()
    for name in names:
        if name not in known:
            check_known(option, name, set(known) - (set(SEAFRONT) if option == "also" else set()))
    return [known[name] for name in names]
