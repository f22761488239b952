"""Choice of text crops, compared with labels of each letter as a separate decal."""

from dataclasses import replace

import numpy as np

from fastgen.decals.artwork import glyph_tiles
from fastgen.decals.lettering import layout
from fastgen.labels.crops import text_crops
from fastgen.labels.objects import decal_of


def letters_of(decal):
    """Yield decals of one letter each with the same ink as `decal`."""
    font = glyph_tiles()[1][decal.font]
    whole = layout(decal.lines, font, decal.cap_mm, decal.vertical)
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
            vertical=False,
            size_mm=alone.size_mm,
            center_mm=tuple((np.array(decal.center_mm) + center).tolist()),
        )


def test_no_letter_of_a_crop_is_mostly_hidden(generators):
    kept = hidden = 0
    generator = generators(seed=21, size=(640, 640), quality="draft")
    for index in (2, 19, 24, 5):
        sample = generator.render(index=index, camera="Cr")
        crops = {item.id for item, _ in text_crops(sample, 10.0)}
        texts = [t for t in sample.objects if t.text and t.visible_fraction > 0.85]
        for item in (t for t in texts if not t.truncated):
            decal = decal_of(sample.scene, item.id)
            if item.id not in crops and decal.face != "door":
                continue  # seen at a slant, too small
            scene = replace(sample.scene, decals=tuple(letters_of(decal)))
            letters = generator.render(scene=scene, camera="Cr").objects
            least = min(letter.visible_fraction for letter in letters if letter.text)
            if item.id in crops:
                assert least > 0.4
                kept += 1
            else:
                assert least < 0.6
                hidden += 1
    assert kept >= 1
    assert hidden >= 3


def test_a_text_hidden_by_more_than_a_seventh_is_not_cropped(generators):
    generator = generators(seed=21, size=(640, 640), quality="draft")
    sample = generator.render(index=3, camera="Cl")
    whole = {item.id for item, _ in text_crops(sample, 10.0)}
    assert whole
    for fraction, kept in ((0.95, True), (0.8, False)):
        seen = tuple(replace(item, visible_fraction=fraction) for item in sample.objects)
        crops = {item.id for item, _ in text_crops(replace(sample, objects=seen), 10.0)}
        assert crops == (whole if kept else set())
