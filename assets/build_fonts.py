"""Convert assets/fonts/*.woff to one mosaic of signed-distance tiles.

    python assets/build_fonts.py

Run by hand. Needs fastgen. See fastgen.decals.font_tiles.
"""

import json
from pathlib import Path

import numpy as np
from PIL import Image

from fastgen.decals.font_tiles import font_tiles, typeface
from fastgen.decals.glyphs import GLYPH_TILE_SIZE as TILE

FOLDER = Path(__file__).parent / "fonts"
COLUMNS = 16


def main() -> None:
    """Write fonts/glyphs.png and fonts/glyphs.json."""
    tiles: list[np.ndarray] = []
    fonts = {}
    for path in sorted(FOLDER.glob("*.woff")):
        glyphs = {}
        for char, made in font_tiles(typeface(path)).items():
            glyphs[char] = {
                "tile": len(tiles),
                "ink": [round(made.ink_left, 4), round(made.ink_right, 4)],
                "advance": round(made.advance, 4),
            }
            tiles.append(made.distances)
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
