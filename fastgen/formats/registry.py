"""All label formats by name."""

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache

from fastgen import formats, plugins
from fastgen.errors import ConfigError
from fastgen.formats.format import Format
from fastgen.validation import check_known

SEAFRONT = ("damage", "imdg", "container", "text", "door")
"""Formats that are written unless others are chosen: the tasks of the SeaFront paper, and container
corners."""

_GROUP = "fastgen.formats"
"""Entry points by which packages offer formats: instances of Format."""


@cache
def known_formats() -> dict[str, Format]:
    """Return every format of fastgen by name."""
    found: dict[str, Format] = {}
    for module in pkgutil.iter_modules(formats.__path__, f"{formats.__name__}."):
        made = getattr(importlib.import_module(module.name), "FORMAT", None)
        if made is not None:
            found[made.name] = made
    return found


def format_names() -> list[str]:
    """Return the names of all formats, also those of installed packages, in alphabetical order."""
    return sorted({*known_formats(), *plugins.names(_GROUP)})


def unknown_format(names: Sequence[str]) -> str | None:
    """Return the first name that no format of fastgen or of an installed package has."""
    known = format_names()
    return next((name for name in names if name not in known), None)


def formats_of(names: Sequence[str], option: str = "also") -> list[Format]:
    """Return formats by name.

    Args:
        names: Names of the formats.
        option: Option that gave the names, for the error message.

    Raises:
        ConfigError: A name is unknown.
    """
    known = known_formats()
    unknown = unknown_format(names)
    if unknown is not None:
        choices = set(format_names()) - (set(SEAFRONT) if option == "also" else set())
        check_known(option, unknown, choices)
    return [_chosen(name, known) for name in names]


def _chosen(name: str, known: Mapping[str, Format]) -> Format:
    made: Format = plugins.chosen("also", name, known, _GROUP, Format)  # type: ignore[type-abstract]
    if made.name != name:
        raise ConfigError(
            f"also: the format {name} calls itself {made.name!r}; give both the same name"
        )
    return made


def formats_for(names: Sequence[str], classes: Mapping[str, Sequence[str]]) -> list[Format]:
    """Return formats by name, for the class lists of a dataset.

    Args:
        names: Names of formats.
        classes: Class names in label order by name of the task, as in dataset.json.

    Raises:
        ConfigError: A name is unknown.
    """
    return [
        each.with_classes(classes[each.name]) if each.name in classes else each
        for each in formats_of(names)
    ]
