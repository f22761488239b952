"""Artwork: marker geometry and colours, and distance fields against a fresh rasterization."""

import colorsys
import json
from collections import defaultdict
from ctypes import POINTER, c_int, c_uint, c_void_p

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from fastgen.classes import MARKER_CLASSES
from fastgen.decals.artwork import (
    ART_SIZE,
    art_images,
    art_layers,
    art_levels,
    brands,
    marker_prints,
    mip_levels,
    premultiplied,
    stickers,
)
from fastgen.decals.glyphs import GLYPH_MOST_INK, glyph_coverage, glyph_sums, glyph_tiles
from fastgen.render.art_textures import ArtTextures
from fastgen.render.gl import open_context
from fastgen.render.gl_enums import GL_RGBA, GL_TEXTURE_2D_ARRAY, GL_UNSIGNED_BYTE
from fastgen.render.textures import levelled_texture
from fastgen.resources import asset_path
from fastgen.srgb import encoded, linear

GL_TEXTURE_DEPTH = 0x8071

HUES = {"red": 357, "orange": 25, "yellow": 48, "green": 156, "blue": 221}
"""Mean hue of each field colour in degrees; all its inks lie within HUE_RANGE."""

HUE_RANGE = 25

FIELDS = {
    # class: colour at a blank spot of the upper half and of the lower half
    **dict.fromkeys(("C1.1", "C1.2", "C1.3", "C1.4"), ("orange", "orange")),
    **dict.fromkeys(("C2.1", "C2.2", "C3.1", "C3.2"), ("red", "red")),
    **dict.fromkeys(("C2.3", "C2.4"), ("green", "green")),
    **dict.fromkeys(("C2.5", "C6.1", "C6.2", "C7.1", "C7.3", "C9.1"), ("white", "white")),
    **dict.fromkeys(("C4.3", "C4.4"), ("blue", "blue")),
    **dict.fromkeys(("C5.2", "C5.3"), ("red", "yellow")),
    **dict.fromkeys(("C7.2", "C7.4"), ("yellow", "white")),
    "C4.2": ("white", "red"),
    "C5.1": ("yellow", "yellow"),
    "C8.1": ("white", "black"),
}
"""Fields by class. C4.1 has stripes instead of fields."""

WHITE_DIGITS = ("C2.2", "C2.4", "C3.2", "C4.4", "C8.1")

IMAGES = art_images()

PRINTS = [(name, art) for name, prints in marker_prints().items() for art in prints]


def test_all_markers_come_first_and_in_class_order():
    images, layers = IMAGES, art_layers()
    assert images.shape[1:] == (ART_SIZE, ART_SIZE, 4)
    assert [layers[art] for _, art in PRINTS] == list(range(len(PRINTS)))
    assert tuple(marker_prints()) == MARKER_CLASSES


def test_every_class_has_several_prints_and_the_first_has_its_name():
    for name, prints in marker_prints().items():
        assert len(prints) >= 4
        assert prints[0] == name
        assert len(set(prints)) == len(prints)


@pytest.mark.parametrize("art", [art for _, art in PRINTS])
def test_a_marker_fills_the_diamond_exactly(art):
    images, layers = IMAGES, art_layers()
    alpha = images[layers[art], ..., 3] / 255
    at = (np.arange(ART_SIZE) + 0.5) / ART_SIZE - 0.5
    inside = 0.5 - np.abs(at)[None] - np.abs(at)[:, None]
    margin = 1.5 / ART_SIZE
    assert (alpha[inside > margin] == 1).all()
    assert (alpha[inside < -margin] == 0).all()


@pytest.mark.parametrize(("name", "art"), PRINTS)
def test_fields_have_their_regulation_colours(name, art):
    if name == "C4.1":
        return
    image = IMAGES[art_layers()[art]].astype(int)
    upper = image[int(0.42 * ART_SIZE), int(0.17 * ART_SIZE), :3]
    lower = image[int(0.58 * ART_SIZE), int(0.17 * ART_SIZE), :3]
    for spot, wanted in zip((upper, lower), FIELDS[name], strict=True):
        chroma = spot.max() - spot.min()
        if wanted == "white":
            assert spot.min() > 215
            assert chroma < 25
        elif wanted == "black":
            assert spot.max() < 40
        else:
            hue = 360 * colorsys.rgb_to_hsv(*(spot / 255))[0]
            assert abs((hue - HUES[wanted] + 180) % 360 - 180) < HUE_RANGE
            assert chroma > 60


