"""`distinct_rows` compared with sets of tuples."""

import numpy as np
import pytest

from fastgen.geometry import distinct_rows as distinct
from fastgen.geometry.distinct_rows import distinct_rows


def rows_of(dtype, seed):
    rng = np.random.default_rng(seed)
    few = rng.integers(-3, 3, (400, 3)).astype(dtype)
    return few / 4 if np.issubdtype(dtype, np.floating) else few


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.int64])
@pytest.mark.parametrize("odd", [None, 0])
def test_each_distinct_row_is_returned_once_and_every_row_is_mapped_to_it(dtype, odd, monkeypatch):
    """All rows get the same hash if `odd` is 0, which forces the slow path."""
    if odd is not None:
        monkeypatch.setattr(distinct, "_ODD", np.full(3, odd, np.uint64))
    rows = rows_of(dtype, 5).astype(dtype)
    first, which = distinct_rows(rows)
    assert {tuple(row) for row in rows[first].tolist()} == {tuple(row) for row in rows.tolist()}
    assert len(first) == len({tuple(row) for row in rows.tolist()})
    assert (rows[first][which] == rows).all()


def test_zeros_of_both_signs_are_equal():
    rows = np.array([[0.0, 1.0, 2.0], [-0.0, 1.0, 2.0]], np.float32)
    first, which = distinct_rows(rows)
    assert len(first) == 1
    assert which.tolist() == [0, 0]
