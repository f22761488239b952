"""The example that reads identifiers: layouts and letter places from parts, reads, and scores."""

import itertools
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import text
import torch
from common.reader import (
    CANVAS,
    DIGITS,
    LETTERS,
    Reader,
    best_identifier,
    varied_batch,
    whole_canvas,
)

from fastgen.decals.glyphs import BOX, glyph_tiles
from fastgen.decals.identifier_layout import TYPE_PLACES, Form, identifier_parts
from fastgen.decals.iso6346 import Identifier, check_digit
from fastgen.decals.lettering import TILE_BASELINE_CAPS, layout

CODE = "CSQU3054383"
IDENTIFIER = Identifier("CSQU", "305438", "3", "22G1")
CAP = 20.0


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


def test_reads_are_scored_by_whole_codes_and_characters():
    found = text.measured([CODE] * 4, [CODE, "CSQU3054384", "CSQU305438", "CSQU3054399"])
    assert found["exact"] == pytest.approx(25)
    assert found["character errors"] == pytest.approx(100 * 4 / 44)


def test_the_reader_returns_the_most_likely_identifier_with_the_right_check_digit():
    rng = np.random.default_rng(3)
    for _ in range(5):
        # two candidates at each place, so that all codes can be tried
        tables = [(LETTERS, 4), (DIGITS, 6)]
        candidates = [
            {str(c): float(rng.normal()) for c in rng.choice(list(characters), 2, replace=False)}
            for characters, count in tables
            for _ in range(count)
        ]
        last = rng.normal(size=10)
        letters, digits = (
            np.array([[each.get(c, -np.inf) for c in characters] for each in part])
            for (characters, _), part in zip(tables, (candidates[:4], candidates[4:]), strict=True)
        )
        scores = {}
        for code in itertools.product(*candidates):
            end = check_digit("".join(code))
            score = sum(each[c] for each, c in zip(candidates, code, strict=True)) + last[end]
            scores["".join(code) + str(end)] = score
        found = best_identifier(letters, np.concatenate([digits, last[None]]))
        assert found == max(scores, key=scores.get)


def written(layout_name, type_place, font, boxed, matrix):
    """Return an identifier's parts and centres of letters, transformed by `matrix` [2, 2]."""
    upright = layout_name == "column"
    form = Form(layout_name, type_place, CAP, boxed, 0.8 * CAP, 0.5 * CAP, 1.5 * CAP)
    places = identifier_parts(IDENTIFIER, form, font)
    lettering = layout((), font, CAP, upright, places)

    def drawn(points):
        # text coordinates run up from the lower left corner
        x, y = np.asarray(points, float).T
        return np.stack([x, lettering.size_mm[1] - y], axis=1) @ matrix.T

    parts = []
    for p in lettering.parts:
        quad = drawn([(p.x0, p.y1), (p.x1, p.y1), (p.x1, p.y0), (p.x0, p.y0)])
        parts.append((p.role, p.text, torch.from_numpy(quad)))
    glyphs = [g for g in lettering.glyphs if g.char != BOX]
    centers = [((g.x0 + g.x1) / 2, g.y0 + (TILE_BASELINE_CAPS + 0.5) * CAP) for g in glyphs]
    return parts, drawn(centers)


@pytest.mark.parametrize("matrix", [np.eye(2), [[0.8, -0.15], [0.2, 1]], [[1, 0.2], [-0.25, 0.7]]])
@pytest.mark.parametrize("boxed", [True, False])
def test_layout_and_letter_places_follow_from_the_parts(matrix, boxed):
    for font in glyph_tiles()[1].values():
        for name, type_places in TYPE_PLACES.items():
            for type_place in type_places:
                parts, centers = written(name, type_place, font, boxed, np.array(matrix))
                known = text.identifier(torch.zeros(3, 9, 9, dtype=torch.uint8), parts)
                assert (known.layout, known.code) == (name, CODE)
                apart = np.linalg.norm(known.letters_px - centers[:11], axis=1)
                assert apart.max() < 0.5 * CAP, (font.name, name, type_place)