def test_prints_are_visibly_different_at_48_px():
    images = IMAGES
    small = np.stack(
        [
            cv2.resize(i[..., :3], (48, 48), interpolation=cv2.INTER_AREA)
            for i in images[: len(PRINTS)]
        ]
    ).astype(float)
    for i in range(len(PRINTS)):
        most = np.abs(small[:i] - small[i]).max(axis=-1)
        assert ((most > 40).sum(axis=(1, 2)) >= 8).all(), PRINTS[i]


def digit_size_px(name, art, side_px):
    """Return height and stroke width of the class digit on a marker that is `side_px` wide."""
    image = IMAGES[art_layers()[art]].astype(int)
    at = (np.arange(ART_SIZE) + 0.5) / ART_SIZE - 0.5
    within = np.abs(at)[None] + at[:, None] < 0.5 - 0.09
    within &= (np.abs(at) < 0.14)[None] & (at > 0.16)[:, None]
    rgb = image[..., :3]
    ink = (rgb.min(axis=-1) > 200) if name in WHITE_DIGITS else (rgb.max(axis=-1) < 70)
    ink &= within
    rows = np.flatnonzero(ink.any(axis=1))
    # The digit is the lowest connected run of rows; letters and small print lie above it.
    breaks = np.flatnonzero(np.diff(rows) > 1)
    rows = rows[breaks[-1] + 1 :] if len(breaks) else rows
    if name == "C9.1":  # The lowest run is the line below the digit.
        rows = np.flatnonzero(ink.any(axis=1))
        rows = rows[breaks[-2] + 1 : breaks[-1] + 1] if len(breaks) > 1 else rows[: breaks[-1] + 1]
    inked = ink[rows].astype(np.uint8)
    stroke = 2 * cv2.distanceTransform(np.pad(inked, 1), cv2.DIST_L2, 5).max()
    return len(rows) * side_px / ART_SIZE, stroke * side_px / ART_SIZE


@pytest.mark.parametrize("name", MARKER_CLASSES)
def test_most_prints_have_a_digit_that_is_legible_on_a_marker_20_px_wide(name):
    sizes = np.array([digit_size_px(name, art, 20) for art in marker_prints()[name]])
    # Half a pixel of ink in a stroke, and five rows of half a pixel in a digit
    legible = (sizes[:, 0] > 2.4) & (sizes[:, 1] > 0.5)
    assert legible.sum() >= 3, sizes


@pytest.mark.parametrize(("name", "art"), PRINTS)
def test_the_digit_contrasts_with_its_field_at_20_px(name, art):
    image = IMAGES[art_layers()[art]]
    small = cv2.resize(image[..., :3], (20, 20), interpolation=cv2.INTER_AREA).astype(int)
    corner = small[13:18, 8:12].mean(axis=-1)
    assert np.ptp(corner) > 18


def test_wordings_do_not_tell_the_class():
    index = json.loads(asset_path("markers", "index.json").read_text(encoding="utf-8"))
    classes = defaultdict(set)
    for name, prints in marker_prints().items():
        wordings = [index[art]["wording"] for art in prints]
        assert len(set(wordings)) == len(wordings)
        for wording in wordings:
            classes[wording].add(name)
    assert len(classes) >= 6
    assert all(len(names) >= len(MARKER_CLASSES) / 2 for names in classes.values()), classes


@pytest.mark.parametrize(
    "pair", [("C2.1", "C3.1"), ("C2.2", "C3.2"), ("C2.5", "C6.1"), ("C7.2", "C7.4")]
)
def test_classes_with_equal_fields_have_the_same_prints_above_the_words(pair):
    """Otherwise a rim, a line or an ink would tell a class from one that looks like it."""
    first, second = (marker_prints()[name] for name in pair)
    layers, top = art_layers(), int(0.3 * ART_SIZE)
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(*(IMAGES[layers[art], :top] for art in (one, other)))


def test_prints_with_a_un_number_have_a_white_band_with_dark_digits():
    index = json.loads(asset_path("markers", "index.json").read_text(encoding="utf-8"))
    images, layers = IMAGES, art_layers()
    numbered = [art for art, about in index.items() if about["wording"] == "un"]
    for art in numbered:
        band = images[layers[art], int(0.45 * ART_SIZE) : int(0.55 * ART_SIZE), ..., :3]
        middle = band[:, int(0.22 * ART_SIZE) : int(0.78 * ART_SIZE)].astype(int)
        assert (middle.min(axis=-1) > 200).mean() > 0.4
        assert 0.08 < (middle.max(axis=-1) < 70).mean() < 0.5


