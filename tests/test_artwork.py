"""Artwork: marker geometry and colours, and distance fields against a fresh rasterization."""

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from fastgen.classes import MARKER_CLASSES
from fastgen.decals.artwork import (
    ART_SIZE,
    art_images,
    art_layers,
    brands,
    glyph_tiles,
    mip_levels,
    stickers,
)
from fastgen.render.gl import open_context
from fastgen.render.textures import levelled_texture
from fastgen.resources import asset_path

RED, GREEN, BLUE, ORANGE = (210, 32, 46), (0, 131, 63), (0, 87, 168), (240, 125, 26)
YELLOW, WHITE, BLACK = (246, 201, 0), (255, 255, 255), (16, 16, 16)

FIELDS = {
    # class: colour at a blank spot of the upper half and of the lower half
    "C1.1": (ORANGE, ORANGE),
    "C2.1": (RED, RED),
    "C2.3": (GREEN, GREEN),
    "C2.5": (WHITE, WHITE),
    "C3.2": (RED, RED),
    "C4.2": (WHITE, RED),
    "C4.3": (BLUE, BLUE),
    "C5.1": (YELLOW, YELLOW),
    "C5.2": (RED, YELLOW),
    "C6.1": (WHITE, WHITE),
    "C7.1": (WHITE, WHITE),
    "C7.2": (YELLOW, WHITE),
    "C7.4": (YELLOW, WHITE),
    "C8.1": (WHITE, BLACK),
}


def test_all_markers_come_first_and_in_class_order():
    images, layers = art_images(), art_layers()
    assert images.shape[1:] == (ART_SIZE, ART_SIZE, 4)
    assert [layers[name] for name in MARKER_CLASSES] == list(range(26))


@pytest.mark.parametrize("name", MARKER_CLASSES)
def test_a_marker_fills_the_diamond_exactly(name):
    images, layers = art_images(), art_layers()
    alpha = images[layers[name], ..., 3] / 255
    at = (np.arange(ART_SIZE) + 0.5) / ART_SIZE - 0.5
    inside = 0.5 - np.abs(at)[None] - np.abs(at)[:, None]
    margin = 1.5 / ART_SIZE
    assert (alpha[inside > margin] == 1).all()
    assert (alpha[inside < -margin] == 0).all()


@pytest.mark.parametrize("name", FIELDS)
def test_fields_have_their_regulation_colours(name):
    images, layers = art_images(), art_layers()
    image = images[layers[name]].astype(int)
    upper, lower = image[int(0.44 * 512), int(0.15 * 512)], image[int(0.56 * 512), int(0.14 * 512)]
    assert np.abs(upper[:3] - FIELDS[name][0]).max() <= 12
    assert np.abs(lower[:3] - FIELDS[name][1]).max() <= 12


def test_markers_are_visibly_different_at_48_px():
    images = art_images()
    small = np.stack(
        [cv2.resize(i[..., :3], (48, 48), interpolation=cv2.INTER_AREA) for i in images[:26]]
    ).astype(float)
    for i in range(26):
        for j in range(i):
            most = np.abs(small[i] - small[j]).max(axis=-1)
            # yellow II and yellow III differ only in one bar
            pair = {MARKER_CLASSES[i], MARKER_CLASSES[j]}
            least = 5 if pair == {"C7.2", "C7.4"} else 12
            assert (most > 40).sum() >= least, pair


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


def test_the_gpu_samples_the_computed_mip_levels():
    rng = np.random.default_rng(4)
    images = rng.integers(0, 256, (3, 8, 8, 4), np.uint8)
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
    levels = zip(*map(mip_levels, images), strict=True)
    with open_context() as gl:
        levelled_texture(gl, [images, *map(np.stack, levels)]).use(0)
        found = gl.ctx.buffer(reserve=4 * 16)
        found.bind_to_storage_buffer(0)
        gl.ctx.compute_shader(code).run(4)
        corners = np.frombuffer(found.read(), np.float32).reshape(4, 4) * 255
    wanted = [images[2], *mip_levels(images[2])]
    assert np.abs(corners - [level[0, 0] for level in wanted]).max() < 0.5
