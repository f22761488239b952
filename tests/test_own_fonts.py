"""Fonts of a user's configuration, from the font file to the picture."""

import base64
import json
from dataclasses import replace
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
import pytest
from fontTools.subset import Options, Subsetter
from fontTools.ttLib import TTFont
from PIL import Image, ImageDraw, ImageFont

from fastgen import Config, Generator
from fastgen.cli.main import main
from fastgen.decals.glyphs import CHARACTERS
from fastgen.decals.own_fonts import PREFIX, forms_of, own_font, read_font
from fastgen.errors import ConfigError
from fastgen.resources import asset_path

pytestmark = pytest.mark.usefixtures("no_workers")

FOREIGN = Path(mpl.get_data_path(), "fonts/ttf/DejaVuSansMono-Bold.ttf")
WIDE = FOREIGN.with_name("DejaVuSans.ttf")
SETTINGS = {"size": (192, 192), "quality": "draft"}


def with_font(path, more=None):
    """Return a configuration whose only font is that in a file."""
    markings = {"own_fonts": {"dock": str(path)}, "fonts": ["dock"], **(more or {})}
    return Config.from_values({"markings": markings, "damage": {"probability": 0}})


def fonts_of(scene):
    """Return the fonts of labelled texts, which are condensed on doors.

    Numbers of orange panels have a font of their own.
    """
    texts = (decal for decal in scene.decals if decal.class_name == "text")
    return {decal.font.removesuffix("-condensed") for decal in texts}


def test_tiles_agree_with_the_font_drawn_at_another_size():
    made = own_font("dock", read_font(FOREIGN))
    cap_px = 200.0
    probe = ImageFont.truetype(str(FOREIGN), 1000)
    drawn = ImageFont.truetype(
        str(FOREIGN), round(1000 * cap_px / -probe.getbbox("H", anchor="ls")[1])
    )
    side = round(1.6 * cap_px)
    for char in "AWQ017&":
        glyph = made.font.glyphs[char]
        assert glyph.advance * cap_px == pytest.approx(drawn.getlength(char), abs=1)
        image = Image.new("L", (side, side))
        pen = side / 2 - (glyph.ink_left + glyph.ink_right) / 2 * cap_px
        ImageDraw.Draw(image).text(
            (pen, side - 0.3 * cap_px), char, fill=255, font=drawn, anchor="ls"
        )
        ink = np.asarray(image) > 127
        field = cv2.resize(made.tiles[glyph.tile], (side, side), interpolation=cv2.INTER_LINEAR)
        kernel = np.ones((9, 9))
        bold, thin = (op(ink.astype(np.uint8), kernel) for op in (cv2.dilate, cv2.erode))
        assert not ((ink != (field > 127)) & (bold == thin)).any(), char


def test_a_copy_of_a_font_of_fastgen_draws_the_same_picture(generators):
    path = asset_path("fonts", "oswald.woff")
    theirs = Config.from_values({"markings": {"fonts": ["oswald"]}, "damage": {"probability": 0}})
    ours = with_font(path)
    one, other = (generators(config, seed=3, **SETTINGS) for config in (theirs, ours))
    scene = one.scene(2)
    (name,) = fonts_of(other.scene(2))
    renamed = replace(
        scene,
        decals=tuple(
            replace(each, font=name) if each.kind == "text" else each for each in scene.decals
        ),
    )
    expected = one.render(scene=scene, camera="A")
    found = other.render(scene=renamed, camera="A")
    assert np.array_equal(found.ids, expected.ids)
    assert np.abs(found.image.astype(int) - expected.image).max() <= 2
    assert [o.text for o in found.objects] == [o.text for o in expected.objects]


def test_fonts_are_drawn_beside_those_of_fastgen_unless_they_are_chosen(generators):
    chosen = generators(with_font(FOREIGN), seed=1, **SETTINGS)
    beside = generators(with_font(FOREIGN, {"fonts": []}), seed=1, **SETTINGS)
    (name,) = set().union(*(fonts_of(chosen.scene(i)) for i in range(8)))
    assert name.startswith("dock-")
    drawn = set().union(*(fonts_of(beside.scene(i)) for i in range(40)))
    assert name in drawn
    assert "oswald" in drawn


def test_two_fonts_of_one_name_stay_apart(generators):
    other = Path(mpl.get_data_path(), "fonts/ttf/DejaVuSerif.ttf")
    one, two = (generators(with_font(path), seed=1, **SETTINGS) for path in (FOREIGN, other))
    assert fonts_of(one.scene(0)).isdisjoint(fonts_of(two.scene(0)))
    first, second = (each.render(index=0, camera="A").image.astype(int) for each in (one, two))
    assert (np.abs(first - second).max(axis=-1) > 20).sum() > 10
    with pytest.raises(ConfigError, match=r"decals\[\d+\]\.font: 'dock-"):
        two.render(scene=one.scene(0), camera="A")