def test_distance_tiles_agree_with_the_font_drawn_at_another_size():
    tiles, fonts = glyph_tiles()
    for name, font in fonts.items():
        cap_px = 200.0
        probe = ImageFont.truetype(str(asset_path("fonts", f"{name}.woff")), 1000)
        scale = cap_px / -probe.getbbox("H", anchor="ls")[1]
        drawn = ImageFont.truetype(str(asset_path("fonts", f"{name}.woff")), round(1000 * scale))
        side = round(1.6 * cap_px)
        for char in "AHQ017":
            glyph = font.glyphs[char]
            image = Image.new("L", (side, side))
            pen = side / 2 - (glyph.ink_left + glyph.ink_right) / 2 * cap_px
            ImageDraw.Draw(image).text(
                (pen, side - 0.3 * cap_px), char, fill=255, font=drawn, anchor="ls"
            )
            ink = np.asarray(image) > 127
            field = cv2.resize(tiles[glyph.tile], (side, side), interpolation=cv2.INTER_LINEAR)
            differs = ink != (field > 127)
            near = cv2.dilate(ink.astype(np.uint8), np.ones((9, 9))) != cv2.erode(
                ink.astype(np.uint8), np.ones((9, 9))
            )
            assert not (differs & ~near).any(), (name, char)


def test_every_font_ships_its_licence():
    for name in glyph_tiles()[1]:
        text = asset_path("fonts", f"{name}.OFL.txt").read_text(encoding="utf-8")
        assert "SIL OPEN FONT LICENSE" in text.upper()


def test_stickers_and_emblems_have_art():
    layers = art_layers()
    assert all(name in layers for name in stickers())
    assert all(brand.emblem in layers for brand in brands())


def mean_light(block):
    """Return sRGB and alpha, 0 to 255, of texels [..., 4] averaged as linear light."""
    texels = block.reshape(-1, 4) / 255.0
    light = [
        [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in t[:3]] for t in texels
    ]
    alpha = texels[:, 3]
    mean = (np.array(light) * alpha[:, None]).sum(axis=0) / max(alpha.sum(), 1e-9)
    code = np.where(mean <= 0.0031308, 12.92 * mean, 1.055 * mean ** (1 / 2.4) - 0.055)
    return np.append(255 * code, 255 * alpha.mean())


def test_mip_levels_average_linear_light_and_not_srgb_codes():
    rng = np.random.default_rng(3)
    image = rng.integers(0, 256, (16, 16, 4), np.uint8)
    image[:4, :4, :3], image[:4, :2, 3], image[:4, 2:4, 3] = 200, 255, 0
    image[:4, 2:4, :3] = 0  # transparent, so its black does not count
    levels = mip_levels(image)
    assert [len(level) for level in levels] == [8, 4, 2, 1]
    for step, level in zip((2, 4, 8, 16), levels, strict=True):
        for y, x in np.ndindex(level.shape[:2]):
            block = image[y * step : (y + 1) * step, x * step : (x + 1) * step]
            assert np.abs(level[y, x] - mean_light(block)).max() <= 1.0
    assert (levels[1][0, 0, :3] == 200).all()


@pytest.mark.parametrize("srgb", [False, True])
def test_the_gpu_samples_the_given_mip_levels(srgb):
    rng = np.random.default_rng(4)
    levels = [rng.integers(0, 256, (3, side, side, 4), np.uint8) for side in (8, 4, 2, 1)]
    code = """
    #version 430
    layout(local_size_x = 1) in;
    layout(binding = 0) uniform sampler2DArray art;
    layout(std430, binding = 0) buffer Found { vec4 found[]; };
    void main() {
        uint level = gl_WorkGroupID.x;
        vec2 corner = vec2(0.5 / float(8 >> level));
        found[level] = textureLod(art, vec3(corner, 2.0), float(level));
    }
    """
    with open_context() as gl:
        levelled_texture(gl, levels, srgb).use(0)
        found = gl.ctx.buffer(reserve=4 * 16)
        found.bind_to_storage_buffer(0)
        gl.ctx.compute_shader(code).run(4)
        corners = np.frombuffer(found.read(), np.float32).reshape(4, 4).copy()
    if srgb:  # shaders read linear light
        corners[:, :3] = encoded(corners[:, :3])
    wanted = [level[2, 0, 0] for level in levels]
    assert np.abs(255 * corners - wanted).max() < 0.5


