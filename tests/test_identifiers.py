"""Layouts of identifiers, their parts in images, and their clearance from door gear."""

import itertools
from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.decals.glyphs import glyph_tiles
from fastgen.decals.identifier_layout import LAYOUTS, TYPE_PLACES, Form, identifier_parts
from fastgen.decals.iso6346 import Identifier, check_digit, sample_identifier
from fastgen.decals.lettering import layout
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.labels.crops import part_crop, text_crops
from fastgen.scene.check import check_scene

ROLES = ("owner", "serial", "check", "type")


@pytest.fixture(scope="module")
def scenes():
    generator = Generator(seed=12)
    return [generator.scene(i) for i in range(60)]


def identifiers(scenes, face=None):
    return [
        decal
        for scene in scenes
        for decal in scene.decals
        if decal.class_name == "text" and face in (None, decal.face)
    ]


def boxes(decal):
    return decal.lettering.parts


def test_the_parts_are_the_identifier_of_iso_6346(scenes):
    for decal in identifiers(scenes):
        owner, serial, check, size_type = (part.text for part in decal.parts)
        assert tuple(part.role for part in decal.parts) == ROLES
        assert (len(owner), len(serial)) == (4, 6)
        assert owner.isalpha()
        assert owner[3] in "UJZ"
        assert serial.isdigit()
        assert check == str(check_digit(owner + serial))
        assert decal.text == f"{owner} {serial} {check} {size_type}"


def test_parts_of_a_layout_never_overlap_and_fill_the_decal():
    identifier = Identifier("MWQU", "304050", "7", "45G1")
    for font in glyph_tiles()[1].values():
        for kind in LAYOUTS:
            for place in TYPE_PLACES[kind]:
                for boxed, pitch in itertools.product((False, True), (0.0, 139.0)):
                    form = Form(kind, place, 100.0, boxed, 60.0, 25.0, 50.0, pitch)
                    parts = identifier_parts(identifier, form, font)
                    made = layout((), font, 100.0, parts=parts)
                    rects = np.array([box[2:] for box in made.parts])
                    assert rects[:, :2].min(axis=0) == pytest.approx((0, 0), abs=0.1)
                    assert rects[:, 2:].max(axis=0) == pytest.approx(made.size_mm, abs=0.1)
                    for i, a in enumerate(rects):
                        for b in rects[:i]:
                            meet = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
                            assert (meet < 0).any(), (font.name, form)


def test_letters_on_flats_and_their_frames_keep_apart_in_all_fonts_and_sizes():
    config = Config.from_values(
        {"markings": {"cap_mm": [100, 180], "identifiers": {"rib_pitch": 1.0}}}, Config.preset()
    )
    generator, fonts, pitched = Generator(config, seed=5), glyph_tiles()[1], 0
    for index in range(60):
        for decal in identifiers([generator.scene(index)]):
            if decal.vertical or not any(part.pitch_mm for part in decal.parts):
                continue
            pitched += 1
            lines = {}
            for glyph in decal.lettering.glyphs:
                ink = fonts[decal.font].glyphs[glyph.char]
                half = (ink.ink_right - ink.ink_left) / 2 * decal.cap_mm
                middle = (glyph.x0 + glyph.x1) / 2
                lines.setdefault(round(glyph.y0), {})[round(middle, 3)] = max(
                    half, lines.get(round(glyph.y0), {}).get(round(middle, 3), 0.0)
                )
            for line in lines.values():
                for (a, half), (b, other) in itertools.pairwise(sorted(line.items())):
                    assert b - a > half + other, (decal.font, decal.cap_mm, decal.text)
    assert pitched > 30


def test_no_size_of_letters_leaves_an_end_wall_without_identifier():
    for cap_mm in (100, 140, 160, 180):
        generator = Generator(Config.from_values({"markings": {"cap_mm": cap_mm}}), seed=1)
        for index in range(40):
            assert identifiers([generator.scene(index)], "no_door"), (cap_mm, index)


