"""Presets, formats and kinds of damage that other packages offer as entry points (PyPA)."""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from typing import TypeVar

from fastgen.errors import ConfigError
from fastgen.validation import check_known

T = TypeVar("T")


def names(group: str) -> list[str]:
    """Return the names of the entry points of a group in alphabetical order; loads no package."""
    return sorted(_offered(group).names)


def chosen(field: str, name: str, own: Mapping[str, T], group: str, kind: type[T]) -> T:
    """Return an object of fastgen or of an installed package by name.

    Args:
        field: Key or option that names it, for messages.
        name: Name of the object.
        own: Objects of fastgen by name.
        group: Group of entry points of the others. Only the one with this name is loaded.
        kind: Type that the object must have.

    Raises:
        ConfigError: The name is unknown or given twice, or the entry point cannot be used.
    """
    check_known(field, name, {*own, *names(group)})
    found = list(_offered(group).select(name=name))
    if name not in own and len(found) == 1:
        return _loaded(field, found[0], kind)
    if name in own and not found:
        return own[name]
    owners = ["fastgen"] * (name in own) + [_package(each) for each in found]
    raise ConfigError(
        f"{field}: {name} is offered by {' and '.join(owners)}; uninstall one or rename its entry "
        f"point of the group {group}"
    )


@cache
def _offered(group: str) -> EntryPoints:
    """Return the entry points of a group, read once: there is a file for each installed package."""
    return entry_points(group=group)


def _loaded(field: str, entry: EntryPoint, kind: type[T]) -> T:
    what = f"{field}: {entry.name} of the package {_package(entry)}"
    try:
        made = entry.load()
    except Exception as error:  # the package may raise anything while it is imported
        raise ConfigError(
            f"{what} cannot be loaded from {entry.value} ({error!r}); reinstall or mend that "
            "package"
        ) from error
    if not isinstance(made, kind):
        raise ConfigError(
            f"{what} is a {type(made).__name__}; {entry.value} has to be an instance of "
            f"{kind.__module__}.{kind.__name__}"
        )
    return made


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else entry.module