def test_premultiplied_codes_are_those_of_light_times_alpha():
    straight = np.array([[255, 128, 0, 128], [200, 10, 90, 255], [255, 255, 255, 0]], np.uint8)
    light = np.vectorize(linear)(straight[:, :3] / 255) * straight[:, 3:] / 255
    found = premultiplied(straight)
    np.testing.assert_array_equal(found[:, 3], straight[:, 3])
    np.testing.assert_allclose(found[:, :3], 255 * encoded(light), atol=0.6)


def test_glyph_sums_give_the_ink_of_any_rectangle_of_a_tile():
    tiles, _ = glyph_tiles()
    ink = glyph_coverage() / 255
    # a texel half way inside an outline is half full of ink
    distance = tiles.astype(int) - 127.5
    assert ink[distance > 40].min() == 1
    assert ink[distance < -40].max() == 0
    assert ink[np.abs(distance) < 1].mean() == pytest.approx(0.5, abs=0.05)
    sums = glyph_sums() * (GLYPH_MOST_INK / 65535)
    assert ink.sum(axis=(1, 2)).max() < GLYPH_MOST_INK
    for top, bottom, left, right in ((0, 63, 0, 63), (10, 40, 20, 50), (31, 32, 15, 60)):
        found = sums[:, bottom, right] - sums[:, top, right] - sums[:, bottom, left]
        found += sums[:, top, left]
        wanted = ink[:, top + 1 : bottom + 1, left + 1 : right + 1].sum(axis=(1, 2))
        np.testing.assert_allclose(found, wanted, atol=2 * GLYPH_MOST_INK / 65535)


def stored_layers(gl, texture):
    """Read back the largest mip level of the artwork, uint8 [K, ART_SIZE, ART_SIZE, 4]."""
    size = gl.function("glGetTexLevelParameteriv", None, *(c_uint, c_int, c_uint), POINTER(c_int))
    read = gl.function("glGetTexImage", None, c_uint, c_int, c_uint, c_uint, c_void_p)
    texture.use()
    count = c_int()
    size(GL_TEXTURE_2D_ARRAY, 0, GL_TEXTURE_DEPTH, count)
    texels = np.empty((count.value, ART_SIZE, ART_SIZE, 4), np.uint8)
    read(GL_TEXTURE_2D_ARRAY, 0, GL_RGBA, GL_UNSIGNED_BYTE, texels.ctypes.data)
    return texels


def test_art_textures_hold_the_artwork_of_the_scenes_that_use_it():
    """Each layer is read back. A capacity of four grows when scenes use more at once."""
    bundled, rng = art_layers(), np.random.default_rng(6)
    own = rng.integers(0, 256, (ART_SIZE, ART_SIZE, 4), np.uint8)
    wanted = {name: art_levels()[0][layer] for name, layer in bundled.items()}
    wanted["own"] = premultiplied(own)
    with open_context() as gl:
        textures = ArtTextures(gl, {"own": own}, capacity=4)
        sizes, held = set(), []
        for count in (3, 2, 4, 1, 4, 9, 2, 3):
            names = {*rng.choice(list(bundled), count, replace=False).tolist(), "own", "", "none"}
            held.append(textures.take(names))
            assert held[-1].keys() == names - {"", "none"}
            if len(held) > 2:  # like the scenes that the renderer keeps
                textures.give_back(held.pop(0))
            texels = stored_layers(gl, textures.texture)
            sizes.add(len(texels))
            layers = {}
            for each in held:
                for name, layer in each.items():
                    np.testing.assert_array_equal(texels[layer], wanted[name])
                    assert layers.setdefault(layer, name) == name
        assert len(sizes) > 1
        textures.release()


def test_artwork_stays_until_each_scene_has_given_it_back():
    names = list(art_layers())
    with open_context() as gl:
        textures = ArtTextures(gl, {}, capacity=4)
        first, second = textures.take(names[:4]), textures.take(names[:4])
        textures.give_back(first)
        third = textures.take(names[4:5])
        texels = stored_layers(gl, textures.texture)
        for name, layer in {**second, **third}.items():
            np.testing.assert_array_equal(texels[layer], art_levels()[0][art_layers()[name]])
        assert len(texels) == 8
        for each in (second, third):
            textures.give_back(each)
        textures.take(names[5:13])
        assert len(stored_layers(gl, textures.texture)) == 8
        textures.release()
