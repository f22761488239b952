"""Filtered scratches of scrapes, against the mean of many fine samples."""

import numpy as np
import pytest

from fastgen.render.gl import open_context
from fastgen.scene.limits import MAX_DAMAGES
from tests.glsl import blocks, run

HALF_MM = (700.0, 150.0)
SCRAPES = 8


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


def wear(gl, number, places, filter_mm):
    """Return the wear of a random scrape at places [N, 2] on the sheet."""
    rng = np.random.default_rng(number)
    shape = np.zeros((3 * MAX_DAMAGES, 4))
    shape[0] = rng.uniform(6, 24), rng.uniform(0.3, 0.9), 60, 0
    shape[1, :2] = rng.uniform(0, 2 * np.pi), rng.uniform(0, 12)
    along, across = np.zeros((2, MAX_DAMAGES, 4))
    along[0], across[0] = (1, 0, 0, HALF_MM[0]), (0, 1, 0, HALF_MM[1])
    kept = blocks(gl, damage_shape=shape, damage_along=along, damage_across=across)
    body = (
        '#include "damage_scrape.glsl"\n'
        f"vec4 f(vec4 x) {{ mark_filter_mm = {filter_mm}; return vec4(scrape_wear(0, x.xyz)); }}"
    )
    found = run(gl, body, np.c_[places, np.zeros((len(places), 2))])[:, 0]
    del kept
    return found


def test_a_pixel_sees_the_mean_of_the_scratches_in_it(gl):
    rng = np.random.default_rng(1)
    places = rng.uniform(-1, 1, (500, 2)) * HALF_MM
    offsets = (np.arange(32) + 0.5) / 32 - 0.5
    error, spread = [], []
    for number in range(SCRAPES):
        fine = [wear(gl, number, places + (0, 4 * part), 0.05) for part in offsets]
        expected = np.mean(fine, axis=0)
        error.append(wear(gl, number, places, 4.0) - expected)
        spread.append(wear(gl, number, places, 0.05) - expected)
    assert np.sqrt(np.mean(np.square(error))) < 0.4 * np.sqrt(np.mean(np.square(spread)))


def test_scratches_end_within_their_scrape(gl):
    y = np.random.default_rng(3).uniform(-1, 1, (4000, 1)) * HALF_MM[1]
    for number in range(SCRAPES):
        for end in (-HALF_MM[0], HALF_MM[0]):
            found = wear(gl, number, np.c_[np.full_like(y, 1.001 * end), y], 0.05)
            assert not found.any()


@pytest.mark.parametrize("filter_mm", [10.0, 25.0, 80.0])
def test_scratches_are_as_strong_from_afar(gl, filter_mm):
    places = np.random.default_rng(2).uniform(-1, 1, (8000, 2)) * HALF_MM
    near, far = (
        [wear(gl, number, places, each).mean() for number in range(SCRAPES)]
        for each in (0.1, filter_mm)
    )
    assert np.mean(far) == pytest.approx(np.mean(near), rel=0.15)
    assert min(near) > 0.02
