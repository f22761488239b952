"""Container identifiers after ISO 6346: owner code, serial number, check digit, size-type code."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastgen.errors import ConfigError

_LETTER_VALUES = dict(
    zip("ABCDEFGHIJKLMNOPQRSTUVWXYZ", (v for v in range(10, 39) if v % 11), strict=True)
)


@dataclass(frozen=True)
class Identifier:
    """owner: four letters, the last a U for freight containers. serial: six digits. check: one."""

    owner: str
    serial: str
    check: str
    size_type: str


def check_digit(owner_and_serial: str) -> int:
    """Check digit of ten characters such as 'CSQU305438'. ISO 6346:1995, annex A.

    Letters count up from A = 10 and leave out multiples of 11; the i-th character from the left
    weighs 2 ** i; the sum modulo 11, where 10 counts as 0. Raises ConfigError for other text.
    """
    text = owner_and_serial
    if len(text) != 10 or not text[:4].isalpha() or not text[4:].isdigit() or not text.isupper():
        raise ConfigError(f"identifier {text!r}: give four capital letters and six digits")
    return _remainder(text) % 10


def sample_identifier(
    rng: np.random.Generator, owner_codes: Sequence[str], size_type: str
) -> Identifier:
    """A random identifier. Serials whose remainder is 10 are left out, as annex A recommends:
    their check digit 0 would not tell them from those whose remainder is 0."""
    owner = str(rng.choice(owner_codes))
    while True:
        serial = f"{int(rng.integers(1_000_000)):06d}"
        remainder = _remainder(owner + serial)
        if remainder != 10:
            return Identifier(owner, serial, str(remainder), size_type)


def _remainder(text: str) -> int:
    values = (_LETTER_VALUES[c] if c.isalpha() else int(c) for c in text)
    return sum(value << i for i, value in enumerate(values)) % 11
