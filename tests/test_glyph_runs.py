"""Letters that the shader tests at a point, compared with all whose ink is near the point."""

import numpy as np

from fastgen.decals.glyphs import (
    GLYPH_EXTENT_STEPS,
    GLYPH_TILE_SIZE,
    glyph_coverage,
    glyph_extents,
    glyph_tiles,
)
from fastgen.decals.lettering import layout
from fastgen.render.glyph_runs import glyph_run
from fastgen.scene.limits import GLYPH_RANGE


def texts():
    """Yield texts of one to three lines, some with wide gaps, in both directions and many sizes."""
    rng = np.random.default_rng(5)
    letters = list("ABCXYZ0123456789")
    for cap_mm in (0.01, 5.0, 80.0, 600.0):
        for vertical in (False, True):
            for count in (1, 2, 3):
                for _ in range(6):
                    lines = (
                        "".join(rng.choice(letters, rng.integers(1, 16))) + " " * gap + "I"
                        for gap in rng.integers(0, 30, count)
                    )
                    yield tuple(lines), cap_mm, vertical


def part_of(p, run):
    """Return the part of the text that the shader uses at points [N, 2], in its precision."""
    count = np.float32(len(run.glyphs))
    along = p[:, int(run.parts_per_mm < 0)]
    part = along * np.float32(abs(run.parts_per_mm)) + np.float32(0.5) * count
    return np.clip(part, 0, count - 1).astype(int)


def unpacked(codes):
    """Return tile, half width and half height from the codes of letters [N]."""
    rest, high = np.divmod(codes.astype(np.int64), GLYPH_EXTENT_STEPS)
    return *np.divmod(rest, GLYPH_EXTENT_STEPS), high


def test_the_extent_of_a_letter_holds_its_ink_closely():
    _, fonts = glyph_tiles()
    font = next(iter(fonts.values()))
    texel = np.abs(np.arange(GLYPH_TILE_SIZE) + 0.5 - GLYPH_TILE_SIZE / 2) + 0.5
    for char in "IWQ80,":
        run = glyph_run(layout((char,), font, 100.0), glyph_extents())
        tile, *extent = (part[0] for part in unpacked(run.glyphs[:, 2]))
        assert tile == font.glyphs[char].tile
        ink = glyph_coverage()[tile] > 0
        for axis, steps in enumerate(extent):
            reach = texel[ink.any(axis=axis)].max() / GLYPH_TILE_SIZE
            assert reach <= steps / GLYPH_EXTENT_STEPS <= reach + 0.01


def test_a_part_lists_every_letter_that_reaches_into_it():
    font = next(iter(glyph_tiles()[1].values()))
    rng = np.random.default_rng(6)
    for lines, cap_mm, vertical in texts():
        lettering = layout(lines, font, cap_mm, vertical)
        run = glyph_run(lettering, glyph_extents())
        size = np.array(lettering.size_mm)
        boxes = np.array([g[2:] for g in lettering.glyphs]).reshape(-1, 2, 2) - size / 2
        centers = boxes.mean(axis=1)
        found = run.glyphs[:, :2]
        assert len(found) == len(centers)
        tiles = {g.tile for g in lettering.glyphs}
        tile, wide, high = unpacked(run.glyphs[:, 2])
        assert set(tile.tolist()) == tiles
        # random points, also beyond the ends of the text, and points on the borders of parts
        reach = size / 2 + cap_mm
        points = rng.uniform(-reach, reach, (200, 2)).astype(np.float32)
        borders = np.linspace(-0.5, 0.5, len(found) + 1) * size.max()
        points[: len(borders), int(run.parts_per_mm < 0)] = borders
        first, end = np.divmod(run.glyphs[part_of(points, run), 3].astype(int), GLYPH_RANGE)
        side = boxes[0, 1, 0] - boxes[0, 0, 0]
        reach = np.stack([wide, high], axis=1) / GLYPH_EXTENT_STEPS * side
        held = (np.abs(points[:, None] - found) <= reach).all(axis=2)
        numbers = np.arange(len(found))
        named = (numbers >= first[:, None]) & (numbers < end[:, None])
        assert not (held & ~named).any(), (lines, cap_mm, vertical)


def test_a_part_of_a_long_line_lists_few_letters():
    font = next(iter(glyph_tiles()[1].values()))
    run = glyph_run(layout(("CSQU3054383" * 4,), font, 100.0), glyph_extents())
    first, end = np.divmod(run.glyphs[:, 3].astype(int), GLYPH_RANGE)
    assert (end - first).mean() < 5


def test_letter_numbers_of_the_longest_text_are_exact():
    count = GLYPH_RANGE - 1
    font = next(iter(glyph_tiles()[1].values()))
    run = glyph_run(layout(("A" * count,), font, 10.0), glyph_extents())
    first, end = np.divmod(run.glyphs[:, 3].astype(np.int64), GLYPH_RANGE)
    assert end[-1] == count
    assert (np.diff(first) >= 0).all()
    assert (np.diff(end) >= 0).all()