def test_columns_have_gaps_between_owner_code_serial_and_check_digit(scenes):
    columns = [decal for decal in identifiers(scenes) if decal.vertical]
    assert len(columns) > 20
    for decal in columns:
        owner, serial, check, _ = boxes(decal)
        within = (serial.y1 - serial.y0 - 6 * decal.cap_mm) / 5
        assert owner.y0 - serial.y1 > within
        assert serial.y0 - check.y1 > 0
        # one column
        assert abs(owner.x0 + owner.x1 - serial.x0 - serial.x1) < 0.5
        assert abs(owner.x0 + owner.x1 - check.x0 - check.x1) < 0.5


def test_doors_have_owner_code_and_serial_number_on_both_sides_of_a_bar(scenes):
    found = 0
    for scene in scenes:
        bars = SHAPES.door_clearance(scene.container.kind, scene.container.profiles).bars
        for decal in identifiers([scene], "door"):
            if len(decal.lines) == 2 and not decal.vertical:
                owner, serial, *_ = boxes(decal)
                left = decal.center_mm[0] - decal.size_mm[0] / 2
                between = [(left + owner.x1 < a) and (b < left + serial.x0) for a, b in bars]
                found += sum(between) == 1
    assert found > 0.8 * len(scenes)


def gear_triangles(mesh):
    """Return the triangles [T, 3, 2] of gear, seen from the front: y and z in mm."""
    names = ("door.bar.", "door.cams.", "door.brackets.", "door.handle.", "door.hinges.")
    gear = [i for i, chart in enumerate(mesh.charts) if chart.name.startswith(names)]
    triangles = mesh.triangles[np.isin(mesh.chart[mesh.triangles[:, 0]], gear)]
    return mesh.positions_mm[triangles][..., 1:].astype(float)


def test_no_letter_on_a_door_is_behind_its_gear(scenes):
    checked = 0
    for scene in scenes[:25]:
        mesh = SHAPES.container(scene.container.kind, scene.container.profiles)
        a, b, c = gear_triangles(mesh).transpose(1, 0, 2)
        written = [d for d in scene.decals if d.face == "door" and d.parts]
        # gear may hide identifiers that were painted over
        doors = [d for d in written if d.class_name or not d.parts[0].role]
        for decal in doors:
            for box in boxes(decal):
                x, y = np.meshgrid(np.linspace(box.x0, box.x1, 9), np.linspace(box.y0, box.y1, 5))
                local = np.column_stack([x.ravel(), y.ravel()]) - np.array(decal.size_mm) / 2
                points, _ = mesh.sheet_to_surface("door", local + np.array(decal.center_mm))
                for point in points[:, 1:]:
                    # signs of the areas that the point spans with the sides
                    turns = [
                        (q - p)[:, 0] * (point - p)[:, 1] - (q - p)[:, 1] * (point - p)[:, 0]
                        for p, q in ((a, b), (b, c), (c, a))
                    ]
                    inside = (np.array(turns) > 1e-9).all(axis=0)
                    inside |= (np.array(turns) < -1e-9).all(axis=0)
                    assert not inside.any(), (scene.index, decal.text, box)
                    checked += 1
    assert checked > 1000


def test_all_letters_occur_in_owner_codes():
    generator = Generator(Config.from_values({"spreader": {"probability": 0}}), seed=3)
    owners = {
        next(d.parts[0].text for d in generator.scene(i).decals if d.class_name == "text")
        for i in range(150)
    }
    assert set("".join(owner[:3] for owner in owners)) == set("ABCDEFGHIJKLMNOPQRSTUVWXYZ")


def test_given_owner_codes_are_the_only_ones():
    rng = np.random.default_rng(0)
    codes = {sample_identifier(rng, ("ABCU", "XYZJ"), "22G1").owner for _ in range(60)}
    assert codes == {"ABCU", "XYZJ"}
    values = {"markings": {"identifiers": {"owner_codes": ["QQQU"]}}}
    generator = Generator(Config.from_values(values), seed=1)
    assert {d.parts[0].text for d in identifiers([generator.scene(0)])} == {"QQQU"}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"owner_codes": ["ABC"]}, "owner_codes.*'ABC' is not an owner code"),
        ({"layouts": {"door": {"rows": 0}}}, "layouts.door: all weights are 0"),
        ({"layouts": {"door": {"spiral": 1}}}, "'spiral' is unknown"),
        ({"layouts": {"floor": {"rows": 1}}}, "'floor' is unknown"),
    ],
)
def test_wrong_settings_are_named(values, message):
    with pytest.raises(ConfigError, match=message):
        Config.from_values({"markings": {"identifiers": values}})


