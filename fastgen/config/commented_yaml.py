"""A configuration as commented YAML: every key with its value, its limits and what it means.

The words are the docstrings of the configuration's classes, so that they stand in one place.
"""

import dataclasses
import inspect
import math
import re
import textwrap
import typing
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import yaml

from fastgen.config.config import Config
from fastgen.config.yaml_values import Dumper
from fastgen.validation import Range

_HEAD = (
    "Every key. A file of your own needs only those that it changes; --config reads it. A range "
    "is [lowest, highest], drawn from uniformly unless said otherwise; one number stands for both. "
    "Lengths are millimetres, angles degrees, colors sRGB."
)
_WIDTH = 100
_GIVEN_AS_A_WHOLE = "given as a whole"


def as_yaml(config: Config) -> str:
    """The whole of a configuration, as text that Config.load reads back to an equal one."""
    return "\n".join([*_comment(_HEAD), *_Text().fields(config, apart=True)]) + "\n"


def meanings(cls: type) -> tuple[str, dict[str, str]]:
    """What the docstring of a dataclass says of it, and of its fields by name.

    A field's words begin a line behind its name and a colon; several may share them.
    """
    names = {field.name for field in dataclasses.fields(cls)}
    about: list[str] = []
    of: dict[str, str] = {}
    entry = ""
    for line in inspect.cleandoc(cls.__doc__ or "").splitlines():
        start = re.fullmatch(r"(\w+(?:, \w+)*): (.+)", line)
        if start and names.issuperset(start[1].split(", ")):
            entry = start[1].split(", ")[0]
            of |= dict.fromkeys(start[1].split(", "), "") | {entry: start[2]}
        elif line.startswith("    ") and entry:
            of[entry] += " " + line.strip()
        elif line.startswith("Raises "):
            break
        elif line:
            about.append(line)
    return " ".join(about), of


class _Text:
    """Says once of each class what its fields mean."""

    def __init__(self) -> None:
        self._told: set[type] = set()

    def fields(self, record: Any, apart: bool = False) -> Iterator[str]:
        """Lines of all fields of a dataclass instance; apart: with empty ones in between."""
        hints = typing.get_type_hints(type(record))
        words = {} if type(record) in self._told else meanings(type(record))[1]
        self._told.add(type(record))
        for field in dataclasses.fields(record):
            if apart:
                yield ""
            value, said = getattr(record, field.name), words.get(field.name, "")
            yield from self._entry(field.name, value, hints[field.name], field.metadata, said)

    def _entry(
        self, key: str, value: Any, hint: Any, meta: Mapping[str, Any], words: str = ""
    ) -> Iterator[str]:
        name = f"{_plain(key)}:"
        if dataclasses.is_dataclass(value):
            if type(value) not in self._told:
                words = f"{words} {meanings(type(value))[0]}".strip()
            yield from _explained(name, words)
            yield from _indented(self.fields(value))
        elif isinstance(value, Mapping):
            yield from _explained(name if value else f"{name} {{}}", words, _GIVEN_AS_A_WHOLE, meta)
            for item_key, item in value.items():
                yield from _indented(self._entry(item_key, item, typing.get_args(hint)[1], {}))
        elif value is None:
            yield from _explained(f"{name} null", words)
            (cls,) = (arg for arg in typing.get_args(hint) if arg is not type(None))
            if cls not in self._told:
                yield from _indented(_comment(f"Or a mapping, for example: {meanings(cls)[0]}"))
                yield from _indented(f"# {line}" for line in self.fields(cls()))
        else:
            plain = list(value) if isinstance(value, tuple) else value
            yield from _explained(f"{name} {_plain(plain)}", words, _kind(value, hint), meta)


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return ("  " + line for line in lines)


def _comment(words: str) -> Iterator[str]:
    return (f"# {line}" for line in textwrap.wrap(words, _WIDTH - 2))


def _plain(value: Any) -> str:
    """A scalar or a list of them, as YAML has it on one line, in ASCII for any terminal."""
    if isinstance(value, list):
        return f"[{', '.join(map(_plain, value))}]"
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    text: str = yaml.dump(value, Dumper=Dumper, default_flow_style=True, width=math.inf)
    return text.removesuffix("...\n").strip()


def _kind(value: Any, hint: Any) -> str:
    if isinstance(value, Range):
        return "range"
    if isinstance(value, tuple):
        any_length = typing.get_args(hint)[-1] is Ellipsis
        return "list" if any_length else "two whole numbers"
    return "whole" if hint is int else ""


def _explained(
    line: str, words: str, kind: str = "", meta: Mapping[str, Any] = MappingProxyType({})
) -> Iterator[str]:
    """A line with comments of what it means and what may stand there; above it where it is long."""
    unit = f" {meta['unit']}" if meta.get("unit") else ""
    each = "each " if kind in ("list", _GIVEN_AS_A_WHOLE) else ""
    within = f"{each}{meta['lo']:g} to {meta['hi']:g}{unit}" if "lo" in meta else ""
    limits = ", ".join(filter(None, (kind, within)))
    whole = "; ".join(filter(None, (words.removesuffix("."), limits)))
    if len(line) + len(whole) > _WIDTH - 10 and words:
        yield from _comment(words)
        whole = limits
    yield f"{line}  # {whole}" if whole else line
