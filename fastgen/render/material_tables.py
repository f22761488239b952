"""Textures that the material layers of all scenes read: noise, artwork, glyphs, reflectance."""

import moderngl

from fastgen.decals.artwork import art_levels, glyph_sums, glyph_tiles
from fastgen.files import disk_cache
from fastgen.light.reflectance import dfg_table
from fastgen.render.gl import GLContext
from fastgen.render.textures import clamped_array, levelled_texture, noise_texture

Textures = dict[str, moderngl.Texture | moderngl.TextureArray]
"""Textures by sampler name."""


def material_tables(gl: GLContext) -> Textures:
    """Return the textures, which the caller releases."""
    table = dfg_table()
    dfg = gl.ctx.texture(table.shape[1::-1], 2, table.tobytes(), dtype="f4")
    dfg.repeat_x = dfg.repeat_y = False
    levels = art_levels()
    art = levelled_texture(gl, levels, srgb=True)
    for level in levels:  # 20 MB that only the next context needs
        disk_cache.unload(level)
    tiles, _ = glyph_tiles()
    return {
        "noise_tiles": noise_texture(gl),
        "art": art,
        "glyph_tiles": clamped_array(gl.ctx, tiles),
        "glyph_sums": clamped_array(gl.ctx, glyph_sums()),
        "dfg_table": dfg,
    }
