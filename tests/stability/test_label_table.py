"""Scenes and labels of 100 indices equal a stored table; label_table.py says how to change it."""

import csv

import pytest

from tests.stability.label_table import COUNTS, TABLE, rows

EDGE_PX = 6
"""Pixels on edges that another CPU or driver may decide otherwise."""


def test_scenes_and_labels_are_those_of_the_table():
    with TABLE.open(newline="", encoding="utf-8") as file:
        stored = list(csv.DictReader(file))
    assert len(stored) == sum(COUNTS.values())
    for row, wanted in zip(rows(), stored, strict=True):
        for name, value in row.items():
            pixels = name.endswith("_px")
            close = pytest.approx(int(wanted[name]), abs=EDGE_PX) if pixels else wanted[name]
            assert (value if pixels else str(value)) == close, (
                f"{row['preset']} {row['index']}: {name} changed; if that is intended, run "
                "`python -m tests.stability.label_table`"
            )
