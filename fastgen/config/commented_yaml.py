"""A configuration as commented YAML: every key with its value, its meaning and its limits.

The comments are the docstrings of the configuration classes.
"""

import dataclasses
import inspect
import math
import re
import textwrap
import typing
from collections.abc import Iterator, Mapping
from typing import Any

import yaml

from fastgen.config.config import Config
from fastgen.config.yaml_values import Dumper
from fastgen.validation import Bounds, OneOf, Range, annotation

_HEAD = (
    "All keys. A file of your own needs only the keys that it changes; pass it with --config. A "
    "range is [lowest, highest], drawn from uniformly unless documented otherwise; one number "
    "stands for both. Lengths are millimetres, angles degrees, colors sRGB."
)
_WIDTH = 100


def as_yaml(config: Config) -> str:
    """Return the whole configuration as text that Config.load reads back to an equal one."""
    return "\n".join([*_comment(_HEAD), *_Text().fields(config, apart=True)]) + "\n"


def meanings(cls: type) -> tuple[str, dict[str, str]]:
    """Return the description of a dataclass and those of its fields, from its docstring.

    Fields are described in the docstring's section `Attributes:`, one entry `name: words` each.
    """
    about, _, rest = inspect.cleandoc(cls.__doc__ or "").partition("\n\nAttributes:\n")
    section = re.match(r"(?:    .*\n?|\n(?=    ))*", rest)
    entries = re.split(r"^    (\w+): ", section[0] if section else "", flags=re.MULTILINE)[1:]
    words = [" ".join(text.split()) for text in entries[1::2]]
    return " ".join(about.split()), dict(zip(entries[::2], words, strict=True))


class _Text:
    """Lines of YAML; the fields of a class are described only where it occurs first."""

    def __init__(self) -> None:
        self._described: set[type] = set()

    def fields(self, record: Any, apart: bool = False) -> Iterator[str]:
        """Yield the lines of a dataclass instance; apart: with empty lines between its fields."""
        hints = typing.get_type_hints(type(record), include_extras=True)
        words = {} if type(record) in self._described else meanings(type(record))[1]
        self._described.add(type(record))
        for name, hint in hints.items():
            if apart:
                yield ""
            yield from self._entry(name, getattr(record, name), hint, words.get(name, ""))

    def _entry(self, key: str, value: Any, hint: Any, words: str = "") -> Iterator[str]:
        name = f"{_plain(key)}:"
        if dataclasses.is_dataclass(value):
            if type(value) not in self._described:
                words = f"{words} {meanings(type(value))[0]}".strip()
            yield from _explained(name, words)
            yield from _indented(self.fields(value))
        elif isinstance(value, Mapping):
            yield from _explained(name if value else f"{name} {{}}", words, _limits(value, hint))
            for item_key, item in value.items():
                yield from _indented(self._entry(item_key, item, None))
            cls = _entry_class(hint)
            if not value and cls is not None and cls not in self._described:
                about, words_of = meanings(cls)
                self._described.add(cls)
                lines = [f"Each entry is a mapping with a name of its own. {about}"]
                lines += [f"{name}: {words_of[name]}" for name in words_of]
                for line in lines:
                    yield from _indented(_comment(line))
        elif value is None:
            yield from _explained(f"{name} null", words)
            (cls,) = (arg for arg in typing.get_args(hint) if arg is not type(None))
            if cls not in self._described:
                yield from _indented(_comment(f"Or a mapping, for example: {meanings(cls)[0]}"))
                yield from _indented(f"# {line}" for line in self.fields(cls()))
        else:
            plain = list(value) if isinstance(value, tuple) else value
            yield from _explained(f"{name} {_plain(plain)}", words, _limits(value, hint))


def _entry_class(hint: Any) -> type | None:
    """Return the dataclass of a mapping's values, or None for other values."""
    arguments = typing.get_args(hint)
    made = arguments[1] if len(arguments) == 2 else None
    return made if isinstance(made, type) and dataclasses.is_dataclass(made) else None


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return ("  " + line for line in lines)


def _comment(words: str) -> Iterator[str]:
    return (f"# {line}" for line in textwrap.wrap(words, _WIDTH - 8))  # "# ", indentation


def _plain(value: Any) -> str:
    """Return a scalar or a list of scalars as YAML on one line, in ASCII for any terminal."""
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
        return "two whole numbers" if typing.get_args(hint)[0] == tuple[int, int] else "list"
    if isinstance(value, Mapping):
        return "replaced as a whole"
    return "whole number" if isinstance(value, int) else ""


def _limits(value: Any, hint: Any) -> str:
    """Return type and limits of a field in words, for example 'list, each 0 to 1'."""
    kind, bounds, names = _kind(value, hint), annotation(Bounds, hint), annotation(OneOf, hint)
    prefix = {"list": "list of ", "replaced as a whole": "keys "}.get(kind, "one of ")
    each = "each " if kind in ("list", "replaced as a whole") else ""
    return _joined(
        "" if kind == "list" and names else kind,
        prefix + ", ".join(names.choices) if names else "",
        each + bounds.words if bounds else "",
    )


def _joined(*parts: str, by: str = ", ") -> str:
    return by.join(filter(None, parts))


def _explained(line: str, words: str, limits: str = "") -> Iterator[str]:
    """Yield a line with a comment of its meaning and limits; a long meaning goes above it."""
    comment = _joined(words.removesuffix("."), limits, by="; ")
    if limits and len(line) + len(limits) > _WIDTH - 4:
        yield from _comment(f"{words} {limits[0].upper()}{limits[1:]}.".strip())
        comment = ""
    elif len(line) + len(comment) > _WIDTH - 10 and words:
        yield from _comment(words)
        comment = limits
    yield f"{line}  # {comment}" if comment else line
