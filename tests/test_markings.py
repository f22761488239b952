"""Placement of decals: geometry, proportions and norms, over many sampled scenes."""

import math
from collections import Counter

import numpy as np
import pytest

from fastgen.artwork import brands, glyph_tiles
from fastgen.classes import MARKER_CLASSES
from fastgen.config import Config
from fastgen.container import build_container
from fastgen.errors import AssetError, ConfigError
from fastgen.generator import Generator
from fastgen.lettering import layout
from fastgen.markings import rhombus_offsets, weight_lines
from fastgen.sampling import sheet_sizes


@pytest.fixture(scope="module")
def scenes():
    generator = Generator(seed=9)
    return [generator.scene(i) for i in range(250)]


def corners(decal):
    """Corners of what the decal covers: a marker's diamond, else its rectangle."""
    half = np.array(decal.size_mm) / 2
    if decal.kind == "marker":
        points = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]) * half
    else:
        points = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    angle = math.radians(decal.rotation_deg)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return points @ turn.T + np.array(decal.center_mm)


def apart(a, b):
    """Whether a line parallel to an edge separates two convex polygons."""
    for polygon in (a, b):
        for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            normal = np.array([q[1] - p[1], p[0] - q[0]])
            if (a @ normal).max() <= (b @ normal).min() or (b @ normal).max() <= (a @ normal).min():
                return True
    return False


def test_labelled_things_never_overlap(scenes):
    for scene in scenes[:60]:
        for face in ("front", "back", "door", "no_door", "roof"):
            shapes = [corners(d) for d in scene.decals if d.face == face and d.class_name]
            for i, a in enumerate(shapes):
                assert all(apart(a, b) for b in shapes[:i])


def test_everything_lies_on_its_sheet(scenes):
    for scene in scenes:
        mesh = build_container(scene.container.kind, scene.container.profiles)
        sizes = sheet_sizes(mesh)
        for decal in scene.decals:
            points = corners(decal)
            assert points.min() >= 0
            assert (points <= np.array(sizes[decal.face])).all()


def test_marker_classes_are_uniform(scenes):
    counts = Counter(d.class_name for s in scenes for d in s.decals if d.kind == "marker")
    total = sum(counts.values())
    expected = total / len(MARKER_CLASSES)
    chi_square = sum((counts[name] - expected) ** 2 / expected for name in MARKER_CLASSES)
    assert chi_square < 25 + 5 * math.sqrt(50)  # five deviations above the mean of 25 degrees


def test_one_identifier_is_on_every_face_and_the_same(scenes):
    for scene in scenes:
        texts = [d for d in scene.decals if d.class_name == "text"]
        letters = {d.text.replace(" ", "")[:11] for d in texts}
        assert len(letters) == 1
        assert {d.face for d in texts} >= {"front", "back", "no_door"}


def test_letters_are_as_high_as_the_standard_asks(scenes):
    for scene in scenes:
        for decal in scene.decals:
            if decal.class_name == "text":
                assert decal.cap_mm >= 100
            if decal.text.startswith("MAX GROSS"):
                assert decal.cap_mm >= 50


def test_several_layouts_and_fonts_come(scenes):
    texts = [d for s in scenes for d in s.decals if d.class_name == "text"]
    assert {len(d.lines) for d in texts if not d.vertical} == {2, 3}
    assert any(d.vertical for d in texts)
    assert {d.font for d in texts} == set(glyph_tiles()[1])


def test_the_rhombus_pattern_follows_the_papers_formula():
    # N = 4: i_e = 3, i_b = -1; x_i = ceil(i w / 2), odd rows half a marker up
    assert rhombus_offsets(4, 300, 300) == [(-150, 150), (0, 0.0), (150, 150), (300, 0.0)]
    assert [len(rhombus_offsets(n, 300, 300)) for n in range(1, 9)] == list(range(1, 9))


def test_weights_add_up():
    rng = np.random.default_rng(0)
    for kind in ("20", "40", "40HC", "45HC"):
        gross, tare, net, _ = weight_lines(kind, rng)
        kg = [int(line.split(" KG")[0].split()[-1]) for line in (gross, tare, net)]
        lb = [int(line.split()[-2]) for line in (gross, tare, net)]
        assert kg[0] - kg[1] == kg[2]
        for kilograms, pounds in zip(kg, lb, strict=True):
            assert pounds == pytest.approx(kilograms * 2.20462262, abs=1)


def test_layout_box_is_tight_around_the_ink():
    _, fonts = glyph_tiles()
    for font in fonts.values():
        for lines, vertical in [(("HXLU 123",), False), (("AB", "CDE"), False), (("X1Y",), True)]:
            made = layout(lines, font, 100.0, vertical)
            left, right, low, high = [], [], [], []
            for glyph in made.glyphs:
                ink = font.glyphs[glyph.char]
                middle = (glyph.x0 + glyph.x1) / 2
                left.append(middle - (ink.ink_right - ink.ink_left) * 50)
                right.append(middle + (ink.ink_right - ink.ink_left) * 50)
                low.append(glyph.y0 + 30)
                high.append(glyph.y0 + 130)
            assert (min(left), min(low)) == pytest.approx((0, 0), abs=0.1)
            assert (max(right), max(high)) == pytest.approx(made.size_mm, abs=0.1)


def test_unknown_characters_and_fonts_are_named():
    font = next(iter(glyph_tiles()[1].values()))
    with pytest.raises(AssetError, match="no glyph for 'é'"):
        layout(("é",), font, 100.0)
    config = Config.from_values({"markings": {"fonts": ["comic"]}})
    with pytest.raises(ConfigError, match="unknown font 'comic'"):
        Generator(config).scene(0)


def test_owner_codes_are_four_letters_ending_in_u():
    codes = [code for brand in brands() for code in brand.owner_codes]
    assert len(codes) == len(set(codes))
    assert all(len(c) == 4 and c.isalpha() and c.isupper() and c[-1] == "U" for c in codes)


def test_a_stream_more_does_not_move_the_rest():
    """Turning stickers off leaves the markers' classes and the identifier as they were."""
    plain = Generator(seed=3)
    bare = Generator(Config.from_values({"markings": {"stickers_per_face": [0, 0]}}), seed=3)
    for index in range(20):
        a, b = plain.scene(index), bare.scene(index)
        assert a.cameras == b.cameras
        assert a.surface == b.surface
        classes = [[d.class_name for d in s.decals if d.kind == "marker"] for s in (a, b)]
        assert classes[0] == classes[1]
