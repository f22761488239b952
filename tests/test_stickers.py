"""Stickers: which containers and faces carry them, where, how often and in which colour."""

import math
from collections import Counter, defaultdict

import pytest

from fastgen.config.config import Config
from fastgen.decals.artwork import stickers
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.sampling.contents import sheet_sizes

COUNT = 250
FAMILIES = {
    "height": ("height_sign", "height_sign_standard", "height_triangle"),
    "width": ("width_sign",),
    "super heavy": ("super_heavy_30", "super_heavy_32"),
    "caution": ("caution_load", "caution_doors"),
    "seal": ("seal_ostvik", "seal_haldra", "seal_corvane"),
    "leasing": ("leasing_halvrik", "leasing_quorda", "leasing_boxmere"),
    "line": ("line_waves", "line_peak", "line_loop", "company_diamond"),
    "chalk": ("chalk_ring", "chalk_letters", "chalk_cross", "chalk_digits"),
    "customs": ("customs_seal_blue", "customs_seal_green"),
    "residue": ("poster_residue_1", "poster_residue_2", "placard_residue", "overpaint_1"),
}


@pytest.fixture(scope="module")
def scenes():
    config = Config.from_values({"markings": {"removed_markers": [0, 0]}})
    generator = Generator(config, seed=12)
    return [generator.scene(index) for index in range(COUNT)]


def decals(scenes):
    """Yield each sticker decal with its scene and its entry in the index."""
    for scene in scenes:
        for decal in scene.decals:
            if decal.art in stickers():
                yield scene, decal, stickers()[decal.art]


def test_all_look_alikes_of_markers_occur(scenes):
    drawn = {decal.art for _, decal, _ in decals(scenes)}
    for family, names in FAMILIES.items():
        assert drawn & set(names), family
    assert drawn == set(stickers())


def test_stickers_stay_on_their_faces_and_containers_and_have_no_label(scenes):
    for scene, decal, sticker in decals(scenes):
        assert decal.face in sticker.where
        assert not sticker.kinds or scene.container.kind in sticker.kinds
        assert decal.class_name == ""
        assert decal.size_mm == sticker.size_mm


def test_height_signs_give_the_height_of_their_container(scenes):
    metres = {"height_sign": 2.9, "height_triangle": 2.9, "height_sign_standard": 2.6}
    for scene, decal, _ in decals(scenes):
        if decal.art in metres:
            shape = SHAPES.container(scene.container.kind, scene.container.profiles)
            height_mm = shape.bounds_mm[1][2] - shape.bounds_mm[0][2]
            assert abs(height_mm / 1000 - metres[decal.art]) < 0.06


def test_stickers_with_a_place_stand_there(scenes):
    for scene, decal, sticker in decals(scenes):
        if sticker.place == (0.0, 1.0, 0.0, 1.0):
            continue
        mesh = SHAPES.container(scene.container.kind, scene.container.profiles)
        sizes = sheet_sizes(mesh)[decal.face]
        middle = [at / side for at, side in zip(decal.center_mm, sizes, strict=True)]
        right = sticker.place[0] > 0.5
        assert (middle[0] > 0.5) == right
        assert (middle[1] > 0.4) == right


def test_a_container_has_one_railway_number(scenes):
    found = defaultdict(set)
    for scene, decal, sticker in decals(scenes):
        if sticker.group == "ic":
            found[scene.index].add(decal.art)
    assert all(len(names) == 1 for names in found.values())
    assert len({name for names in found.values() for name in names}) == 5
    # each of two sides has the mark with probability 0.4, if there is room
    share = sum(1 for _ in found) / COUNT
    assert 0.5 < share < 0.64 + 4 * math.sqrt(0.64 * 0.36 / COUNT)


def test_painted_marks_have_the_color_of_lettering_or_of_darker_paint(scenes):
    for scene, decal, sticker in decals(scenes):
        if sticker.ink == "lettering":
            assert decal.albedo in {d.albedo for d in scene.decals if d.class_name == "text"}
        if sticker.ink == "overpaint":
            ratios = [a / b for a, b in zip(decal.albedo, scene.surface.paint.albedo, strict=True)]
            assert ratios == pytest.approx([0.6] * 3)
        assert decal.kind == ("sticker" if sticker.ink == "art" else "emblem")


def test_weights_decide_the_frequency_of_stickers(scenes):
    counts = Counter(decal.art for _, decal, _ in decals(scenes) if decal.face == "front")
    alike = [
        s
        for s in stickers().values()
        if "front" in s.where and not (s.always or s.share or s.kinds or s.group)
    ]
    # a large sticker finds no room more often, so only similar sizes are compared
    small = [s for s in alike if max(s.size_mm) <= 360]
    total = sum(counts[s.name] for s in small)
    weight = sum(s.weight for s in small)
    for sticker in small:
        expected = total * sticker.weight / weight
        assert abs(counts[sticker.name] - expected) < 4 * math.sqrt(expected) + 0.2 * expected
