"""Placement of decals over many sampled scenes: geometry, statistics and standards."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from fastgen.classes import MARKER_CLASSES
from fastgen.config.config import Config
from fastgen.decals.artwork import brands, marker_prints
from fastgen.decals.glyphs import glyph_tiles
from fastgen.decals.lettering import layout
from fastgen.decals.weights import weight_lines
from fastgen.errors import AssetError, ConfigError
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.sampling.contents import sheet_sizes
from fastgen.sampling.markers import rhombus_offsets
from fastgen.srgb import DECODED


@pytest.fixture(scope="module")
def scenes():
    generator = Generator(seed=9)
    return [generator.scene(i) for i in range(250)]


def corners(decal):
    """Return the corners [4, 2] of a marker's diamond or of another decal's rectangle."""
    half = np.array(decal.size_mm) / 2
    if decal.kind == "marker":
        points = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]) * half
    else:
        points = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    angle = math.radians(decal.rotation_deg)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return points @ turn.T + np.array(decal.center_mm)


def apart(a, b):
    """Return True if a line parallel to an edge separates two convex polygons."""
    for polygon in (a, b):
        for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            normal = np.array([q[1] - p[1], p[0] - q[0]])
            if (a @ normal).max() <= (b @ normal).min() or (b @ normal).max() <= (a @ normal).min():
                return True
    return False


def test_labelled_decals_never_overlap(scenes):
    for scene in scenes[:60]:
        for face in ("front", "back", "door", "no_door", "roof"):
            shapes = [corners(d) for d in scene.decals if d.face == face and d.class_name]
            for i, a in enumerate(shapes):
                assert all(apart(a, b) for b in shapes[:i])


def test_tilted_neighbours_in_the_pattern_never_overlap():
    values = {"marker_tilt_deg": [-15, 15], "marker_gap_mm": [1, 1], "markers_per_face": [4, 8]}
    generator = Generator(Config.from_values({"markings": values}), seed=2)
    for index in range(30):
        decals = generator.scene(index).decals
        for face in ("front", "back"):
            shapes = [corners(d) for d in decals if d.face == face and d.kind == "marker"]
            assert len(shapes) > 1
            for i, a in enumerate(shapes):
                assert all(apart(a, b) for b in shapes[:i])


def test_every_decal_lies_on_its_sheet(scenes):
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
    # 25 degrees of freedom: five standard deviations above the mean
    assert chi_square < 25 + 5 * math.sqrt(50)


def test_every_face_bears_the_same_identifier(scenes):
    for scene in scenes:
        texts = [d for d in scene.decals if d.class_name == "text"]
        letters = {d.text.replace(" ", "")[:11] for d in texts}
        assert len(letters) == 1
        assert {d.face for d in texts} == {"front", "back", "door", "no_door", "roof"}


def test_mean_counts_per_face_match_the_configuration(scenes):
    config = Config.preset().markings
    walls = [d for s in scenes for d in s.decals if d.face != "roof"]
    markers = sum(d.kind == "marker" for d in walls) / (4 * len(scenes))
    texts = sum(d.class_name == "text" for d in walls) / (4 * len(scenes))
    # uniform from low to high; within four standard deviations of the mean over 1,000 faces
    low, high = config.markers_per_face
    deviation = math.sqrt(((high - low + 1) ** 2 - 1) / 12 / (4 * len(scenes)))
    assert markers == pytest.approx((low + high) / 2, abs=4 * deviation)
    # one per wall; two of the four walls have a second one with probability p
    p = config.second_identifier
    deviation = math.sqrt(p * (1 - p) / (2 * len(scenes))) / 2
    assert texts == pytest.approx(1 + p / 2, abs=4 * deviation)


def test_only_markers_and_identifiers_have_a_class():
    config = Config.from_values({"markings": {"identifiers": {"painted_over": 0}}})
    generator = Generator(config, seed=9)
    for decal in (d for index in range(100) for d in generator.scene(index).decals):
        if decal.kind == "marker":
            assert decal.art in marker_prints()[decal.class_name]
        else:
            letters = decal.text.replace(" ", "")
            reads_as_identifier = letters[3:4] in tuple("UJZ") and letters[4:11].isdigit()
            assert decal.class_name == ("text" if reads_as_identifier else "")


def test_every_identifier_ends_in_the_size_type_code_of_its_kind(scenes):
    codes = {
        "20": {"22G1", "22G0", "2210"},
        "40": {"42G1", "42G0", "4310"},
        "40HC": {"45G1", "45G0", "4510"},
        "45HC": {"L5G1", "L5G0"},
    }
    upright = 0
    for scene in scenes:
        for decal in (d for d in scene.decals if d.class_name == "text"):
            assert decal.text.split()[-1] in codes[scene.container.kind]
            upright += decal.vertical
    assert upright > len(scenes)


def test_every_container_bears_its_weights_on_the_right_door_leaf(scenes):
    for scene in scenes:
        mesh = build_container(scene.container.kind, scene.container.profiles)
        panels = [d for d in scene.decals if d.text.startswith("MAX GROSS")]
        assert [d.face for d in panels] == ["door"]
        assert corners(panels[0])[:, 0].min() > sheet_sizes(mesh)["door"][0] / 2


def test_only_high_cubes_warn_of_their_height(scenes):
    signs = {"height_sign", "height_triangle", "stripes"}
    for scene in scenes:
        if not scene.container.kind.endswith("HC"):
            assert not signs & {d.art for d in scene.decals}
    assert signs <= {d.art for s in scenes for d in s.decals}


def test_columns_on_the_end_wall_stand_on_outer_flats(scenes):
    for scene in scenes:
        mesh = build_container(scene.container.kind, scene.container.profiles)
        middles = [(a + b) / 2 for a, b in mesh.flats["no_door"]]
        for decal in scene.decals:
            if decal.vertical and decal.face == "no_door" and decal.class_name:
                owner = decal.lettering.parts[0]
                left = decal.center_mm[0] - decal.size_mm[0] / 2
                column = left + (owner.x0 + owner.x1) / 2
                assert min(abs(column - m) for m in middles) < 0.2


def test_letters_of_rows_and_blocks_on_the_end_wall_stand_on_flats(scenes):
    checked = 0
    for scene in scenes:
        wave = scene.container.profiles.end
        half_wave = (wave.outer_mm + wave.inner_mm) / 2 + math.hypot(wave.slope_mm, wave.depth_mm)
        mesh = build_container(scene.container.kind, scene.container.profiles)
        outer = sum(mesh.flats["no_door"][0]) / 2
        for decal in scene.decals:
            if decal.vertical or decal.face != "no_door" or decal.class_name != "text":
                continue
            left = decal.center_mm[0] - decal.size_mm[0] / 2
            for glyph in decal.lettering.glyphs:
                letter = left + (glyph.x0 + glyph.x1) / 2
                away = (letter - outer + half_wave / 2) % half_wave - half_wave / 2
                assert abs(away) < 1.0  # lengths of decals are rounded to 0.1 mm
                checked += 1
    assert checked > 100


def test_letters_are_at_least_as_high_as_the_standard_requires(scenes):
    for scene in scenes:
        for decal in scene.decals:
            if decal.class_name == "text":
                assert decal.cap_mm >= 100
            if decal.text.startswith("MAX GROSS"):
                assert decal.cap_mm >= 50


def test_several_layouts_and_fonts_occur(scenes):
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
    with pytest.raises(ConfigError, match="'comic' is unknown"):
        Config.from_values({"markings": {"fonts": ["comic"]}})


@pytest.mark.parametrize("name", ["markers_per_face", "stickers_per_face"])
def test_counts_in_the_wrong_order_are_refused(name):
    with pytest.raises(ConfigError, match=f"markings.{name}: .* 5 is above the highest 2; swap"):
        Config.from_values({"markings": {name: [5, 2]}})


def test_owner_codes_are_four_letters_ending_in_u():
    codes = [code for brand in brands() for code in brand.owner_codes]
    assert len(codes) == len(set(codes))
    assert all(len(c) == 4 and c.isalpha() and c.isupper() and c[-1] == "U" for c in codes)


def test_turning_stickers_off_changes_no_other_draw():
    """Cameras, surface and marker classes stay as they were."""
    plain = Generator(seed=3)
    bare = Generator(Config.from_values({"markings": {"stickers_per_face": [0, 0]}}), seed=3)
    for index in range(20):
        a, b = plain.scene(index), bare.scene(index)
        assert a.cameras == b.cameras
        assert a.surface == b.surface
        classes = [[d.class_name for d in s.decals if d.kind == "marker"] for s in (a, b)]
        assert classes[0] == classes[1]


def test_wear_removes_paint_in_proportion(generators):
    """Half the wear removes half as much from the same spots; full wear leaves some print."""
    config = Config.from_values({"damage": {"probability": 0}, "spreader": {"probability": 0}})
    images = []
    generator = generators(config, seed=4, size=(256, 256), quality="draft")
    scene = generator.scene(0)
    for wear in (0.0, 0.5, 1.0):
        painted = [d for d in scene.decals if d.kind not in ("marker", "sticker")]
        worn = tuple(replace(decal, wear=wear) for decal in painted)
        sample = generator.render(scene=replace(scene, decals=worn), layer="decals")
        images.append(DECODED[sample.image])
    bare = generator.render(scene=replace(scene, decals=()), layer="decals")
    fresh, half, all_worn = (image - DECODED[bare.image] for image in images)
    printed = np.abs(fresh).max(axis=2) > 0.2
    share = 1 - all_worn[printed] / np.where(np.abs(fresh[printed]) > 0.1, fresh[printed], np.nan)
    assert 0.3 < np.nanmean(share) < 0.5  # uniform noise exceeds 0.6 in 40 % of the area
    np.testing.assert_allclose(half[printed], ((fresh + all_worn) / 2)[printed], atol=0.05)