def test_a_dataset_is_continued_and_its_workers_draw_without_the_font_file(tmp_path):
    font = tmp_path / "port" / "dock.ttf"
    font.parent.mkdir()
    font.write_bytes(FOREIGN.read_bytes())
    config = font.with_name("port.yaml")
    config.write_text("markings: {own_fonts: {dock: dock.ttf}, fonts: [dock]}\n")
    out = tmp_path / "out"
    arguments = ["--size", "96x96", "--quality", "draft", "--config", str(config)]
    assert main(["generate", str(out), "--images", "4", *arguments, "--workers", "2"]) == 0
    record = json.loads((out / "dataset.json").read_text())
    kept = Config.from_values(record["config"])
    font.unlink()
    (picture,) = (out / "images").rglob("*000000_A.*")
    picture.unlink()
    assert main(["verify", str(out), "--repair"]) == 0
    assert picture.exists()
    with Generator(kept, record["seed"], **SETTINGS) as generator:
        assert fonts_of(generator.scene(0)) == {
            own_font("dock", kept.markings.own_fonts["dock"]).font.name
        }


def edited(path, edit):
    """Write a font after a change of it."""
    font = TTFont(FOREIGN)
    edit(font)
    font.save(path)
    return path


def without_q(font):
    subsetter = Subsetter(Options())
    subsetter.populate(text="".join(char for char in CHARACTERS if char not in "Q+"))
    subsetter.subset(font)


def with_wide_w(font):
    glyph = font["glyf"][font.getBestCmap()[ord("W")]]
    glyph.coordinates.scale((3.0, 1.0))


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (without_q, r"lacks Q\+; give a font with A to Z"),
        (with_wide_w, "W reach beyond 1.6 cap heights across.*give a narrower font"),
    ],
)
def test_a_font_that_cannot_write_every_text_is_refused(tmp_path, edit, words):
    with pytest.raises(ConfigError, match=rf"dock\.ttf: {words}"):
        with_font(edited(tmp_path / "dock.ttf", edit))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, r"cannot be read \(No such file or directory\)"),
        (b"", "not a font; give a TTF, OTF or WOFF file"),
        (b"\0\1\0\0" + b"junk" * 100, "not a font; give a TTF, OTF or WOFF file"),
    ],
)
def test_a_file_that_is_no_font_is_named(tmp_path, content, words):
    path = tmp_path / "dock.ttf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError, match=rf"markings\.own_fonts\.dock: .*dock\.ttf: {words}"):
        with_font(path)


def changed_header(change):
    """Return the text of a font whose metrics were changed."""
    data = base64.b64decode(read_font(FOREIGN).removeprefix(PREFIX))
    header, _, image = data.partition(b"\n")
    metrics = json.loads(header)
    change(metrics)
    return PREFIX + base64.b64encode(json.dumps(metrics).encode() + b"\n" + image).decode()


@pytest.mark.parametrize(
    "text",
    [
        PREFIX,
        PREFIX + "!!",
        PREFIX + base64.b64encode(b"[1, 2]\n").decode(),
        PREFIX + base64.b64encode(b"[" * 100000).decode(),
        changed_header(lambda metrics: metrics.pop("A")),
        changed_header(lambda metrics: metrics.update(A=[0, 1])),
        changed_header(lambda metrics: metrics.update(A=[0, 1, float("nan")])),
        changed_header(lambda metrics: metrics.update(A="000")),
        read_font(FOREIGN)[:-4000],
    ],
    ids=range(9),
)
def test_a_damaged_text_of_a_font_is_refused(text):
    with pytest.raises(ConfigError, match="is not a font that fastgen wrote; give a path"):
        Config.from_values({"markings": {"own_fonts": {"dock": text}}})


def test_names_of_fonts_are_checked():
    with pytest.raises(ConfigError, match=r"markings\.fonts: 'dokc'.*did you mean dock"):
        with_font(FOREIGN, {"fonts": ["dokc"]})
    with pytest.raises(ConfigError, match=r"own_fonts\.oswald: is a font of fastgen; rename yours"):
        Config.from_values({"markings": {"own_fonts": {"oswald": str(FOREIGN)}}})
    text = read_font(FOREIGN)
    with pytest.raises(ConfigError, match=r"own_fonts: .*at most 5"):
        Config.from_values({"markings": {"own_fonts": {f"f{i}": text for i in range(6)}}})


def test_identifiers_and_weights_fit_doors_in_a_wide_font(generators):
    """Doors have little room between their bars; ISO 6346 prefers identifiers in rows."""
    generator = generators(with_font(WIDE), seed=1, **SETTINGS)
    in_rows = weights = 0
    for index in range(20):
        texts = [d for d in generator.scene(index).decals if d.kind == "text" and d.face == "door"]
        (identifier, *_) = (each for each in texts if each.class_name == "text")
        in_rows += not identifier.vertical
        weights += any("MAX" in each.text for each in texts)
    assert in_rows >= 18
    assert weights >= 15


def test_a_condensed_form_keeps_heights_and_narrows_letters():
    own = own_font("dock", read_font(WIDE))
    same, narrow = forms_of(own)
    assert same is own
    for char in "H80M":
        before, after = own.font.glyphs[char], narrow.font.glyphs[char]
        share = after.advance / before.advance
        assert 0.5 < share < 0.8
        ink, less = (font.tiles[before.tile] > 127 for font in (own, narrow))
        assert (ink.any(axis=1) == less.any(axis=1)).all()
        assert less.any(axis=0).sum() == pytest.approx(share * ink.any(axis=0).sum(), abs=2)
        assert less.sum() == pytest.approx(share * ink.sum(), rel=0.08)
    slim = own_font("slim", read_font(asset_path("fonts", "antonio.woff")))
    assert forms_of(slim) == (slim,)
