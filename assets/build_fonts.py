"""Convert assets/fonts/*.woff to one mosaic of signed-distance tiles.

    python assets/build_fonts.py

Run by hand. Needs fastgen, Pillow and scipy. A tile is 64 x 64 and covers a square of 1.6 cap
heights. The ink is centred horizontally, and the baseline is 0.3 cap heights above the bottom. The
value 0.5 is on the outline; 0 and 1 are 0.15 cap heights away from it.
"""

import json
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import distance_transform_edt

from fastgen.decals.glyphs import GLYPH_TILE_SIZE as TILE
from fastgen.decals.lettering import (
    BOX,
    BOX_MARGIN_CAPS,
    BOX_STROKE_CAPS,
    TILE_BASELINE_CAPS,
    TILE_CAPS,
    TILE_RANGE_CAPS,
)

FOLDER = Path(__file__).parent / "fonts"
CHARS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-./:,&'()+"
OVERSAMPLING = 12
COLUMNS = 16


def bake(path: Path) -> dict[str, tuple[np.ndarray, float, float, float]]:
    """Return tile, left and right end of the ink, and advance of every character of a font.

    All lengths are in cap heights.
    """
    side = TILE * OVERSAMPLING
    cap_px = side / TILE_CAPS
    probe = ImageFont.truetype(str(path), 1000)
    _, top, _, _ = probe.getbbox("H", anchor="ls")
    font = ImageFont.truetype(str(path), round(1000 * cap_px / -top))
    baked = {}
    for char in CHARS:
        left, _, right, _ = font.getbbox(char, anchor="ls")
        image = Image.new("L", (side, side))
        pen = side / 2 - (left + right) / 2
        ImageDraw.Draw(image).text(
            (pen, side - TILE_BASELINE_CAPS * cap_px), char, fill=255, font=font, anchor="ls"
        )
        pixels = distances(np.asarray(image) > 127)
        baked[char] = (pixels, left / cap_px, right / cap_px, font.getlength(char) / cap_px)
    baked[BOX] = box(max(right - left for _, left, right, _ in (baked[c] for c in "0123456789")))
    return baked


def box(digit_caps: float) -> tuple[np.ndarray, float, float, float]:
    """Return the frame around a digit of the given width, in the form of `bake`."""
    across = np.abs((np.arange(TILE * OVERSAMPLING) + 0.5) / OVERSAMPLING / TILE - 0.5) * TILE_CAPS
    up = (np.arange(TILE * OVERSAMPLING) + 0.5) / OVERSAMPLING / TILE * TILE_CAPS
    half_width = digit_caps / 2 + BOX_MARGIN_CAPS
    # row 0 of the tile is its top
    half_up = np.abs(TILE_CAPS - up - TILE_BASELINE_CAPS - 0.5)
    half_height = 0.5 + BOX_MARGIN_CAPS
    outside = (across[None] > half_width) | (half_up[:, None] > half_height)
    inner = (across[None] < half_width - BOX_STROKE_CAPS) & (
        half_up[:, None] < half_height - BOX_STROKE_CAPS
    )
    return distances(~outside & ~inner), -half_width, half_width, 2 * half_width


def distances(ink: np.ndarray) -> np.ndarray:
    """Return the tile, uint8 [TILE, TILE], of ink bool [N, N]; 127.5 is on the outline."""
    cap_px = TILE * OVERSAMPLING / TILE_CAPS
    signed = distance_transform_edt(ink) - distance_transform_edt(~ink)
    value = 0.5 + signed / cap_px / TILE_RANGE_CAPS
    tile = value.reshape(TILE, OVERSAMPLING, TILE, OVERSAMPLING).mean(axis=(1, 3))
    return np.rint(np.clip(tile, 0, 1) * 255).astype(np.uint8)


def main() -> None:
    """Write fonts/glyphs.png and fonts/glyphs.json."""
    tiles: list[np.ndarray] = []
    fonts = {}
    for path in sorted(FOLDER.glob("*.woff")):
        glyphs = {}
        for char, (tile, left, right, advance) in bake(path).items():
            glyphs[char] = {
                "tile": len(tiles),
                "ink": [round(left, 4), round(right, 4)],
                "advance": round(advance, 4),
            }
            tiles.append(tile)
        fonts[path.stem] = glyphs
    rows = -(-len(tiles) // COLUMNS)
    mosaic = np.zeros((rows * TILE, COLUMNS * TILE), np.uint8)
    for i, tile in enumerate(tiles):
        y, x = divmod(i, COLUMNS)
        mosaic[y * TILE : (y + 1) * TILE, x * TILE : (x + 1) * TILE] = tile
    Image.fromarray(mosaic).save(FOLDER / "glyphs.png", optimize=True)
    text = json.dumps({"tiles": len(tiles), "fonts": fonts}, indent=1)
    (FOLDER / "glyphs.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
