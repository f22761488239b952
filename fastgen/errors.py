"""Errors that a user can act on: they name the file, field or value and say what to do."""

import difflib
import reprlib
from collections.abc import Iterable
from typing import Any

from fastgen.redaction import without_secrets

_LONGEST = 4000
"""Most characters of a message."""

_LONGEST_NAME = 80
"""Most characters of a name or key."""

_MOST_CHOICES = 60
"""Most names that a message lists."""


def one_line(text: str) -> str:
    """Return a message that is safe to print: one line, with escaped control characters.

    Passwords of addresses in it are replaced by ***.
    Control characters in names of files and keys could change colors, move the cursor or reverse
    the direction of writing. A very long message loses its middle.
    """
    words = " ".join(without_secrets(text).split())
    if len(words) > _LONGEST:
        words = f"{words[: 3 * _LONGEST // 4]} ... {words[-_LONGEST // 4 :]}"
    if words.isprintable():
        return words
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in words)


def shown(value: Any) -> str:
    """Return a value as short text for a message; control characters are escaped."""
    return _short.repr(value)


def shown_name(name: object) -> str:
    """Return a name or key as it is, or quoted and cut if it is long or not printable."""
    text = name if isinstance(name, str) else shown(name)
    return text if text.isprintable() and len(text) <= _LONGEST_NAME else shown(text)


def did_you_mean(word: Any, choices: Iterable[str]) -> str:
    """Return the hint ' (did you mean X?)' for a mistyped word; '' if it resembles no choice."""
    names = sorted(choices)
    text = word if isinstance(word, str) else shown(word)
    alike = [name for name in names if name.casefold() == text.casefold()]
    close = alike or difflib.get_close_matches(text, names, n=1, cutoff=0.6)
    return f" (did you mean {close[0]}?)" if close else ""


def nearest(word: Any, choices: Iterable[str]) -> str:
    """Return the hint ' (did you mean X?)' for a mistyped word, or the list of choices."""
    names = sorted(choices)
    hint = did_you_mean(word, names)
    if hint:
        return hint
    more = f" and {len(names) - _MOST_CHOICES} more" if len(names) > _MOST_CHOICES else ""
    return f" (choose from {', '.join(names[:_MOST_CHOICES])}{more})"


class _Short(reprlib.Repr):
    """`reprlib.Repr` that also accepts integers with more digits than Python converts to text."""

    def repr_int(self, x: int, level: int) -> str:
        try:
            return super().repr_int(x, level)
        except ValueError:
            return f"an integer of {x.bit_length()} bits"


_short = _Short()


class FastgenError(Exception):
    """Base of all errors for bad input or a missing capability of the machine.

    Args:
        message: What is wrong, where, and what to do; made safe to print with `one_line`.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(one_line(message))


class ConfigError(FastgenError, ValueError):
    """Unusable configuration value, key, preset or argument.

    It is a ValueError so that pydantic reports it with the location of the value.
    """


class AssetError(FastgenError):
    """Missing, broken or unsuitable file: an HDRI, a font, a marker."""


class ContextError(FastgenError):
    """OpenGL context that this machine cannot create, or CUDA without access to its images."""


class OutputError(FastgenError):
    """Output folder that cannot be written or that holds something else."""
