"""Choice of text crops, compared with labels of each letter as a separate decal."""

from dataclasses import replace

import numpy as np

from fastgen.decals.glyphs import glyph_tiles
from fastgen.decals.lettering import layout
from fastgen.labels.crops import text_crops


def letters_of(decal):
    """Yield decals of one letter each with the same ink as `decal`."""
    font = glyph_tiles()[1][decal.font]
    whole = decal.lettering
    assert decal.rotation_deg == 0
    for glyph in whole.glyphs:
        alone = layout((glyph.char,), font, decal.cap_mm)
        # the offset between tile and ink does not depend on the letter's place
        (tile,) = alone.glyphs
        low = np.subtract((glyph.x0, glyph.y0), (tile.x0, tile.y0))
        center = low + np.array(alone.size_mm) / 2 - np.array(whole.size_mm) / 2
        yield replace(
            decal,
            lines=(glyph.char,),
            parts=(),
            vertical=False,
            size_mm=alone.size_mm,
            center_mm=tuple((np.array(decal.center_mm) + center).tolist()),
        )


def test_no_letter_of_a_crop_is_mostly_hidden(generators):
    """Identifiers that are moved along the door disappear in part behind locking bars."""
    kept = hidden = 0
    generator = generators(seed=21, size=(1024, 1024), quality="draft")
    for index in (2, 19):
        scene = generator.scene(index)
        (decal,) = (d for d in scene.decals if d.face == "door" and d.class_name == "text")
        for shift_mm in (0.0, -60.0, -90.0, -130.0):
            x, y = decal.center_mm
            moved = replace(decal, center_mm=(x + shift_mm, y))
            sample = generator.render(scene=replace(scene, decals=(moved,)), camera="Cr")
            (item,) = (t for t in sample.objects if t.text)
            if item.truncated or item.visible_fraction <= 0.85:
                continue
            letters = generator.render(
                scene=replace(scene, decals=tuple(letters_of(moved))), camera="Cr"
            )
            least = min(t.visible_fraction for t in letters.objects if t.text)
            if any(True for _ in text_crops(sample, 10.0)):
                # a column of pixels is a fifth of a narrow letter
                assert least > 0.3
                kept += 1
            else:
                assert least < 0.7
                hidden += 1
    assert kept >= 2
    assert hidden >= 2


def test_a_text_hidden_by_more_than_a_seventh_is_not_cropped(generators):
    generator = generators(seed=21, size=(640, 640), quality="draft")
    sample = generator.render(index=3, camera="Cl")
    whole = {item.id for item, _ in text_crops(sample, 10.0)}
    assert whole
    for fraction, kept in ((0.95, True), (0.8, False)):
        seen = tuple(replace(item, visible_fraction=fraction) for item in sample.objects)
        crops = {item.id for item, _ in text_crops(replace(sample, objects=seen), 10.0)}
        assert crops == (whole if kept else set())
