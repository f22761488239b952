"""Scenes and labels of 100 indices equal a stored table; label_table.py says how to change it."""

import csv

import pytest

from tests.stability.label_table import COUNTS, TABLE, rows

EDGE_PX = 6
"""Pixels on edges that another CPU or driver may decide otherwise."""

TOLERANCES = {"object_px": EDGE_PX, "damage_px": EDGE_PX, "places_px": 0.2}
"""Allowed differences of numbers by column. Labels are rounded to 0.01 pixels, and CPUs may round
some of them otherwise."""


def test_scenes_and_labels_are_those_of_the_table():
    with TABLE.open(newline="", encoding="utf-8") as file:
        stored = list(csv.DictReader(file))
    assert len(stored) == sum(COUNTS.values())
    for row, wanted in zip(rows(), stored, strict=True):
        for name, value in row.items():
            close = wanted[name]
            if name in TOLERANCES:
                value, close = float(value), pytest.approx(float(close), abs=TOLERANCES[name])
            assert (value if name in TOLERANCES else str(value)) == close, (
                f"{row['preset']} {row['index']}: {name} changed; if that is intended, run "
                "`python -m tests.stability.label_table`"
            )
