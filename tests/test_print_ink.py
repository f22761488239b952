"""Light of small decals, compared with images that are sixteen times as large.

The ink of an image is the sum over its pixels of the linear light that decals add to it. A decal
must keep it wherever it lies relative to the pixel grid.
"""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.decals.glyphs import glyph_tiles
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Camera, Decal
from fastgen.scene.faces import FACE_AXES
from tests.plain import EVEN_PAINT, bare

CONFIG = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
SIDE, SCALE = 28, 16
DISTANCE_MM = 20000.0
QUALITIES = ("draft", "balanced", "fine")
TOLERANCE = 0.05
STRIPES_TOLERANCE = 0.07
"""The lookups of `fine` miss up to 6.5 % of striped prints of half a pixel."""
COLUMN_TOLERANCE = 0.1
"""A column of letters lies on one fold of the sheet, which moves its letters within a pixel."""


def text(cap_mm, lines, vertical=False):
    font = sorted(glyph_tiles()[1])[0]
    plain = Decal("text", "text", "front", (3000.0, 1300.0), (1.0, 1.0), lines=lines, font=font)
    sized = replace(plain, vertical=vertical, cap_mm=cap_mm)
    return replace(sized, size_mm=sized.lettering.size_mm)


def picture(kind, art, side_mm=280.0):
    return Decal(kind, "", "front", (3000.0, 1300.0), (side_mm, side_mm), art=art)


PRINTS = {
    "line": text(100.0, ("CSQU 305438",)),
    "lines": text(100.0, ("CSQU", "305438", "22G1")),
    "column": text(100.0, ("CSQU3054",), vertical=True),
    "marker": picture("marker", "C3.1"),
    "striped marker": picture("marker", "C4.1"),
    "sticker": picture("sticker", "no_walking"),
    "emblem": picture("emblem", "emblem_rings"),
    "triangle": picture("triangle", "elevated_temperature"),
    "patch": picture("sticker", "patch"),
}


def height_mm(decal):
    """Return the height of a text's capitals or of another decal."""
    return decal.cap_mm or decal.size_mm[1]


@pytest.fixture(scope="module")
def plain(generators):
    """A scene with one black container and nothing else."""
    scene = generators(CONFIG, seed=4, size=(64, 64), quality="draft").scene(0)
    paint = replace(scene.surface.paint, albedo=(0.01, 0.01, 0.01))
    return replace(bare(scene), surface=replace(scene.surface, paint=paint))


def watching(scene, decal, pixel_mm, shift, turn_deg=0.0):
    """Return a camera with pixels of `pixel_mm` whose centre is `shift` pixels off the decal's."""
    mesh = PreparedScene(scene).container
    (place,), _ = mesh.sheet_to_surface(decal.face, [decal.center_mm])
    axes = FACE_AXES[decal.face]
    out, right, up = (np.array(axis, float) for axis in (axes.out, axes.right, axes.up))
    turn = np.deg2rad(turn_deg)
    target = place + pixel_mm * (shift[0] * right + shift[1] * up)
    eye = target + DISTANCE_MM * (np.cos(turn) * out + np.sin(turn) * right)
    focal_mm = 36.0 * DISTANCE_MM / (pixel_mm * SIDE)
    return Camera("tele", tuple(eye.tolist()), tuple(target.tolist()), focal_mm)


def ink(generators, quality, plain, decals, camera, scale=1):
    """Return the ink of decals in an image, in pixels of full linear light."""
    generator = generators(CONFIG, seed=4, size=(64, 64), quality=quality)
    size = (SIDE * scale, SIDE * scale)
    with generator.gpu.drawing() as renderer:
        sums = [
            renderer.render(PreparedScene(s), camera, size, "decals", True).radiance.sum(
                dtype=np.float64
            )
            for s in (replace(plain, decals=decals), plain)
        ]
    return (sums[0] - sums[1]) / 3 / scale**2


@pytest.mark.parametrize("size_px", [0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("name", PRINTS)
def test_prints_keep_their_ink(name, size_px, plain, generators):
    decal = PRINTS[name]
    rng = np.random.default_rng(8)
    for _ in range(2):
        shift = rng.uniform(-0.5, 0.5, 2)
        camera = watching(plain, decal, height_mm(decal) / size_px, shift)
        wanted = ink(generators, "balanced", plain, (decal,), camera, SCALE)
        assert wanted > 0.02
        for quality in QUALITIES:
            found = ink(generators, quality, plain, (decal,), camera)
            most = COLUMN_TOLERANCE if name == "column" else TOLERANCE
            if (name, size_px, quality) == ("striped marker", 0.5, "fine"):
                most = STRIPES_TOLERANCE
            assert found == pytest.approx(wanted, rel=most), quality


@pytest.mark.parametrize("name", ["line", "marker", "sticker"])
def test_prints_seen_from_the_side_keep_their_ink_on_average(name, plain, generators):
    """Pixels as wide as the folds of the sheet see them at chance places, so tests need a mean."""
    decal = PRINTS[name]
    rng = np.random.default_rng(9)
    for quality in QUALITIES:
        found, wanted = 0.0, 0.0
        for _ in range(6):
            shift = rng.uniform(-0.5, 0.5, 2)
            camera = watching(plain, decal, height_mm(decal), shift, turn_deg=25.0)
            wanted += ink(generators, "balanced", plain, (decal,), camera, SCALE)
            found += ink(generators, quality, plain, (decal,), camera)
        assert found == pytest.approx(wanted, rel=0.08), quality


def test_a_crowd_of_small_prints_keeps_its_ink(plain, generators):
    """A pixel may show more decals than one cell of the usual grid lists."""
    marker = replace(PRINTS["marker"], size_mm=(150.0, 150.0))
    places = [(x, y) for x in range(800, 5300, 500) for y in range(500, 2100, 500)]
    crowd = tuple(replace(marker, center_mm=place) for place in places)
    middle = replace(marker, center_mm=(3000.0, 1300.0))
    camera = watching(plain, middle, 400.0, (0.2, 0.4))
    wanted = ink(generators, "balanced", plain, crowd, camera, SCALE)
    for quality in QUALITIES:
        found = ink(generators, quality, plain, crowd, camera)
        assert found == pytest.approx(wanted, rel=TOLERANCE), quality
