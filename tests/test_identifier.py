"""ISO 6346 check digits compared with a second implementation."""

import numpy as np
import pytest

from fastgen.decals.iso6346 import check_digit, sample_identifier
from fastgen.errors import ConfigError


def slow_sum(text):
    """Return the ISO 6346 sum: letter values skip 11, 22 and 33, weights are powers of two."""
    table = {}
    value = 10
    for letter in "ABCDEFGHIJKLMNOPQRSTUVWXYZ":
        if value in (11, 22, 33):
            value += 1
        table[letter] = value
        value += 1
    total = 0
    for place, char in enumerate(text):
        total += (table[char] if char in table else int(char)) * 2**place
    return total


def slow_check_digit(text):
    return slow_sum(text) % 11 % 10


def test_check_digit_of_a_known_container():
    assert check_digit("CSQU305438") == 3


def test_every_letter_has_its_value_from_the_standard():
    # letter values of the standard's table, split where it skips 11, 22 and 33
    values = dict(zip("ABCDEFGHIJK", (10, *range(12, 22)), strict=True))
    values |= dict(zip("LMNOPQRSTU", range(23, 33), strict=True))
    values |= dict(zip("VWXYZ", range(34, 39), strict=True))
    for letter, value in values.items():
        # the letter at place 0 has weight 1; `rest` is the sum of the other places
        rest = int(sum(10 << place for place in (1, 2, 3)))
        assert check_digit(f"{letter}AAA000000") == (value + rest) % 11 % 10


def test_random_identifiers_agree_with_the_second_implementation():
    rng = np.random.default_rng(0)
    for _ in range(500):
        made = sample_identifier(rng, ["HXLU", "QMRU", "ABZU"], "22G1")
        assert len(made.serial) == 6
        assert int(made.check) == slow_check_digit(made.owner + made.serial)


def test_serials_with_a_remainder_of_ten_are_not_sampled():
    rng = np.random.default_rng(1)
    remainders = set()
    for _ in range(1000):
        made = sample_identifier(rng, ["HXLU"], "22G1")
        remainders.add(slow_sum(made.owner + made.serial) % 11)
    assert remainders == set(range(10))


@pytest.mark.parametrize("text", ["CSQU30543", "csqu305438", "CSQ1305438", "CSQU30543X"])
def test_malformed_text_is_refused(text):
    with pytest.raises(ConfigError, match="four capital letters and six digits"):
        check_digit(text)
