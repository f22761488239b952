"""Textures that the material layers of all scenes read: noise, artwork, glyphs, reflectance."""

import moderngl
import numpy as np

from fastgen.decals.artwork import art_levels, glyph_coverage, glyph_tiles
from fastgen.files import disk_cache
from fastgen.light.reflectance import dfg_table
from fastgen.render.gl import GLContext
from fastgen.render.textures import levelled_texture, mipmapped_array, noise_texture

Textures = dict[str, moderngl.Texture | moderngl.TextureArray]
"""Textures by sampler name."""


def material_tables(gl: GLContext) -> Textures:
    """Return the textures, which the caller releases."""
    tiles, _ = glyph_tiles()
    table = dfg_table()
    dfg = gl.ctx.texture(table.shape[1::-1], 2, table.tobytes(), dtype="f4")
    dfg.repeat_x = dfg.repeat_y = False
    glyphs = np.stack([tiles, glyph_coverage()], axis=-1)
    levels = art_levels()
    art = levelled_texture(gl, levels)
    for level in levels:  # 20 MB that only the next context needs
        disk_cache.unload(level)
    return {
        "noise_tiles": noise_texture(gl),
        "art": art,
        "glyph_tiles": mipmapped_array(gl.ctx, glyphs),
        "dfg_table": dfg,
    }
