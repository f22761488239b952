"""Container identifiers (ISO 6346): owner code, serial number, check digit, size-type code."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastgen.errors import ConfigError

_LETTER_VALUES = dict(
    zip("ABCDEFGHIJKLMNOPQRSTUVWXYZ", (v for v in range(10, 39) if v % 11), strict=True)
)


_CATEGORY_SHARES = (0.96, 0.02, 0.02)
"""Frequency of the equipment categories U, J and Z in random owner codes."""


@dataclass(frozen=True)
class Identifier:
    """Identifier of one container.

    Attributes:
        owner: Owner code, four letters; the last is U for freight containers.
        serial: Serial number, six digits.
        check: Check digit.
        size_type: Size-type code, for example '22G1'.
    """

    owner: str
    serial: str
    check: str
    size_type: str


def check_digit(owner_and_serial: str) -> int:
    """Return the check digit of an owner code and serial number (ISO 6346:1995, annex A).

    Letter values count up from A = 10 and skip multiples of 11. Character i from the left, counted
    from 0, has weight 2 ** i. The check digit is the weighted sum modulo 11; 10 becomes 0.

    Args:
        owner_and_serial: Four capital letters and six digits, for example 'CSQU305438'.

    Returns:
        Check digit, 0 to 9.

    Raises:
        ConfigError: The text has another form.
    """
    text = owner_and_serial
    if len(text) != 10 or not text[:4].isalpha() or not text[4:].isdigit() or not text.isupper():
        raise ConfigError(f"identifier {text!r}: give four capital letters and six digits")
    return _remainder(text) % 10


def character_value(character: str) -> int:
    """Return the value of a capital letter or digit in the sum (ISO 6346:1995, annex A)."""
    return _LETTER_VALUES[character] if character.isalpha() else int(character)


def sample_identifier(
    rng: np.random.Generator, owner_codes: Sequence[str], size_type: str
) -> Identifier:
    """Sample an identifier.

    Serial numbers with remainder 10 are never sampled, as annex A recommends: they share check
    digit 0 with remainder 0.

    Args:
        rng: Random generator.
        owner_codes: Owner codes to choose from, all equally likely. If there are none, the first
            three letters are random, and the fourth is mostly U (freight containers), rarely J
            (detachable equipment) or Z (trailers).
        size_type: Size-type code of the container.

    Returns:
        Identifier with a valid check digit.
    """
    if owner_codes:
        owner = str(rng.choice(owner_codes))
    else:
        owner = "".join(rng.choice(list(_LETTER_VALUES), size=3))
        owner += str(rng.choice(list("UJZ"), p=_CATEGORY_SHARES))
    while True:
        serial = f"{int(rng.integers(1_000_000)):06d}"
        remainder = _remainder(owner + serial)
        if remainder != 10:
            return Identifier(owner, serial, str(remainder), size_type)


def _remainder(text: str) -> int:
    return sum(character_value(c) << i for i, c in enumerate(text)) % 11
