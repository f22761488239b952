"""Textures that the material layers of all scenes read: noise, glyphs, reflectance."""

import moderngl

from fastgen.light.reflectance import dfg_table
from fastgen.render.gl import GLContext
from fastgen.render.glyph_runs import GlyphTable
from fastgen.render.textures import clamped_array, noise_texture

Textures = dict[str, moderngl.Texture | moderngl.TextureArray]
"""Textures by sampler name."""


def material_tables(gl: GLContext, glyphs: GlyphTable) -> Textures:
    """Return the textures, which the caller releases.

    Args:
        gl: Current context.
        glyphs: Glyphs of all fonts.
    """
    table = dfg_table()
    dfg = gl.ctx.texture(table.shape[1::-1], 2, table.tobytes(), dtype="f4")
    dfg.repeat_x = dfg.repeat_y = False
    return {
        "noise_tiles": noise_texture(gl),
        "glyph_tiles": clamped_array(gl.ctx, glyphs.tiles),
        "glyph_sums": clamped_array(gl.ctx, glyphs.sums),
        "dfg_table": dfg,
    }
