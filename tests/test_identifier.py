"""ISO 6346 check digits by a second way of counting."""

import numpy as np
import pytest

from fastgen.errors import ConfigError
from fastgen.identifier import check_digit, sample_identifier


def slow_check_digit(text):
    """By the letter table written out, 11, 22 and 33 left out, and powers of two added up."""
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
    return total % 11 % 10


def test_the_known_container_checks():
    assert check_digit("CSQU305438") == 3


def test_letter_values_of_the_standard():
    # one letter in a code of values that do not matter shows its own value modulo 11
    assert slow_check_digit("BAAA000000") != slow_check_digit("CAAA000000")


def test_random_identifiers_agree_with_the_slow_count():
    rng = np.random.default_rng(0)
    for _ in range(500):
        made = sample_identifier(rng, ["HXLU", "QMRU", "ABZU"], "22G1")
        assert len(made.serial) == 6
        assert int(made.check) == slow_check_digit(made.owner + made.serial)


def test_remainders_of_ten_are_not_given_out():
    rng = np.random.default_rng(1)
    checks = {sample_identifier(rng, ["HXLU"], "22G1").check for _ in range(400)}
    assert checks == set("0123456789")


@pytest.mark.parametrize("text", ["CSQU30543", "csqu305438", "CSQ1305438", "CSQU30543X"])
def test_other_text_is_refused(text):
    with pytest.raises(ConfigError, match="four capital letters and six digits"):
        check_digit(text)
