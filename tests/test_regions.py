"""Rectangular regions of the image: set operations, and the regions that points project to."""

import numpy as np
import pytest

from fastgen.camera.projection import view_of
from fastgen.render.regions import bands, grown, hull_corners, merged, outside, within
from fastgen.scene import Camera
from fastgen.scene.optics import Lens


def painted(regions, size=(40, 30)):
    """Return how often the regions cover each pixel, [H, W]."""
    count = np.zeros(size[::-1], int)
    for x, y, width, height in regions:
        count[y : y + height, x : x + width] += 1
    return count


def test_bands_cover_all_regions_and_no_pixel_twice():
    rng = np.random.default_rng(3)
    for _ in range(300):
        low = rng.integers(0, [30, 20], (rng.integers(1, 5), 2))
        regions = [(*map(int, a), *map(int, rng.integers(0, 10, 2))) for a in low]
        asked, given = painted(regions), painted(bands(regions))
        assert given.max() <= 1
        assert (given[asked > 0] == 1).all()
        # rows without a region stay uncovered; regions of zero width are exempt
        assert (given.any(axis=1) == asked.any(axis=1)).all() or any(r[2] == 0 for r in regions)


def test_one_region_stays_whole_and_an_unknown_one_is_the_image():
    assert bands([(3, 4, 5, 6)]) == [(3, 4, 5, 6)]
    assert bands([(3, 4, 5, 6), (3, 10, 5, 2)]) == [(3, 4, 5, 8)]
    assert bands([(3, 4, 5, 6), None]) == [None]


def test_a_grown_region_ends_at_the_border_of_the_image():
    assert grown((10, 8, 4, 6), 2, (40, 30)) == (8, 6, 8, 10)
    assert grown((0, 20, 38, 10), 4, (40, 30)) == (0, 16, 40, 14)


def test_merged_regions_cover_all_and_no_pixel_twice():
    rng = np.random.default_rng(4)
    fewer = 0
    for _ in range(300):
        low = rng.integers(0, [30, 20], (rng.integers(1, 9), 2))
        regions = [(*map(int, a), *map(int, rng.integers(1, 10, 2))) for a in low]
        asked, given = painted(regions), painted(merged(regions))
        assert given.max() == 1
        assert (given[asked > 0] == 1).all()
        if asked.max() == 1:
            assert set(merged(regions)) == set(regions)
        fewer += len(merged(regions)) < len(regions)
    assert fewer > 50
    assert merged([(3, 4, 5, 6), None]) == [None]
    assert merged([]) == []


def test_outside_is_the_difference_of_regions():
    rng = np.random.default_rng(9)
    for _ in range(300):
        low = rng.integers(0, [30, 20], (rng.integers(1, 4), 2))
        kept = bands([(*map(int, a), *map(int, rng.integers(1, 10, 2))) for a in low])
        low = rng.integers(0, [30, 20], (rng.integers(0, 4), 2))
        others = [(*map(int, a), *map(int, rng.integers(0, 12, 2))) for a in low]
        given = outside(kept, others)
        expected = (painted(kept) > 0) & (painted(others) == 0)
        np.testing.assert_array_equal(painted(given), expected)
        assert all(width > 0 and height > 0 for _, _, width, height in given)


def test_within_is_the_intersection_with_one_region():
    rng = np.random.default_rng(10)
    for _ in range(200):
        low = rng.integers(0, [30, 20], (rng.integers(1, 4), 2))
        kept = bands([(*map(int, a), *map(int, rng.integers(1, 10, 2))) for a in low])
        other = (*map(int, rng.integers(0, 20, 2)), *map(int, rng.integers(1, 20, 2)))
        given = within(kept, other)
        expected = (painted(kept) > 0) & (painted([other]) > 0)
        np.testing.assert_array_equal(painted(given), expected)
    assert within([None], (3, 4, 5, 6)) == [(3, 4, 5, 6)]


@pytest.mark.parametrize(
    "lens",
    [
        None,
        Lens("brown_conrady", (-0.28, 0.06, 0.002, -0.003, 0.0)),
        Lens("brown_conrady", (0.15, 0.02, 0.0, 0.0, 0.0)),
        Lens("fisheye", (-0.05, 0.01, 0.0, 0.0)),
    ],
)
def test_hulls_project_into_their_rectangles(lens):
    rng = np.random.default_rng(11)
    size = (320, 200)
    checked, beside, spare = 0, 0, []
    for _ in range(300):
        eye, target = rng.uniform(-9000, 9000, (2, 3))
        view = view_of(Camera("a", tuple(eye), tuple(target), rng.uniform(18, 60), lens=lens), size)
        groups = rng.uniform(-6000, 6000, (8, 1, 3)) + rng.uniform(-2500, 2500, (8, 6, 3))
        corners, _ = hull_corners(view, groups)
        weights = rng.dirichlet(np.full(6, 0.3), (8, 400))
        pixels, depth = view.project(weights @ groups)
        inside = ((pixels >= 0) & (pixels < size)).all(axis=-1) & (depth > 0.1)
        passing = (view.to_view(groups)[..., 2] < 0).any(axis=1) & inside.any(axis=1)
        beside += passing.sum()
        for pixel, shown, rectangle in zip(pixels, inside, corners, strict=True):
            seen = pixel[shown]
            if len(seen) < 100:
                continue
            assert (seen >= rectangle[:2]).all()
            assert (seen <= rectangle[2:]).all()
            least = np.prod(np.ptp(seen, axis=0))
            spare.append(np.prod(rectangle[2:] - rectangle[:2]) / least)
            checked += 1
    assert checked > 300
    assert beside > 10
    assert np.median(spare) < 1.6  # random points do not reach the corners of their hull
