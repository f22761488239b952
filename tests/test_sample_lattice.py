"""Sample positions compared with OpenGL's clip-space mapping and with pixel coverage."""

import cv2
import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.render.sample_lattice import SampleLattice, fitting


def texels_of(lattice, places, size):
    """Map image positions [..., 2] through clip space to texels of the targets, [..., 2]."""
    clip = 2 * np.asarray(places) / size - 1
    slanted = clip @ lattice.to_clip(size).T
    return (slanted + 1) / 2 * lattice.texels(size)


@pytest.mark.parametrize("per_axis", [1, 2, 3, 5])
@pytest.mark.parametrize("size", [(7, 5), (64, 90), (641, 480)])
def test_filter_samples_are_texel_centres_inside_the_targets(per_axis, size):
    lattice = SampleLattice(per_axis)
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    pixels = np.stack([columns, rows], axis=-1)
    middle = texels_of(lattice, pixels + 0.5, size)
    for offset in lattice.filter:
        places = pixels + 0.5 + np.array(lattice.from_center(offset))
        found = texels_of(lattice, places, size)
        np.testing.assert_allclose(found - middle, np.broadcast_to(offset, found.shape), atol=1e-9)
        np.testing.assert_allclose(found - np.floor(found), 0.5, atol=1e-9)
        assert found.min() > 0
        assert (found < lattice.texels(size)).all()


@pytest.mark.parametrize("per_axis", [2, 3, 5])
def test_each_sample_of_a_pixel_has_its_own_column(per_axis):
    lattice = SampleLattice(per_axis)
    offsets = [(right, down) for down in range(per_axis) for right in range(per_axis)]
    across = sorted(lattice.from_center(offset)[0] for offset in offsets)
    np.testing.assert_allclose(np.diff(across), 1 / per_axis**2)


def test_filter_weights_sum_to_one_and_are_centred():
    for per_axis in (1, 2, 3, 5):
        lattice = SampleLattice(per_axis)
        places = np.array([lattice.from_center(offset) for offset in lattice.filter])
        weights = np.array(list(lattice.filter.values()))
        assert weights.sum() == pytest.approx(1)
        np.testing.assert_allclose(weights @ places, 0, atol=1e-12)
        offsets = list(lattice.filter)
        assert offsets[0] == (0, 0)
        # the samples that decide whether a pixel sees one surface reach as far as the whole filter
        near, whole = (np.array(o) for o in (offsets[: lattice.near], offsets))
        assert (np.abs(near).max(axis=0) == np.abs(whole).max(axis=0)).all() or per_axis == 2
        assert len(near) == (1 if per_axis == 1 else 9)
        # the shader gathers them from neighbouring texels
        assert per_axis == 5 or np.abs(near).max() <= 1


@pytest.mark.parametrize("per_axis", [2, 3, 5])
def test_a_regions_columns_and_rows_contain_its_samples(per_axis):
    lattice, size = SampleLattice(per_axis), (40, 30)
    region = (11, 9, 6, 4)
    left, right = lattice.columns(region)
    top, bottom = lattice.rows(region)
    x, y = np.meshgrid(np.arange(11, 17), np.arange(9, 13))
    for offset in lattice.filter:
        places = np.stack([x, y], axis=-1) + 0.5 + np.array(lattice.from_center(offset))
        u, v = np.moveaxis(texels_of(lattice, places, size), -1, 0)
        assert left < u.min()
        assert u.max() < right
        assert top < v.min()
        assert v.max() < bottom
    assert right - left < (6 + 4 + 4) * (per_axis + 1)


def room_for_two(samples, size, limit):
    across, down = SampleLattice(samples).texels(size)
    shared = 2 if samples == 2 else 0  # rows
    return across <= limit and 2 * down - shared <= limit


@pytest.mark.parametrize("limit", [8192, 16384])
def test_the_sample_count_is_the_largest_that_fits_two_views(limit):
    rng = np.random.default_rng(1)
    found = set()
    for width, height in rng.integers(64, 4097, (300, 2)).tolist():
        for most in (1, 2, 3, 5):
            taken = fitting(most, (width, height), limit)
            found.add(taken)
            assert taken in range(1, most + 1)
            assert taken == 1 or room_for_two(taken, (width, height), limit)
            better = [n for n in (2, 3) if taken < n <= most]
            assert not any(room_for_two(n, (width, height), limit) for n in better)
    assert found == {1, 2, 3, 5}
    assert fitting(5, (640, 640), limit) == 5
    assert fitting(5, (2048, 1536), 1 << 20) == 3  # 25 samples would take gigabytes


@pytest.mark.parametrize(("quality", "most"), [("balanced", 0.09), ("high", 0.06)])
def test_upright_edges_have_many_levels_of_coverage(generators, quality, most):
    """Coverage at nearly upright edges is compared with 12x12 ids per pixel.

    Samples stacked in columns would be off by 1/6 (balanced) and 1/10 (high). The reference
    itself is off by up to 1/24.
    """
    size, times = (160, 120), 12
    upright = {"roll_deg": 1.0, "elevation_deg": 0.0, "azimuth_deg": 0.0, "distance_mm": 9000}
    config = Config.from_values({"damage": {"probability": 0}, "cameras": {"Cl": upright}})
    generator = generators(config, 5, (size[0] * times, size[1] * times), quality="draft")
    scene = generator.scene(2)
    seen = (generator.render(scene=scene, camera="Cl").ids > 0).astype(np.float32)
    half = times // 2
    share = cv2.blur(seen, (times, times), anchor=(half, half))[half::times, half::times]
    generator = generators(config, 5, size, quality=quality)
    cover = generator.render(scene=scene, camera="Cl").cover / 255
    # rows in which all edges are nearly upright
    rows = slice(60, 90)
    edge = (share[rows] > 0.02) & (share[rows] < 0.98)
    assert edge.sum() > 40
    error = np.abs(cover - share)[rows][edge]
    assert error.max() < most
