"""The example that reads identifiers: strips and letters from crops, and scores of reads."""

from functools import cache

import cv2
import numpy as np
import pytest
import text
import torch
from common.strips import letter_places, letters, row_count, straightened, strip

from fastgen.decals.artwork import glyph_tiles
from fastgen.decals.lettering import layout


def test_edit_distance_equals_exhaustive_search():
    @cache
    def shortest(a, b):
        if not a or not b:
            return len(a) + len(b)
        change = shortest(a[1:], b[1:]) + (a[0] != b[0])
        return min(change, shortest(a[1:], b) + 1, shortest(a, b[1:]) + 1)

    assert text.edit_distance("kitten", "sitting") == 3
    rng = np.random.default_rng(5)
    for _ in range(50):
        a, b = ("".join(rng.choice(list("AB1"), rng.integers(0, 7))) for _ in range(2))
        assert text.edit_distance(a, b) == shortest(a, b)


def test_reads_are_scored_without_blanks_and_by_check_digit():
    truth = ["CSQU305438 3 22G1", "CSQU3054383 22G1", "CSQU3054383 22G1"]
    read = ["CSQU305438322G1", "CSQU305438422G1", "CSQU305438322G"]
    found = text.measured(truth, read)
    assert found["exact"] == pytest.approx(100 / 3)
    assert found["character errors"] == pytest.approx(100 * 2 / 45)
    assert found["check digit right"] == pytest.approx(100 / 3)
    assert found["exact among these"] == 100


def test_best_path_drops_repeats_and_blanks():
    a, b = text.CHARACTERS.index("A") + 1, text.CHARACTERS.index("B") + 1
    assert text.decoded([0, a, a, 0, a, b, b, 0]) == "AAB"


def test_rows_are_counted_right_in_every_layout_of_every_font():
    blocks = {
        2: [("ORLU 566020 5", "42G1")],
        3: [("ORLU", "566020 5", "42G1"), ("ORLU 566", "020 5", "42G1")],
    }
    columns = {1: [("ORLU5660205 42G1",)], 2: [("ORLU5660205", "42G1")]}
    for upright, layouts in ((False, blocks), (True, columns)):
        for rows, all_lines in layouts.items():
            for lines in all_lines:
                for font in glyph_tiles()[1].values():
                    width, height = layout(lines, font, 100.0, upright).size_mm
                    shape = (width, height) if upright else (height, width)
                    assert row_count(shape, upright) == rows, (font.name, lines)


@pytest.mark.parametrize("slant", [-0.2, -0.05, 0.0, 0.1, 0.2])
def test_slanted_rows_become_level(slant):
    grey = np.full((60, 180), 200, np.uint8)
    for x in range(4, 176, 6):
        for row in (18, 42):
            y = round(row + slant * (x - 90))
            cv2.rectangle(grey, (x, y - 5), (x + 2, y + 5), 20, -1)
    ink = straightened(grey) < 110
    rows = np.flatnonzero(ink.any(axis=1))
    between = np.diff(rows).max()
    assert between > 8  # an empty band across the whole width
    assert strip(torch.from_numpy(np.repeat(grey[None], 3, axis=0))).shape == (1, 24, 400)


def columns_of(lines, cap=24):
    """Draw each line as a column of black letters on white, at the pitch of identifiers."""
    pitch, apart = 1.35 * cap, round(1.6 * cap)
    shape = (round(pitch * 10) + cap + 80, apart * (len(lines) - 1) + cap + 80)
    grey = np.full(shape, 255, np.uint8)
    for column, line in enumerate(lines):
        for row, char in enumerate(line):
            (w, h), _ = cv2.getTextSize(char, cv2.FONT_HERSHEY_SIMPLEX, 1, 2)
            place = (40 + column * apart + (cap - w) // 2, round(41 + row * pitch) + h)
            cv2.putText(grey, char, place, cv2.FONT_HERSHEY_SIMPLEX, 1, 0, 2, cv2.LINE_AA)
    return grey


@pytest.mark.parametrize("lean", [-0.1, -0.04, 0.0])
@pytest.mark.parametrize("slant", [-0.15, 0.0, 0.1])
def test_letters_of_leaning_columns_come_upright_and_in_order(lean, slant):
    number, size = "HXAU7A7X7A7", "UAX7"
    grey = columns_of([number, size])
    matrix = np.array([[1, lean, -lean * 190], [slant, 1, -slant * 65]], np.float32)
    grey = cv2.warpAffine(grey, matrix, grey.shape[::-1], borderValue=255)
    rows, columns = np.nonzero(grey < 128)
    inside = (slice(rows.min() - 3, rows.max() + 4), slice(columns.min() - 3, columns.max() + 4))
    found = letters(torch.from_numpy(np.repeat(grey[inside][None], 3, axis=0)))
    known = {}
    for char in set(number + size):
        ink = columns_of([char]) < 128
        known[char] = ink[np.ix_(ink.any(axis=1), ink.any(axis=0))].astype(np.float32)

    def likest(letter):
        picture = 255 - letter[0].numpy().astype(np.float32)
        scores = {}
        for char, ink in known.items():
            # letter images are 1.62 caps high: a pitch of 1.35 and a tenth on each side
            scaled = cv2.resize(ink, None, fx=0.65, fy=0.65, interpolation=cv2.INTER_AREA)
            scores[char] = cv2.matchTemplate(picture, scaled, cv2.TM_CCOEFF_NORMED).max()
        return max(scores, key=scores.get)

    assert "".join(likest(letter) for letter in found) == number + size


@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("ratio", [0.8, 1.0, 1.25])
def test_a_column_in_perspective_is_cut_between_its_letters(columns, ratio):
    count = 15 if columns == 1 else 11
    first = np.arange(count) * 1.35 + 0.6 * (np.arange(count) >= 11)
    share = np.stack([first, first + 1], axis=1) / (first[-1] + 1)
    # perspective image of a line; `ratio` is that of its ends' distances from the camera
    ink = 3 + 300 * share * ratio / (1 - share + share * ratio)
    column = np.full((306, 20), 200, np.uint8)
    for low, high in np.round(ink).astype(int):
        column[low:high, 6:9] = column[low:high, 12:15] = 30
    found = np.array(letter_places(column, columns))
    assert (found[:, 0] < ink[:, 0] + 1).all()
    assert (found[:, 1] > ink[:, 1] - 1).all()


def test_rows_are_not_cut_into_letters():
    assert letters(torch.zeros(3, 40, 120, dtype=torch.uint8)) == []


def test_light_on_dark_reads_as_dark_on_light():
    torch.manual_seed(3)
    model = text.Reader(width=4).eval()
    strips = torch.randint(256, (2, 1, 24, 400), dtype=torch.uint8)
    with torch.no_grad():
        assert torch.allclose(model(strips), model(255 - strips), atol=1e-4)