def test_layouts_follow_their_weights():
    only = {face: {"block": 1.0} for face in ("front", "back", "no_door")}
    generator = Generator(Config.from_values({"markings": {"identifiers": {"layouts": only}}}))
    kinds = Counter(
        len(d.lines)
        for i in range(20)
        for d in generator.scene(i).decals
        if d.class_name == "text" and d.face in only
    )
    assert kinds[3] > 0.9 * kinds.total()


def test_parts_in_the_image_enclose_the_ink_and_nothing_else(generators):
    """Without ink in a part, pixels change within its quadrilateral and hardly outside it."""
    plain = {"damage": {"probability": 0}, "spreader": {"probability": 0}}
    generator = generators(Config.from_values(plain), seed=5, size=(640, 640), quality="draft")
    checked = 0
    for index in range(4):
        scene = generator.scene(index)
        whole = generator.render(scene=scene, camera="Cr", layer="decals")
        for thing in (o for o in whole.objects if o.parts and o.bbox and not o.truncated):
            row = thing.id - 2
            decal = [d for d in scene.decals if d.class_name][row]
            for number, part in enumerate(thing.parts):
                kept = [p for i, p in enumerate(decal.parts) if i != number]
                lines = tuple(p.text for p in kept)
                less = replace(decal, parts=tuple(kept), lines=lines)
                if max(box.x1 for box in boxes(less)) < decal.size_mm[0] - 0.06:
                    continue  # the rest would move to the middle
                if max(box.y1 for box in boxes(less)) < decal.size_mm[1] - 0.06:
                    continue
                decals = tuple(less if d is decal else d for d in scene.decals)
                other = generator.render(
                    scene=replace(scene, decals=decals), camera="Cr", layer="decals"
                )
                change = np.abs(whole.image.astype(int) - other.image.astype(int)).max(axis=2)
                inside = np.zeros(change.shape, np.uint8)
                quad = np.rint(np.array(part.quad).reshape(4, 2) * 16 - 8).astype(np.int32)
                cv2.fillConvexPoly(inside, quad, 1, shift=4)
                grown = cv2.dilate(inside, np.ones((5, 5), np.uint8)).astype(bool)
                assert (change > 24).sum() > 5, (index, part)
                assert not (change > 24)[~grown].any(), (index, part)
                checked += 1
    assert checked >= 6


def test_part_crops_are_upright_and_contain_the_letters(generators):
    plain = {"damage": {"probability": 0}, "spreader": {"probability": 0}}
    generator = generators(Config.from_values(plain), seed=5, size=(640, 640), quality="draft")
    crops = 0
    for index in range(4):
        sample = generator.render(index, camera="Cr")
        for thing, _ in text_crops(sample, 6.0):
            for part in thing.parts:
                crop = part_crop(sample.image, part)
                corners = np.array(part.quad).reshape(4, 2)
                width = np.linalg.norm(corners[1] - corners[0])
                height = np.linalg.norm(corners[3] - corners[0])
                assert crop.shape[1] == pytest.approx(width + 6, abs=3)
                assert crop.shape[0] == pytest.approx(height + 6, abs=3)
                crops += 1
    assert crops >= 4


def test_parts_must_read_as_the_lines(scenes):
    scene = scenes[0]
    number = next(i for i, d in enumerate(scene.decals) if d.class_name == "text")
    for lines in (("WRONG",), ()):
        wrong = replace(scene.decals[number], lines=lines)
        decals = (*scene.decals[:number], wrong, *scene.decals[number + 1 :])
        with pytest.raises(ConfigError, match=rf"decals\[{number}\]\.(parts|lines)"):
            check_scene(replace(scene, decals=decals))