def picture(code, layout_name):
    """Draw a code in black on white and return it with the true places of its letters."""
    k = np.arange(11)
    column, row = {"rows": (k, 0 * k), "block": (np.where(k < 4, k, k - 4), k >= 4)}.get(
        layout_name, (0 * k, k)
    )
    centers = np.stack([20 + 22 * column, 20 + 26 * row], axis=1).astype(float)
    width, height = (centers.max(axis=0) + 20).astype(int)
    image = np.full((height, width, 3), 255, np.uint8)
    for char, (x, y) in zip(code, centers, strict=True):
        (w, h), _ = cv2.getTextSize(char, cv2.FONT_HERSHEY_SIMPLEX, 0.7, 2)
        place = (int(x - w / 2), int(y + h / 2))
        cv2.putText(image, char, place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, (0, 0, 0), 2, cv2.LINE_AA)
    low, high = (centers.min(axis=0) - 10).tolist(), (centers.max(axis=0) + 10).tolist()
    return text.Identifier(image, code, layout_name, centers, (*low, *high))


@pytest.mark.parametrize("layout_name", CANVAS)
def test_wanted_places_lie_on_the_letters_of_the_varied_canvas(layout_name):
    blank = picture(CODE, layout_name)
    pixels = np.full_like(blank.pixels, 255)
    rng = np.random.default_rng(2)
    x, y = blank.letters_px[6].astype(int)
    cv2.circle(pixels, (int(x), int(y)), 5, (0, 0, 0), -1)
    for _ in range(6):
        batch = varied_batch([replace(blank, pixels=pixels)], rng)
        height, width = (side // 4 for side in CANVAS[layout_name])
        row, column = divmod(int(batch.places[0, 6].argmax()), width)
        assert 0 <= row < height
        canvas = batch.grey[0, 0].numpy()
        contrast = abs(canvas - np.median(canvas))
        dot = np.argwhere(contrast > 0.6 * contrast.max()).mean(axis=0)
        assert np.abs(dot - (4 * row + 2, 4 * column + 2)).max() < 5


def test_a_reader_trained_on_few_codes_reads_them_in_every_layout():
    rng = np.random.default_rng(0)
    codes = ["CSQU3054383", "HXAU7219460"]
    texts = [picture(code, name) for name in CANVAS for code in codes]
    torch.manual_seed(0)
    model = Reader(width=8).train()
    optimizer = torch.optim.Adam(model.parameters(), 6e-3)
    groups = [[t for t in texts if t.layout == name] * 3 for name in CANVAS]
    for step in range(240):
        optimizer.zero_grad()
        model.text_loss(varied_batch(groups[step % 3], rng)).backward()
        optimizer.step()
    read = model.read([(t.pixels, t.layout) for t in texts])
    assert read == [t.code for t in texts]


def test_the_loss_of_a_mixed_batch_covers_all_its_layouts():
    font = next(iter(glyph_tiles()[1].values()))
    crop = torch.randint(256, (3, 240, 240), dtype=torch.uint8)
    targets = [
        {"parts": written(name, places[0], font, True, np.eye(2))[0]}
        for name, places in TYPE_PLACES.items()
    ]
    model = text.IdentifierReader(width=4)
    model.loss([crop] * 3, targets).backward()
    for name in CANVAS:
        assert float(model.places[name].weight.grad.abs().sum()) > 0


def test_a_picture_is_scaled_to_its_canvas_without_distortion():
    pixels = np.zeros((50, 400, 3), np.uint8)
    cv2.circle(pixels, (200, 25), 20, (255, 255, 255), -1)
    bright = np.argwhere(whole_canvas(pixels, "rows") > 127)
    high, wide = np.ptp(bright, axis=0) + 1
    assert high == pytest.approx(41 * 224 / 400, abs=1.5)
    assert wide == pytest.approx(high, abs=1)
